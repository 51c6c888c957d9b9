//! `init`: a commented configuration and an example table, never over something that is there.

use std::fs::{self, OpenOptions};
use std::io::{ErrorKind, Write};
use std::path::Path;

use crate::args::InitArgs;
use crate::exit::{Code, Failure};
use crate::talk::Talk;

use super::shown;

const FILES: [(&str, &str); 2] = [
    ("pipeline.toml", include_str!("../../templates/pipeline.toml")),
    ("installations.csv", include_str!("../../templates/installations.csv")),
];

/// Writes both files.
///
/// # Errors
/// When one of them is there already; then nothing is written.
pub(crate) fn init(args: &InitArgs, talk: &Talk) -> Result<Code, Failure> {
    let there = FILES.iter().map(|(name, _)| args.dir.join(name)).find(|path| path.exists());
    if let Some(path) = there {
        return Err(exists(&path));
    }
    fs::create_dir_all(&args.dir)?;
    for (name, text) in FILES {
        let path = args.dir.join(name);
        let file = OpenOptions::new().write(true).create_new(true).open(&path);
        let mut file =
            file.map_err(|e| if e.kind() == ErrorKind::AlreadyExists { exists(&path) } else { e.into() })?;
        file.write_all(text.as_bytes())?;
        talk.answer(&format!("wrote {}\n", shown(&path)))?;
    }
    talk.note("next: say in pipeline.toml where your logs are and what their columns are called, then `freeplay check`");
    Ok(Code::Well)
}

fn exists(path: &Path) -> Failure {
    let what = format!("{} is there already", shown(path));
    Failure::usage("would_overwrite", what, "`freeplay init DIR` writes elsewhere; nothing was changed")
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What we hand to a newcomer must pass our own checks.
    #[test]
    fn the_configuration_we_hand_out_is_a_good_one() {
        let read = job::Config::parse(FILES[0].1, Path::new("pipeline.toml"), Path::new("."));
        assert!(read.is_ok(), "{:?}", read.err());
        let dir = tempfile::tempdir().unwrap();
        let table = dir.path().join("installations.csv");
        fs::write(&table, FILES[1].1).unwrap();
        assert!(ingest::tables::installations(&table, &std::collections::BTreeMap::new()).is_ok());
    }
}
