//! AWS profile reader: keys, region and endpoint of `~/.aws/credentials` and `~/.aws/config`.
//!
//! `object_store` reads the environment only. Profiles that use a role, single sign-on or a credential process
//! are rejected by name, never treated as absent.

use std::path::{Path, PathBuf};

use configparser::ini::Ini;
use object_store::aws::AmazonS3ConfigKey as Key;

const SUPPORTED: [(&str, Key); 5] = [
    ("aws_access_key_id", Key::AccessKeyId),
    ("aws_secret_access_key", Key::SecretAccessKey),
    ("aws_session_token", Key::Token),
    ("region", Key::Region),
    ("endpoint_url", Key::Endpoint),
];
const UNSUPPORTED: [&str; 5] =
    ["role_arn", "sso_session", "sso_start_url", "credential_process", "source_profile"];

/// Settings of the profile that the environment selects, by the same variables as the AWS tools.
pub(crate) fn from_env() -> Result<Vec<(Key, String)>, String> {
    let variable = |name| std::env::var_os(name).filter(|value| !value.is_empty());
    let home = variable("HOME").or_else(|| variable("USERPROFILE")).map(PathBuf::from);
    let file = |name, usual| {
        variable(name).map(PathBuf::from).or_else(|| Some(home.as_ref()?.join(".aws").join(usual)))
    };
    let profile = std::env::var("AWS_PROFILE").ok().filter(|name| !name.is_empty());
    let credentials = file("AWS_SHARED_CREDENTIALS_FILE", "credentials");
    read(profile.as_deref(), credentials.as_deref(), file("AWS_CONFIG_FILE", "config").as_deref())
}

/// Supported settings of a profile; empty when none is selected and there is no default.
fn read(
    profile: Option<&str>,
    credentials: Option<&Path>,
    config: Option<&Path>,
) -> Result<Vec<(Key, String)>, String> {
    let name = profile.unwrap_or("default");
    let section = if name == "default" { name.to_owned() } else { format!("profile {name}") };
    let sources = [(config, section.as_str()), (credentials, name)];
    let (mut found, mut is_there, mut other) = (Vec::new(), false, None);
    for (file, section) in sources {
        let Some(ini) = file.map(load).transpose()?.flatten() else { continue };
        is_there |= ini.sections().iter().any(|known| known == section);
        found.extend(SUPPORTED.iter().filter_map(|(name, key)| Some((*key, ini.get(section, name)?))));
        other = other.or_else(|| UNSUPPORTED.into_iter().find(|key| ini.get(section, key).is_some()));
    }
    match other {
        _ if !is_there && profile.is_some() => Err(format!("there is no profile `{name}`")),
        Some(key) if !found.iter().any(|(key, _)| *key == Key::AccessKeyId) => Err(format!(
            "profile `{name}` has `{key}`, which is not read: \
             `aws configure export-credentials --profile {name} --format env` makes variables of it"
        )),
        _ => Ok(found),
    }
}

fn load(file: &Path) -> Result<Option<Ini>, String> {
    let text = match std::fs::read_to_string(file) {
        Ok(text) => text,
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => return Ok(None),
        Err(e) => return Err(format!("{} cannot be read: {e}", file.display())),
    };
    // Profile names are case-sensitive.
    let mut ini = Ini::new_cs();
    ini.read(text).map_err(|e| format!("{} is no profile file: {e}", file.display()))?;
    Ok(Some(ini))
}

#[cfg(test)]
mod tests {
    use super::*;

    const CREDENTIALS: &str = "[default]\naws_access_key_id = AKIDEFAULT\naws_secret_access_key = s1\n\n[Night]\n\
                               aws_access_key_id=AKINIGHT\naws_secret_access_key=s2\naws_session_token=t2\n";
    const CONFIG: &str = "[default]\nregion = eu-central-1\n[profile Night]\nregion = eu-west-1\n\
                          endpoint_url = https://store.example.com\ns3 =\n  max_concurrent_requests = 4\n\
                          [profile sso]\nsso_session = hangar\nregion = eu-west-1\n";

    fn read_profile(profile: Option<&str>) -> Result<Vec<(Key, String)>, String> {
        let dir = tempfile::tempdir().unwrap();
        let file = |name: &str, text: &str| {
            let path = dir.path().join(name);
            std::fs::write(&path, text).unwrap();
            path
        };
        read(profile, Some(&file("credentials", CREDENTIALS)), Some(&file("config", CONFIG)))
    }

    fn value(found: &[(Key, String)], wanted: Key) -> Option<&str> {
        found.iter().find(|(key, _)| *key == wanted).map(|(_, value)| value.as_str())
    }

    #[test]
    fn keys_region_and_endpoint_are_read_from_both_files() {
        let found = read_profile(Some("Night")).unwrap();
        assert_eq!(value(&found, Key::AccessKeyId), Some("AKINIGHT"));
        assert_eq!(value(&found, Key::Token), Some("t2"));
        assert_eq!(value(&found, Key::Region), Some("eu-west-1"));
        assert_eq!(value(&found, Key::Endpoint), Some("https://store.example.com"));
        let usual = read_profile(None).unwrap();
        assert_eq!(value(&usual, Key::AccessKeyId), Some("AKIDEFAULT"));
        assert_eq!(value(&usual, Key::Region), Some("eu-central-1"));
    }

    #[test]
    fn an_unsupported_profile_is_rejected_by_name() {
        assert!(read_profile(Some("sso")).unwrap_err().contains("`sso_session`, which is not read"));
        assert!(read_profile(Some("gone")).unwrap_err().contains("no profile `gone`"));
        assert!(read(None, Some(Path::new("/nowhere/c")), None).unwrap().is_empty());
    }
}
