//! POST of one JSON document over HTTP, with the client library of the object stores.

use std::time::Duration;

use reqwest::header::CONTENT_TYPE;
use reqwest::redirect::Policy;

use crate::client::handle;
use crate::error::root_cause;
use crate::http_post::{Posted, parse};

/// Posts a JSON document and waits at most `timeout` for the status of the response.
///
/// A redirection is not followed: following it would send a request without the document, or the document to another
/// host. Messages do not contain the address, since it may contain a secret.
pub fn post_json(url: &str, body: &str, timeout: Duration) -> Posted {
    let url = match parse(url) {
        Ok(url) => url,
        Err(detail) => return Posted::NotSent(detail),
    };
    let client = reqwest::Client::builder().redirect(Policy::none()).referer(false);
    let client = match client.timeout(timeout).connect_timeout(timeout).build() {
        Ok(client) => client,
        Err(error) => return Posted::NotSent(root_cause(&error)),
    };
    let request = client.post(url).header(CONTENT_TYPE, "application/json").body(body.to_owned());
    let answer = match handle() {
        Ok(runtime) => runtime.block_on(async { request.send().await }),
        Err(error) => return Posted::NotSent(error.to_string()),
    };
    match answer.map_err(reqwest::Error::without_url) {
        Ok(answer) => Posted::Answered(answer.status().as_u16()),
        Err(error) if error.is_connect() => Posted::NotSent(root_cause(&error)),
        Err(error) if error.is_timeout() => {
            Posted::Unknown(format!("no answer within {:.1} s", timeout.as_secs_f64()))
        }
        Err(error) => Posted::Unknown(root_cause(&error)),
    }
}

#[cfg(test)]
mod tests {
    use std::io::{Read, Write};
    use std::net::TcpListener;

    use super::*;

    const SOON: Duration = Duration::from_millis(500);

    /// Accepts one request, passes it on and responds with `reply`; with an empty reply it never responds.
    fn server(reply: &'static str) -> (String, std::thread::JoinHandle<String>) {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let url = format!("http://{}/hook?token=SECRET", listener.local_addr().unwrap());
        let serve = move || {
            let (mut stream, _) = listener.accept().unwrap();
            stream.set_read_timeout(Some(Duration::from_millis(200))).unwrap();
            let mut request = Vec::new();
            let mut chunk = [0; 1024];
            while let Ok(n @ 1..) = stream.read(&mut chunk) {
                request.extend_from_slice(&chunk[..n]);
                if String::from_utf8_lossy(&request).ends_with('}') {
                    break;
                }
            }
            if reply.is_empty() {
                std::thread::park_timeout(2 * SOON);
            }
            stream.write_all(reply.as_bytes()).unwrap();
            String::from_utf8(request).unwrap()
        };
        (url, std::thread::spawn(serve))
    }

    #[test]
    fn the_document_arrives_as_json_and_the_status_is_returned() {
        for (reply, status) in [
            ("HTTP/1.1 204 No Content\r\nContent-Length: 0\r\n\r\n", 204),
            ("HTTP/1.1 500 Internal Server Error\r\nContent-Length: 0\r\n\r\n", 500),
            ("HTTP/1.1 302 Found\r\nLocation: http://127.0.0.1:1/\r\nContent-Length: 0\r\n\r\n", 302),
            ("HTTP/1.1 307 Moved\r\nLocation: http://127.0.0.1:1/\r\nContent-Length: 0\r\n\r\n", 307),
        ] {
            let (url, served) = server(reply);
            assert_eq!(post_json(&url, "{\"a\":\"µ\"}", SOON), Posted::Answered(status));
            let request = served.join().unwrap();
            assert!(request.starts_with("POST /hook?token=SECRET HTTP/1.1\r\n"), "{request}");
            assert!(request.to_lowercase().contains("content-type: application/json\r\n"), "{request}");
            assert!(!request.to_lowercase().contains("referer"), "{request}");
            assert!(request.ends_with("\r\n\r\n{\"a\":\"µ\"}"), "{request}");
        }
    }

    #[test]
    fn a_silent_receiver_may_have_the_document_and_a_closed_port_has_not() {
        let (url, served) = server("");
        assert_eq!(post_json(&url, "{}", SOON), Posted::Unknown("no answer within 0.5 s".to_owned()));
        served.join().unwrap();
        let free = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap();
        let closed = post_json(&format!("http://{free}/SECRET"), "{}", SOON);
        assert!(matches!(&closed, Posted::NotSent(detail) if !detail.contains("SECRET")), "{closed:?}");
    }
}
