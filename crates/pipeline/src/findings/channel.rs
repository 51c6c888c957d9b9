//! Channels of alerts: a command, a folder, or an address of HTTP. Each has a time limit.

use std::fs::{self, File};
use std::io::{self, Read, Write};
use std::path::Path;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::mpsc;
use std::time::{Duration, Instant};

use job::Config;
use job::config::AlertChannel;
use object_io::Posted;
use records::AlertRecord;
use records::sanitize::escape_cell;

use crate::findings::delivery::Attempt;

/// Pause between two looks at a command.
const POLL: Duration = Duration::from_millis(10);
/// Bytes of a command's messages that are kept.
const MAX_STDERR: u64 = 2048;
/// Time for the last messages of a command that has ended.
const LAST_WORDS: Duration = Duration::from_millis(200);

pub(super) fn send(config: &Config, channel: &AlertChannel, row: &AlertRecord) -> Attempt {
    let message = row.message.as_deref().unwrap_or_default();
    match (&channel.command, &channel.folder, &channel.url) {
        (Some(words), _, _) => {
            command(words, &config.folder, message, channel.timeout(), &channel.pass_environment)
        }
        (_, Some(folder), _) => match write_file(&config.path(folder), &row.alert_id, message) {
            Ok(()) => Attempt::Sent,
            Err(error) => Attempt::NotSent(format!("the file cannot be written: {error}")),
        },
        (_, _, Some(url)) => match object_io::post_json(url, message, channel.timeout()) {
            Posted::Answered(200..=299) => Attempt::Sent,
            Posted::Answered(status @ 300..=399) => Attempt::NotSent(format!(
                "the receiver answered {status}: it has moved, and redirections are not followed; set `url` to its new address"
            )),
            Posted::Answered(status) => Attempt::NotSent(format!("the receiver answered {status}")),
            Posted::NotSent(why) => Attempt::NotSent(why),
            Posted::Unknown(why) => Attempt::Unknown(why),
        },
        _ => Attempt::NotSent("the channel has no command, folder or url".to_owned()),
    }
}

/// Writes `ID.json`, whole or not at all. A file of that name is the same message, written before.
fn write_file(folder: &Path, id: &str, message: &str) -> io::Result<()> {
    fs::create_dir_all(folder)?;
    let file = folder.join(format!("{id}.json"));
    if file.try_exists()? {
        return Ok(());
    }
    let staged = folder.join(format!(".{id}.{}.part", std::process::id()));
    let written = object_io::create_fresh(&staged).and_then(|mut to| {
        to.write_all(message.as_bytes())?;
        to.write_all(b"\n")?;
        to.sync_all()
    });
    let renamed = written.and_then(|()| fs::rename(&staged, &file));
    if renamed.is_err() {
        // Best effort: the first error is reported.
        let _ = fs::remove_file(&staged);
    }
    renamed?;
    if cfg!(unix) { File::open(folder)?.sync_all() } else { Ok(()) }
}

/// Variables that a command gets: what programs need to find others, files and words. Keys of object stores are not
/// among them.
const ENVIRONMENT: [&str; 14] = [
    "PATH",
    "HOME",
    "USER",
    "LOGNAME",
    "SHELL",
    "LANG",
    "LC_ALL",
    "TZ",
    "TMPDIR",
    "TEMP",
    "TMP",
    "SYSTEMROOT",
    "USERPROFILE",
    "PATHEXT",
];

