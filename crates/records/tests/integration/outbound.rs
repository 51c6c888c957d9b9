//! SECURITY.md names every place that opens a connection or starts a program.

use std::collections::BTreeSet;
use std::path::Path;

/// Words of code that connects or starts a program, and the files that may hold them, with what SECURITY.md calls them.
const ALLOWED: [(&str, &[&str], &str); 6] = [
    ("Command::new", &["pipeline/src/findings/channel.rs"], "alert commands"),
    ("reqwest", &["object_io/src/cloud/http_client.rs"], "alerts"),
    ("object_store::aws", &["object_io/src/cloud/"], "object stores"),
    ("TcpStream", &[], ""),
    ("UdpSocket", &[], ""),
    ("UnixStream", &[], ""),
];

fn check(folder: &Path, crates: &Path, found: &mut BTreeSet<String>) {
    for entry in std::fs::read_dir(folder).unwrap().flatten() {
        let path = entry.path();
        if path.is_dir() {
            check(&path, crates, found);
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            let text = std::fs::read_to_string(&path).unwrap();
            let code = text.split("#[cfg(test)]").next().unwrap_or_default();
            let name = path.strip_prefix(crates).unwrap().to_str().unwrap().replace('\\', "/");
            let lines = || code.lines().filter(|line| !line.trim_start().starts_with("//"));
            for (word, files, _) in ALLOWED {
                if lines().any(|line| line.contains(word)) && !files.iter().any(|file| name.starts_with(file))
                {
                    found.insert(format!("{name} uses {word}"));
                }
            }
        }
    }
}

#[test]
fn security_md_names_what_connects_and_what_is_started() {
    let top = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let crates = top.join("crates");
    let mut found = BTreeSet::new();
    for entry in std::fs::read_dir(&crates).unwrap().flatten() {
        let source = entry.path().join("src");
        if source.is_dir() {
            check(&source, &crates, &mut found);
        }
    }
    assert!(found.is_empty(), "name it in SECURITY.md, and here: {found:#?}");
    let security = std::fs::read_to_string(top.join("SECURITY.md")).unwrap();
    for (word, files, name) in ALLOWED.iter().filter(|(_, files, _)| !files.is_empty()) {
        let row = security.lines().find(|line| line.starts_with(&format!("| {name} |")));
        assert!(row.is_some(), "SECURITY.md has no row `{name}` for {word}");
        let is_used = files.iter().any(|file| crates.join(file).exists());
        assert!(is_used, "no file {files:?}: remove the row `{name}`");
    }
}
