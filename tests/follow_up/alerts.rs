//! Alerts of the command on the small fleet to addresses, and the examples of the documentation. Alerts to folders and
//! commands, with faults and kills, are in `tests/data/commands.md`.

use std::io::{Read, Write};
use std::net::TcpListener;
use std::sync::{Arc, Mutex};

use serde_json::Value;

use crate::harness::{CommandResult, TestFleet, top};

/// Units that `freeplay trend` finds in `plan` on the small fleet.
const IN_PLAN: [&str; 2] = ["1040-0009", "1040-0013"];

fn run(fleet: &TestFleet) -> CommandResult {
    fleet.freeplay(&["run", "--json"])
}

fn serials(messages: &[Value]) -> Vec<&str> {
    let changes = messages.iter().filter(|message| message["kind"] == "change");
    let mut serials: Vec<&str> = changes.map(|message| message["serial_number"].as_str().unwrap()).collect();
    serials.sort_unstable();
    serials
}

/// Code of the answer and body of each request.
type Received = Arc<Mutex<Vec<(u16, Value)>>>;

/// A receiver on loopback that answers with the codes in turn, and keeps the bodies it accepted.
fn receiver(codes: &'static [u16]) -> (String, Received) {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let url = format!("http://{}/hooks/SECRET", listener.local_addr().unwrap());
    let got = Arc::new(Mutex::new(Vec::new()));
    let kept = Arc::clone(&got);
    std::thread::spawn(move || {
        for (stream, code) in listener.incoming().zip(codes.iter().chain(std::iter::repeat(&200))) {
            let mut stream = stream.unwrap();
            let (mut request, mut chunk) = (Vec::new(), [0; 4096]);
            let body = loop {
                let n = stream.read(&mut chunk).unwrap();
                request.extend_from_slice(&chunk[..n]);
                let text = String::from_utf8_lossy(&request).into_owned();
                let body = text.split_once("\r\n\r\n").map(|(_, body)| body.to_owned());
                if let Some(body) = body.and_then(|body| serde_json::from_str(&body).ok()) {
                    break body;
                }
                assert!(n > 0, "{text}");
            };
            kept.lock().unwrap().push((*code, body));
            write!(stream, "HTTP/1.1 {code} X\r\nContent-Length: 0\r\nConnection: close\r\n\r\n").unwrap();
        }
    });
    (url, got)
}

#[test]
fn an_address_gets_each_change_once_after_it_answered_with_an_error() {
    let (url, got) = receiver(&[200, 500, 503]);
    let fleet = TestFleet::sample();
    fleet.configure_also(&format!("[alerts.chat]\nurl = \"{url}\"\ntails = [\"N41[34]FP\"]\n"));
    // No unit needs attention within one hour, two do within 500 hours (README).
    let [short, long] = ["1.0", "500.0"].map(|hours| format!("planning_horizon_hours = {hours}"));
    fleet.configure(&long, &short);
    fleet.run_ok(&["run", "--quiet"]);
    fleet.configure(&short, &long);
    let result = run(&fleet);
    assert_eq!(result.code, Some(5), "{result:?}");
    assert!(
        result.err.contains("the receiver answered 500") && !result.err.contains("SECRET"),
        "{}",
        result.err
    );
    assert_eq!(run(&fleet).code, Some(0));
    assert_eq!(run(&fleet).code, Some(0));
    let got = got.lock().unwrap();
    let codes: Vec<u16> = got.iter().map(|(code, _)| *code).collect();
    assert_eq!(codes, [200, 500, 503, 200, 200]);
    let accepted: Vec<Value> = got[3..].iter().map(|(_, body)| body.clone()).collect();
    assert_eq!(serials(&accepted), IN_PLAN);
    let bodies = |range: std::ops::Range<usize>| {
        let mut bodies: Vec<String> = got[range].iter().map(|(_, body)| body.to_string()).collect();
        bodies.sort();
        bodies
    };
    assert_eq!(bodies(1..3), bodies(3..5), "every attempt sends the same message");
    // Nothing that the program writes about a channel shows its address.
    let rows = fleet.run_ok(&["store", "alerts", "--json"]);
    assert!(!rows.contains("SECRET"), "{rows}");
}

/// The scripts of the documentation, with a stand-in for `sendmail` and a receiver on loopback.
#[test]
#[cfg(unix)]
fn the_examples_of_a_mail_and_of_a_chat_message_work() {
    use std::os::unix::fs::PermissionsExt;
    let (url, got) = receiver(&[]);
    let fleet = TestFleet::sample();
    std::fs::create_dir(fleet.path("bin")).unwrap();
    for (name, text) in
        [("bin/sendmail", "#!/bin/sh\ncat >> \"$(dirname \"$0\")\"/../mails\n"), ("hook", &url)]
    {
        std::fs::write(fleet.path(name), text).unwrap();
    }
    std::fs::set_permissions(fleet.path("bin/sendmail"), PermissionsExt::from_mode(0o755)).unwrap();
    let script = |name: &str| top().join("docs/alerts").join(name).display().to_string();
    fleet.configure_also(&format!(
        "[alerts.mail]\ncommand = [\"python3\", {:?}, \"planner@example.com\", \"freeplay@example.com\"]\n\
         [alerts.chat]\ncommand = [\"python3\", {:?}, \"hook\"]\n",
        script("mail.py"),
        script("chat.py")
    ));
    // A name that would add a header to a mail, and address everyone in a chat.
    let name = "\"<!channel> @all\nBcc: all@example.com\"";
    fleet.edit("sample-data/installations.csv", |text| text.replace("1040-0013", name));
    let path = format!("{}:{}", fleet.path("bin").display(), std::env::var("PATH").unwrap());
    let run = |args: &[&str]| {
        let output = fleet.command(args).env("PATH", &path).output().unwrap();
        assert_eq!(output.status.code(), Some(0), "{output:?}");
    };
    run(&["run", "--quiet", "--until", "2026-09-22"]);
    run(&["run", "--quiet"]);
    let mails = fleet.read("mails");
    let headers = |name: &str| mails.lines().filter(|line| line.starts_with(name)).count();
    assert_eq!((headers("To: planner@example.com"), headers("Message-ID: <2026")), (3, 3), "{mails}");
    assert_eq!(headers("Bcc:"), 0, "{mails}");
    assert!(mails.contains("work request W1"), "{mails}");
    let got = got.lock().unwrap();
    let texts: Vec<&str> = got.iter().map(|(_, body)| body["text"].as_str().unwrap()).collect();
    assert_eq!(texts.len(), 3);
    assert!(texts[0].starts_with("Alerts begin with 12 units"), "{texts:?}");
    assert!(
        texts.iter().any(|text| text.starts_with("🟠 EMA-27-1040 / 1040-0009") && text.ends_with("W1")),
        "{texts:?}"
    );
    assert!(texts.iter().all(|text| !text.contains("<!channel>") && !text.contains("@all")), "{texts:?}");
}