/// Runs a program with the message on its standard input, and ends it at the time limit.
fn command(words: &[String], folder: &Path, message: &str, timeout: Duration, pass: &[String]) -> Attempt {
    let Some((program, arguments)) = words.split_first() else {
        return Attempt::NotSent("the command is empty".to_owned());
    };
    let mut command = Command::new(program);
    let names = ENVIRONMENT.into_iter().chain(pass.iter().map(String::as_str));
    let kept = names.filter_map(|name| Some((name, std::env::var_os(name)?)));
    command.env_clear().envs(kept);
    command.args(arguments).stdin(Stdio::piped()).stdout(Stdio::null()).stderr(Stdio::piped());
    if !folder.as_os_str().is_empty() {
        command.current_dir(folder);
    }
    #[cfg(unix)]
    std::os::unix::process::CommandExt::process_group(&mut command, 0);
    let mut child = match command.spawn() {
        Ok(child) => child,
        Err(error) => return Attempt::NotSent(format!("`{program}` cannot be started: {error}")),
    };
    feed(&mut child, message);
    let errors = collect_errors(&mut child);
    let ended = wait(&mut child, timeout);
    let words = || errors.recv_timeout(LAST_WORDS).unwrap_or_default();
    match ended {
        Ok(Some(status)) if status.success() => Attempt::Sent,
        Ok(Some(status)) => attempt_of(status, &words()),
        Ok(None) => {
            end(&mut child);
            Attempt::Unknown(format!("`{program}` did not end within {:.1} s", timeout.as_secs_f64()))
        }
        Err(error) => {
            end(&mut child);
            Attempt::Unknown(format!("`{program}` cannot be waited for: {error}"))
        }
    }
}

/// A command that ends with a code has not sent the message; one that was killed may have.
fn attempt_of(status: ExitStatus, errors: &str) -> Attempt {
    let errors = escape_cell(errors.trim().lines().last().unwrap_or_default()).into_owned();
    let errors = if errors.is_empty() { errors } else { format!(": {errors}") };
    match status.code() {
        Some(code) => Attempt::NotSent(format!("the command ended with code {code}{errors}")),
        None => Attempt::Unknown(format!("the command was killed{errors}")),
    }
}

/// Writes the message from a thread of its own: a command that does not read must not block the run.
fn feed(child: &mut Child, message: &str) {
    let Some(mut input) = child.stdin.take() else { return };
    let message = message.to_owned();
    std::thread::spawn(move || {
        // A command may ignore its input; its exit code decides.
        let _ = input.write_all(message.as_bytes()).and_then(|()| input.write_all(b"\n"));
    });
}

/// Reads the messages of a command from a thread of its own: they may be endless.
fn collect_errors(child: &mut Child) -> mpsc::Receiver<String> {
    let (sender, receiver) = mpsc::channel();
    if let Some(errors) = child.stderr.take() {
        std::thread::spawn(move || {
            let mut text = Vec::new();
            let mut first = errors.take(MAX_STDERR);
            let _ = first.read_to_end(&mut text);
            let _ = sender.send(String::from_utf8_lossy(&text).into_owned());
            let _ = io::copy(&mut first.into_inner(), &mut io::sink());
        });
    }
    receiver
}

fn wait(child: &mut Child, timeout: Duration) -> io::Result<Option<ExitStatus>> {
    let deadline = Instant::now() + timeout;
    loop {
        match child.try_wait()? {
            Some(status) => return Ok(Some(status)),
            None if Instant::now() >= deadline => return Ok(None),
            None => std::thread::sleep(POLL),
        }
    }
}

