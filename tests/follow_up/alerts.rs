//! Alerts of the command on the small fleet: to folders, commands and addresses, with faults and kills.

use std::io::{Read, Write};
use std::net::TcpListener;
use std::sync::{Arc, Mutex};

use serde_json::Value;

use super::{LONG_HORIZON, SHORT_HORIZON, processed_fleet};
use crate::harness::{CommandResult, TestFleet, top};

/// Units that `freeplay trend` finds in `plan` on the small fleet.
const IN_PLAN: [&str; 2] = ["1040-0009", "1040-0013"];

/// The small fleet with a baseline of states; the next run finds two units in `plan`.
fn fleet(alerts: &str) -> TestFleet {
    let fleet = processed_fleet();
    fleet.configure_also(alerts);
    let first = fleet.freeplay(&["run", "--quiet"]);
    assert!(matches!(first.code, Some(0 | 5)), "{first:?}");
    fleet.configure(SHORT_HORIZON, LONG_HORIZON);
    fleet
}

/// The small fleet until September, where one unit is in `watch`, with a baseline.
fn fleet_of_september() -> TestFleet {
    let fleet = TestFleet::sample();
    fleet.configure_also("[alerts.files]\nfolder = \"alerts\"\n");
    fleet.run_ok(&["run", "--quiet", "--until", "2026-09-22"]);
    fleet
}

fn run(fleet: &TestFleet) -> CommandResult {
    fleet.freeplay(&["run", "--json"])
}

fn summary(result: &CommandResult) -> Value {
    result.json()["alerts"].clone()
}

fn alerts(fleet: &TestFleet) -> Vec<Value> {
    fleet.rows(&["store", "alerts"])
}

fn files(fleet: &TestFleet, folder: &str) -> Vec<Value> {
    let read = |file: std::path::PathBuf| fleet.read_json(file.to_str().unwrap());
    fleet.glob(&format!("{folder}/*")).into_iter().map(read).collect()
}

/// Messages that the command `cat >> got` received.
fn got(fleet: &TestFleet) -> Vec<Value> {
    fleet.read("got").lines().map(|line| serde_json::from_str(line).unwrap()).collect()
}

fn serials(messages: &[Value]) -> Vec<&str> {
    let changes = messages.iter().filter(|message| message["kind"] == "change");
    let mut serials: Vec<&str> = changes.map(|message| message["serial_number"].as_str().unwrap()).collect();
    serials.sort_unstable();
    serials
}

#[test]
fn a_folder_gets_a_summary_first_and_then_one_file_for_each_change() {
    let fleet = fleet_of_september();
    let first = files(&fleet, "alerts");
    assert_eq!(
        (first.len(), &first[0]["kind"], &first[0]["states"]["normal"], &first[0]["states"]["watch"]),
        (1, &"baseline".into(), &11.into(), &1.into())
    );
    // A run with `--until` is complete: the logs that it left out were not selected.
    let result = run(&fleet);
    assert_eq!(result.code, Some(0), "{result:?}");
    let messages = files(&fleet, "alerts");
    assert_eq!(serials(&messages), IN_PLAN);
    let message = messages.iter().find(|message| message["serial_number"] == "1040-0013").unwrap();
    assert_eq!((&message["from"], &message["to"]), (&"watch".into(), &"plan".into()));
    assert_eq!((&message["tail_number"], &message["work_request"]), (&"N414FP".into(), &"W2".into()));
    let text = message["text"].as_str().unwrap();
    let start = "EMA-27-1040 / 1040-0013 on N414FP aileron_left: watch → plan, due ";
    assert!(text.starts_with(start) && text.contains(" of 150.0 µm, +"), "{text}");
    assert_eq!((&summary(&result)["changes"], &summary(&result)["sent"]), (&2.into(), &2.into()));
    for _ in 0..2 {
        assert_eq!(summary(&run(&fleet))["sent"], 0);
    }
    assert_eq!(summary(&fleet.freeplay(&["run", "--redo", "--json"]))["changes"], 0, "the same states again");
    assert_eq!(files(&fleet, "alerts").len(), 3);
}

#[test]
fn changes_wait_while_logs_are_left_for_later() {
    let fleet = fleet_of_september();
    let part = fleet.freeplay(&["run", "--limit", "5", "--json"]);
    assert_eq!((&summary(&part)["is_held"], &summary(&part)["changes"]), (&true.into(), &0.into()));
    let text = fleet.run_ok(&["run", "--limit", "1"]);
    assert!(text.contains("alerts: changes wait for a run that processes every log"), "{text}");
    assert_eq!(files(&fleet, "alerts").len(), 1);
    run(&fleet);
    assert_eq!(serials(&files(&fleet, "alerts")), IN_PLAN);
}

