//! SECURITY.md names every place that opens a connection or starts a program.

use std::collections::BTreeSet;

use crate::architecture::{root, sources};

/// Words of code that connects or starts a program, and the files that may hold them, with what SECURITY.md calls them.
const ALLOWED: [(&str, &[&str], &str); 6] = [
    ("Command::new", &["pipeline/src/findings/channel.rs"], "alert commands"),
    ("reqwest", &["object_io/src/cloud/http_client.rs"], "alerts"),
    ("object_store::aws", &["object_io/src/cloud/"], "object stores"),
    ("TcpStream", &[], ""),
    ("UdpSocket", &[], ""),
    ("UnixStream", &[], ""),
];

#[test]
fn security_md_names_what_connects_and_what_is_started() {
    let top = root();
    let crates = top.join("crates");
    let mut found = BTreeSet::new();
    for file in sources(&crates) {
        let name = file.strip_prefix(&crates).unwrap().to_str().unwrap().replace('\\', "/");
        if name.split('/').nth(1) != Some("src") {
            continue;
        }
        let text = std::fs::read_to_string(&file).unwrap();
        let code = text.split("#[cfg(test)]").next().unwrap_or_default();
        let lines = || code.lines().filter(|line| !line.trim_start().starts_with("//"));
        for (word, files, _) in ALLOWED {
            if lines().any(|line| line.contains(word)) && !files.iter().any(|file| name.starts_with(file)) {
                found.insert(format!("{name} uses {word}"));
            }
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