/// Ends a command and the programs that it started.
fn end(child: &mut Child) {
    #[cfg(unix)]
    if let Some(group) = i32::try_from(child.id()).ok().and_then(rustix::process::Pid::from_raw) {
        let _ = rustix::process::kill_process_group(group, rustix::process::Signal::KILL);
    }
    let _ = child.kill();
    let _ = child.wait();
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;

    const LONG: Duration = Duration::from_secs(20);
    /// Quotes, a shell command, a line feed and a reversal of text: all valid in a name.
    const HOSTILE: &str = "{\"serial_number\":\"$(touch X)'; rm -rf \\\"\\n\u{202e}\"}";

    fn shell(script: &str, folder: &Path, timeout: Duration) -> Attempt {
        let words = ["sh", "-c", script].map(str::to_owned);
        command(&words, folder, HOSTILE, timeout, &["CARGO_PKG_NAME".to_owned()])
    }

    /// Cargo sets the variables of tests: keys of object stores are passed on as little as they are.
    #[test]
    fn a_command_gets_the_message_byte_by_byte_and_a_minimal_environment() {
        let dir = tempfile::tempdir().unwrap();
        let got = || fs::read_to_string(dir.path().join("got")).unwrap();
        assert_eq!(shell("cat > got", dir.path(), LONG), Attempt::Sent);
        assert_eq!(got(), format!("{HOSTILE}\n"));
        assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 1, "nothing in a name is executed");
        assert_eq!(shell("env > got", dir.path(), LONG), Attempt::Sent);
        assert!(got().contains("CARGO_PKG_NAME=") && got().contains("PATH="), "{}", got());
        assert!(!got().contains("CARGO_MANIFEST_DIR="), "{}", got());
    }

    #[test]
    fn exit_codes_and_missing_programs_are_not_sent() {
        let dir = tempfile::tempdir().unwrap();
        let failed = shell("echo one >&2; echo 'no \u{1b}[31mroute' >&2; exit 75", dir.path(), LONG);
        let why = "the command ended with code 75: no [U+001B][31mroute";
        assert_eq!(failed, Attempt::NotSent(why.to_owned()));
        let missing = command(&["/no/such/program".to_owned()], dir.path(), "{}", LONG, &[]);
        assert!(matches!(missing, Attempt::NotSent(_)), "{missing:?}");
        assert!(matches!(shell("kill -9 $$", dir.path(), LONG), Attempt::Unknown(_)));
    }

    /// The started `sleep` keeps standard error open for longer than the test runs.
    #[test]
    fn a_command_that_hangs_is_ended_with_the_programs_that_it_started() {
        let dir = tempfile::tempdir().unwrap();
        let begun = Instant::now();
        let hung = shell("sleep 60 & echo $! > pid; wait", dir.path(), Duration::from_millis(300));
        assert!(matches!(hung, Attempt::Unknown(_)), "{hung:?}");
        assert!(begun.elapsed() < Duration::from_secs(10));
        let pid = fs::read_to_string(dir.path().join("pid")).unwrap();
        let state = || fs::read_to_string(format!("/proc/{}/stat", pid.trim())).unwrap_or_default();
        let is_ended = (0..100).any(|_| {
            std::thread::sleep(POLL);
            state().is_empty() || state().contains(") Z ")
        });
        assert!(is_ended || !Path::new("/proc/self").exists(), "{}", state());
    }

    #[test]
    fn a_command_that_reads_nothing_and_writes_without_end_does_not_block() {
        let dir = tempfile::tempdir().unwrap();
        let message = "x".repeat(1 << 20);
        let words = ["sh", "-c", "head -c 5000000 /dev/zero >&2; exit 3"].map(str::to_owned);
        let ended = command(&words, dir.path(), &message, LONG, &[]);
        assert!(matches!(&ended, Attempt::NotSent(why) if why.contains("code 3")), "{ended:?}");
    }

    #[test]
    fn a_file_is_written_once_and_an_unwritable_folder_is_not_sent() {
        let dir = tempfile::tempdir().unwrap();
        let folder = dir.path().join("alerts");
        write_file(&folder, "ID", HOSTILE).unwrap();
        write_file(&folder, "ID", "another").unwrap();
        let names: Vec<_> = fs::read_dir(&folder).unwrap().map(|e| e.unwrap().file_name()).collect();
        assert_eq!(names, ["ID.json"]);
        assert_eq!(fs::read_to_string(folder.join("ID.json")).unwrap(), format!("{HOSTILE}\n"));
        let file = dir.path().join("file");
        fs::write(&file, "").unwrap();
        assert!(write_file(&file, "ID", HOSTILE).is_err());
    }
}
