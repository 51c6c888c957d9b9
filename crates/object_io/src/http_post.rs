//! HTTP addresses, and the outcome of a post to one.

use url::Url;

/// Outcome of a post.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Posted {
    /// The receiver answered with this status.
    Answered(u16),
    /// No connection was made: the receiver has nothing.
    NotSent(String),
    /// No complete answer: the receiver may have the document.
    Unknown(String),
}

/// Checks an address of HTTP. The message of an error omits the address, which may hold a secret.
///
/// # Errors
/// If it is not one; the message omits the address, which may hold a secret.
pub fn check_url(text: &str) -> Result<(), String> {
    parse(text).map(drop)
}

pub(crate) fn parse(text: &str) -> Result<Url, String> {
    let url = Url::parse(text).map_err(|e| e.to_string())?;
    match url.scheme() {
        _ if url.host_str().is_none_or(str::is_empty) => Err("it has no host".to_owned()),
        "http" | "https" if url.username().is_empty() && url.password().is_none() => Ok(url),
        "http" | "https" => Err("it holds a user name or a password".to_owned()),
        other => Err(format!("its scheme is `{other}`")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_address_of_another_kind_is_refused_without_being_quoted() {
        assert_eq!(check_url("https://chat.example.com/hooks/SECRET"), Ok(()));
        for text in
            ["hooks/SECRET", "ftp://example.com/SECRET", "https:///", "https://me:SECRET@example.com/"]
        {
            let detail = check_url(text).unwrap_err();
            assert!(!detail.contains("SECRET"), "{detail}");
        }
    }
}
