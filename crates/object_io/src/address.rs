//! Object address: scheme, bucket and key.

use std::path::Path;
use std::sync::Arc;

use object_store::ObjectStore;
use strum::{IntoStaticStr, VariantArray};

use crate::error::Error;

/// Client of a bucket, shared by all requests to that bucket.
pub type Client = Arc<dyn ObjectStore>;

/// Kind of object store, by the beginning of its addresses.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, IntoStaticStr, VariantArray)]
#[strum(serialize_all = "lowercase", suffix = "://")]
pub(crate) enum Scheme {
    S3,
    Gs,
    Az,
}

/// Whether a path is an object address, or is meant as one: `S3://` and `s3:/` would otherwise become a folder's name.
pub fn is_address(path: impl AsRef<Path>) -> bool {
    const MEANT: [&str; 11] =
        ["s3", "s3a", "s3n", "gs", "gcs", "az", "abfs", "abfss", "file", "http", "https"];
    let scheme = path.as_ref().to_str().and_then(|text| text.split_once(":/"));
    scheme.is_some_and(|(scheme, _)| MEANT.iter().any(|meant| scheme.eq_ignore_ascii_case(meant)))
}

/// Parsed object address.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Address {
    pub(crate) scheme: Scheme,
    pub(crate) bucket: String,
    key: String,
}

impl Address {
    /// Parses an address; `None` when the path is not one. A misspelled scheme is an error, as is a missing bucket.
    ///
    /// # Errors
    /// [`Error::Address`] when it names no bucket, or its scheme is misspelled or unknown.
    pub fn parse(path: impl AsRef<Path>) -> Result<Option<Self>, Error> {
        let Some(text) = path.as_ref().to_str() else { return Ok(None) };
        let scheme = Scheme::VARIANTS
            .iter()
            .find_map(|scheme| Some((*scheme, text.strip_prefix(<&str>::from(scheme))?)));
        let Some((scheme, rest)) = scheme else {
            if !is_address(text) {
                return Ok(None);
            }
            let (before, rest) = text.split_once(":/").unwrap_or((text, ""));
            let whole = format!("{before}://{}", rest.trim_start_matches('/'));
            return Err(Error::no_scheme(without_credentials(&whole).unwrap_or(whole)));
        };
        if let Some(text) = without_credentials(text) {
            let detail = "it contains credentials: set them as variables or in a profile (docs/objects.md)";
            return Err(Error::Address { text, detail: detail.to_owned() });
        }
        let (bucket, key) = rest.split_once('/').unwrap_or((rest, ""));
        if bucket.is_empty() {
            return Err(Error::Address { text: text.to_owned(), detail: "it names no bucket".to_owned() });
        }
        Ok(Some(Self { scheme, bucket: bucket.to_owned(), key: key.trim_end_matches('/').to_owned() }))
    }

    /// As [`Address::parse`], for a path that must be an address.
    ///
    /// # Errors
    /// [`Error::Address`] when it is not an address or names no bucket.
    pub fn parse_required(path: impl AsRef<Path>) -> Result<Self, Error> {
        let path = path.as_ref();
        Self::parse(path)?.ok_or_else(|| Error::no_scheme(path.display().to_string()))
    }

    /// The key: the text after the bucket, without a trailing slash.
    pub fn key(&self) -> &str {
        &self.key
    }

    /// The key as an `object_store` path.
    ///
    /// # Errors
    /// [`Error::Address`] for a key with `//`, `.` or `..` as a folder.
    pub fn location(&self) -> Result<object_store::path::Path, Error> {
        object_store::path::Path::parse(&self.key)
            .map_err(|e| Error::Address { text: self.to_string(), detail: e.to_string() })
    }

    /// The address of another key of this bucket.
    #[must_use]
    pub fn with_key(&self, key: &str) -> Self {
        Self { key: key.to_owned(), ..self.clone() }
    }

