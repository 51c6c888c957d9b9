//! Replaces the clients of buckets and of HTTP in a build without the feature `cloud`.

use std::time::Duration;

use crate::address::{Address, Client};
use crate::error::Error;
use crate::http_post::Posted;

pub(crate) fn client(address: &Address) -> Result<Client, Error> {
    Err(Error::NotBuilt { address: address.to_string() })
}

/// Sends nothing.
pub fn post_json(_url: &str, _body: &str, _timeout: Duration) -> Posted {
    Posted::NotSent("this program was built without the feature `cloud`, which sends over HTTP".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_address_and_a_message_fail_by_naming_the_feature() {
        let error = Address::parse_required("s3://fleet/logs").unwrap().client().err().unwrap();
        assert_eq!(error.code(), "object_not_built");
        assert!(
            error.to_string().contains("s3://fleet/logs") && error.to_string().contains("`cloud`"),
            "{error}"
        );
        let sent = post_json("https://example.com/", "{}", Duration::ZERO);
        assert!(matches!(&sent, Posted::NotSent(why) if why.contains("`cloud`")), "{sent:?}");
    }
}
