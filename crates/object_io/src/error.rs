//! Errors of object access: one variant per remedy.

use std::path::PathBuf;

use strum::EnumMessage;

/// Error of an object store; each variant names the address.
#[derive(Debug, thiserror::Error, strum::IntoStaticStr, strum::EnumMessage)]
#[strum(serialize_all = "snake_case", prefix = "object_")]
#[expect(
    missing_docs,
    reason = "each variant says by its message what is wrong, and names its fields for what they hold"
)]
pub enum Error {
    #[error("`{text}` is no address of an object: {detail}")]
    #[strum(message = "write it as s3://bucket/key, gs://bucket/key or az://container/key")]
    Address { text: String, detail: String },
    #[error("{place} cannot be asked: {detail}")]
    #[strum(message = "docs/objects.md lists the variables and profiles that are read")]
    Settings { place: String, detail: String },
    #[error("{address} cannot be asked: this program was built without the feature `cloud`")]
    #[strum(message = "build it with its default features: `cargo build --release -p cli`")]
    NotBuilt { address: String },
    #[error("{address} does not exist")]
    #[strum(message = "are bucket, key and region right? `aws s3 ls` shows what is there")]
    Missing { address: String },
    #[error("{address} may not be read or written by these credentials: {detail}")]
    #[strum(
        message = "are the credentials of the right account, not expired, and allowed to list and read here?"
    )]
    Denied { address: String, detail: String },
    #[error("{address} was replaced while it was read")]
    #[strum(message = "the object may still be uploading; the next run reads it again")]
    Changed { address: String },
    #[error("{address} already exists")]
    #[strum(message = "does another run write into this store?")]
    Exists { address: String },
    #[error("{address} cannot be reached, tried for {tried_s:.0} s: {detail}")]
    #[strum(
        message = "is the network up, and the endpoint right? The next run tries again; `[objects]` sets how long"
    )]
    Unreachable { address: String, tried_s: f64, detail: String },
    #[error("what is fetched of {address} cannot be kept in {}: {source}", folder.display())]
    #[strum(message = "make room there, or name another folder in TMPDIR")]
    Spool { address: String, folder: PathBuf, source: std::io::Error },
}

impl Error {
    pub(crate) fn no_scheme(text: String) -> Self {
        Self::Address { text, detail: "it begins with none of s3://, gs:// and az://".to_owned() }
    }

    /// Stable error code, documented in `docs/errors.md`.
    pub fn code(&self) -> &'static str {
        self.into()
    }

    /// Instruction that resolves the error.
    pub fn remedy(&self) -> &'static str {
        self.get_message().unwrap_or_default()
    }

    /// Whether the same request may succeed later although nothing is changed here.
    pub fn is_passing(code: &str) -> bool {
        matches!(
            code,
            "object_unreachable" | "object_changed" | "object_denied" | "object_settings" | "object_spool"
        )
    }

    /// Converts an `object_store` error about an address.
    pub fn of(address: &impl ToString, tried_s: f64, error: &object_store::Error) -> Self {
        use object_store::Error as Of;
        let (address, detail) = (address.to_string(), root_cause(error));
        match error {
            Of::NotFound { .. } => Self::Missing { address },
            Of::PermissionDenied { .. } | Of::Unauthenticated { .. } => Self::Denied { address, detail },
            Of::Precondition { .. } => Self::Changed { address },
            Of::AlreadyExists { .. } => Self::Exists { address },
            Of::InvalidPath { .. } => Self::Address { text: address, detail },
            Of::NotSupported { .. } | Of::NotImplemented { .. } | Of::UnknownConfigurationKey { .. } => {
                Self::Settings { place: address, detail }
            }
            _ => Self::Unreachable { address, tried_s, detail },
        }
    }
}

/// Message of the innermost cause: the outer ones repeat the address.
pub(crate) fn root_cause(error: &dyn std::error::Error) -> String {
    let mut cause = error;
    while let Some(next) = cause.source() {
        cause = next;
    }
    let text = cause.to_string();
    let line: String = text.split_whitespace().collect::<Vec<_>>().join(" ");
    line.chars().take(300).collect()
}
