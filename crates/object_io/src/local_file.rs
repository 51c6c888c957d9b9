//! Local files: creation of a temporary file that is renamed when it is complete, and errors of the operating system.

use std::fs::{self, File};
use std::io;
use std::path::Path;

/// Creates a file, and replaces one that an earlier process left. A link of that name is replaced, not followed.
///
/// # Errors
/// If an old file cannot be removed, or another process creates the file at the same time.
pub fn create_fresh(path: &Path) -> io::Result<File> {
    match fs::remove_file(path) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(error),
        _ => {}
    }
    File::create_new(path)
}

/// The error of the operating system whose number a message contains, in the form of the standard library:
/// `(os error 24)`. Libraries that read files wrap this error in their own, or keep only its text.
pub fn system_error(text: &str) -> Option<io::Error> {
    let number = text.rsplit_once("(os error ")?.1.split_once(')')?.0.parse().ok()?;
    Some(io::Error::from_raw_os_error(number))
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;

    #[test]
    fn a_link_is_replaced_and_its_target_stays() {
        let dir = tempfile::tempdir().unwrap();
        let (target, link) = (dir.path().join("target"), dir.path().join("link"));
        fs::write(&target, "years").unwrap();
        std::os::unix::fs::symlink(&target, &link).unwrap();
        create_fresh(&link).unwrap();
        assert_eq!(fs::read_to_string(&target).unwrap(), "years");
        assert!(fs::symlink_metadata(&link).unwrap().is_file());
    }
}