/// The command kills the run that started it: at once, or when it has the message.
#[test]
#[cfg(unix)]
fn a_run_killed_while_it_sends_leaves_a_mark_and_sends_nothing_twice() {
    for (script, received) in [("kill -9 $PPID", 0), ("cat >> got; kill -9 $PPID", 1)] {
        let fleet = fleet("[alerts.hook]\ncommand = [\"sh\", \"-c\", \"cat > baseline\"]\n");
        fleet.configure("cat > baseline", script);
        let killed = run(&fleet);
        assert_eq!(killed.code, None, "{killed:?}");
        // The run was complete before it sent messages.
        let info = fleet.json(&["store", "info"]);
        assert_eq!((&info["last_run"]["ended"], &info["last_run"]["exit_code"]), (&"well".into(), &0.into()));
        let statuses = |fleet: &TestFleet| -> Vec<String> {
            let rows = alerts(fleet);
            let rows = rows.iter().filter(|row| row["channel"] == "hook" && row["kind"] == "change");
            rows.map(|row| row["status"].as_str().unwrap().to_owned()).collect()
        };
        let mut found = statuses(&fleet);
        found.sort();
        assert_eq!(found, ["pending", "sending"]);
        fleet.configure(script, "cat >> got");
        let next = run(&fleet);
        assert_eq!(next.code, Some(5), "{next:?}");
        assert!(next.err.contains("error[alert_unconfirmed]"), "{}", next.err);
        assert_eq!((&summary(&next)["sent"], &summary(&next)["unconfirmed"]), (&1.into(), &1.into()));
        assert_eq!(got(&fleet).len(), received + 1);
        let after = run(&fleet);
        assert_eq!((after.code, &summary(&after)["unconfirmed_before"]), (Some(0), &1.into()));
        // A person finds that the message is missing, and has it sent again.
        let rows = alerts(&fleet);
        let id =
            rows.iter().find(|row| row["status"] == "unconfirmed").unwrap()["alert_id"].as_str().unwrap();
        fleet.run_ok(&["store", "alerts", "--resend", id]);
        assert_eq!(summary(&run(&fleet))["sent"], 1);
        let got = got(&fleet);
        assert_eq!(got.len(), received + 2);
        assert_eq!(got.iter().filter(|message| message["id"] == id).count(), received + 1);
        assert_eq!(fleet.freeplay(&["store", "alerts", "--resend", "none"]).code, Some(2));
    }
}

#[test]
#[cfg(unix)]
fn a_failing_command_a_timeout_and_a_bad_folder_lose_no_result() {
    let fleet = fleet(
        "[alerts.fails]\ncommand = [\"sh\", \"-c\", \"echo no route >&2; exit 75\"]\n\
         [alerts.hangs]\ncommand = [\"sleep\", \"600\"]\ntimeout_s = 0.3\n\
         [alerts.folder]\nfolder = \"pipeline.toml/alerts\"\n\
         [alerts.missing]\ncommand = [\"/no/such/program\"]\n",
    );
    let begun = std::time::Instant::now();
    let result = fleet.freeplay(&["run"]);
    assert!(begun.elapsed().as_secs() < 120);
    assert_eq!(result.code, Some(5), "{result:?}");
    for part in [
        "`fails`: 3 not sent: the command ended with code 75: no route",
        "`folder`: 3 not sent",
        "`missing`: 3",
    ] {
        assert!(result.err.contains(part), "{part}: {}", result.err);
    }
    assert!(
        result.err.contains("`hangs`: 2 perhaps not received: `sleep` did not end within 0.3 s"),
        "{}",
        result.err
    );
    assert!(result.out.contains("12 units: 2 plan, 10 normal;"), "{}", result.out);
    assert_eq!(fleet.exported().lines().count(), 121, "all records are stored");
    // For the exit code, a state of `--fail-on` comes before a failed alert.
    assert_eq!(fleet.freeplay(&["run", "--fail-on", "plan", "--quiet"]).code, Some(4));
    fleet.configure("echo no route >&2; exit 75", "cat >> got");
    run(&fleet);
    assert_eq!(serials(&got(&fleet)), IN_PLAN);
}

/// A channel that was renamed with messages in it: they go through another one, or are taken back.
#[test]
fn messages_of_a_channel_that_is_gone_can_be_sent_through_another_or_dropped() {
    let fleet = fleet("[alerts.old]\ncommand = [\"false\"]\n");
    assert_eq!(run(&fleet).code, Some(5));
    fleet.configure("[alerts.old]\ncommand = [\"false\"]", "[alerts.files]\nfolder = \"alerts\"");
    let result = fleet.freeplay(&["run"]);
    assert!(result.out.contains("`freeplay store alerts --drop old`"), "{result:?}");
    let drop = ["store", "alerts", "--drop", "old"];
    assert_eq!(fleet.freeplay(&[&drop[..], &["--to", "none"]].concat()).code, Some(2));
    fleet.run_ok(&[&drop[..], &["--to", "files"]].concat());
    assert_eq!(run(&fleet).code, Some(0));
    assert_eq!(serials(&files(&fleet, "alerts")), IN_PLAN);
    assert!(fleet.run_ok(&["store", "alerts", "--unsent"]).contains("no alert"));
    assert_eq!(fleet.freeplay(&drop).code, Some(2), "none is left");
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
    let fleet = fleet(&format!("[alerts.chat]\nurl = \"{url}\"\ntails = [\"N41[34]FP\"]\n"));
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