    /// The bucket as an address, with a trailing slash.
    pub fn bucket_url(&self) -> String {
        format!("{}{}/", <&str>::from(self.scheme), self.bucket)
    }
}

/// Parameters of a signed address. They grant access to every reader of the address, so output hides them.
const SECRET_PARAMETERS: [&str; 6] = [
    "sig=",
    "signature=",
    "x-amz-signature=",
    "x-amz-security-token=",
    "x-goog-signature=",
    "sharedaccesssignature=",
];

/// The address with its credentials masked; `None` when it contains none.
///
/// Credentials are `user:password@` before the bucket, or a query with a signature. Other question marks are part of a
/// key or a pattern.
fn without_credentials(text: &str) -> Option<String> {
    let (scheme, rest) = text.split_once("://")?;
    let authority = rest.split('/').next().unwrap_or(rest);
    // A bucket has neither sign; a password may contain a slash.
    let has_user = authority.contains(['@', ':']);
    let shown = rest.rsplit_once('@').map_or("", |(_, bucket)| bucket);
    let shown = if has_user { shown } else { rest };
    let is_signed = |query: &str| {
        let query = query.to_ascii_lowercase();
        query.split(['?', '&']).any(|one| SECRET_PARAMETERS.iter().any(|secret| one.starts_with(secret)))
    };
    let signed = shown.find('?').filter(|at| is_signed(&shown[at + 1..]));
    if !has_user && signed.is_none() {
        return None;
    }
    let (user, path) = (if has_user { "***@" } else { "" }, &shown[..signed.unwrap_or(shown.len())]);
    Some(format!("{scheme}://{user}{path}{}", if signed.is_some() { "?***" } else { "" }))
}

impl std::fmt::Display for Address {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}{}", self.bucket_url(), self.key)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_address_is_distinguished_from_a_path_and_parsed_with_a_bucket_and_without_an_empty_folder() {
        for path in ["logs/a.parquet", "/s3/a", "C:/logs/a", "my:/logs"] {
            assert!(!is_address(path), "{path}");
            assert_eq!(Address::parse(path).unwrap(), None);
        }
        let address = Address::parse_required("s3://fleet/logs/N1/a b.parquet").unwrap();
        assert_eq!((address.bucket.as_str(), address.key()), ("fleet", "logs/N1/a b.parquet"));
        assert_eq!(address.to_string(), "s3://fleet/logs/N1/a b.parquet");
        assert_eq!(Address::parse_required("gs://fleet").unwrap().bucket_url(), "gs://fleet/");
        assert!(Address::parse("az:///logs").unwrap_err().to_string().contains("no bucket"));
        assert!(Address::parse_required("s3://fleet/logs//a").unwrap().location().is_err());
    }

    #[test]
    fn credentials_in_an_address_are_refused_and_never_shown() {
        for (text, masked) in [
            ("s3://AKIA:hunter2@fleet/logs", "s3://***@fleet/logs"),
            ("s3://AKIA:hun/ter2@fleet/logs", "s3://***@fleet/logs"),
            ("az://logs/a.parquet?sv=2022&sig=hunter2", "az://logs/a.parquet?***"),
            ("S3://AKIA:hunter2@fleet/logs", "S3://***@fleet/logs"),
            ("s3:/AKIA:hunter2@fleet/logs", "s3://***@fleet/logs"),
            ("file://AKIA:hunter2@host/logs", "file://***@host/logs"),
            ("s3://fleet/a?X-Amz-Signature=hunter2", "s3://fleet/a?***"),
        ] {
            let error = Address::parse(text).unwrap_err().to_string();
            assert!(error.contains(masked) && !error.contains("ter2"), "{error}");
        }
        assert!(Address::parse("s3://fleet/logs/N1/?.parquet").is_ok(), "a pattern");
        assert!(Address::parse("s3://fleet/logs/a@b.parquet").is_ok(), "a key");
    }
}
