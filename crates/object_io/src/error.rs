//! Errors of object access: one variant per remedy.

use std::path::PathBuf;

/// Error of an object store; each variant names the address.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "each field is named for what it holds")]
pub enum Error {
    /// The address is invalid.
    #[error("`{text}` is no address of an object: {detail}")]
    Address { text: String, detail: String },
    /// Credentials or an endpoint are missing or cannot be read.
    #[error("{place} cannot be asked: {detail}")]
    Settings { place: String, detail: String },
    /// The program has no clients of object stores.
    #[error("{address} cannot be asked: this program was built without the feature `cloud`")]
    NotBuilt { address: String },
    /// The object or bucket does not exist.
    #[error("{address} does not exist")]
    Missing { address: String },
    /// Authentication failed or access is denied.
    #[error("{address} may not be read or written by these credentials: {detail}")]
    Denied { address: String, detail: String },
    /// The object was replaced while it was read.
    #[error("{address} was replaced while it was read")]
    Changed { address: String },
    /// The object already exists.
    #[error("{address} already exists")]
    Exists { address: String },
    /// No complete response within the retry time.
    #[error("{address} cannot be reached, tried for {tried_s:.0} s: {detail}")]
    Unreachable { address: String, tried_s: f64, detail: String },
    /// The temporary file of the fetched ranges cannot be written.
    #[error("what is fetched of {address} cannot be kept in {}: {source}", folder.display())]
    Spool { address: String, folder: PathBuf, source: std::io::Error },
}

impl Error {
    pub(crate) fn no_scheme(text: String) -> Self {
        Self::Address { text, detail: "it begins with none of s3://, gs:// and az://".to_owned() }
    }

    /// Stable error code, documented in `docs/errors.md`.
    pub fn code(&self) -> &'static str {
        match self {
            Self::Address { .. } => "object_address",
            Self::Settings { .. } => "object_settings",
            Self::NotBuilt { .. } => "object_not_built",
            Self::Missing { .. } => "object_missing",
            Self::Denied { .. } => "object_denied",
            Self::Changed { .. } => "object_changed",
            Self::Exists { .. } => "object_exists",
            Self::Unreachable { .. } => "object_unreachable",
            Self::Spool { .. } => "object_spool",
        }
    }

    /// Instruction that resolves the error.
    pub fn remedy(&self) -> &'static str {
        match self {
            Self::Address { .. } => "write it as s3://bucket/key, gs://bucket/key or az://container/key",
            Self::Settings { .. } => "docs/objects.md lists the variables and profiles that are read",
            Self::NotBuilt { .. } => "build it with its default features: `cargo build --release -p cli`",
            Self::Missing { .. } => "are bucket, key and region right? `aws s3 ls` shows what is there",
            Self::Denied { .. } => {
                "are the credentials of the right account, not expired, and allowed to list and read here?"
            }
            Self::Changed { .. } => "the object may still be uploading; the next run reads it again",
            Self::Exists { .. } => "does another run write into this store?",
            Self::Unreachable { .. } => {
                "is the network up, and the endpoint right? The next run tries again; `[objects]` sets how long"
            }
            Self::Spool { .. } => "make room there, or name another folder in TMPDIR",
        }
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
fn root_cause(error: &object_store::Error) -> String {
    let mut cause: &dyn std::error::Error = error;
    while let Some(next) = cause.source() {
        cause = next;
    }
    let text = cause.to_string();
    let line: String = text.split_whitespace().collect::<Vec<_>>().join(" ");
    line.chars().take(300).collect()
}
