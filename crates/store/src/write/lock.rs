//! The lock: one process writes at a time. It belongs to the process and dies with it.

use std::fs::{File, OpenOptions, TryLockError};
use std::io::{Read, Seek, Write};
use std::path::Path;
use std::time::{Duration, Instant};

use jiff::Timestamp;
use serde::{Deserialize, Serialize};

use crate::error::Error;

const LOOK_AGAIN: Duration = Duration::from_millis(100);

#[derive(Serialize, Deserialize)]
struct Holder {
    pid: u32,
    host: String,
    started_utc: Timestamp,
}

#[derive(Debug)]
pub(crate) struct Lock {
    _file: File,
}

impl Lock {
    pub(crate) fn take(path: &Path, wait: Option<Duration>) -> Result<Self, Error> {
        // `is_held` takes the lock for an instant: this must not fail another run.
        let deadline = Instant::now() + wait.unwrap_or_default().max(LOOK_AGAIN);
        let mut options = OpenOptions::new();
        options.read(true).write(true).create(true).truncate(false);
        // A link would lend its target's content to the holder's name.
        #[cfg(unix)]
        std::os::unix::fs::OpenOptionsExt::custom_flags(
            &mut options,
            rustix::fs::OFlags::NOFOLLOW.bits().cast_signed(),
        );
        let mut file = options.open(path).map_err(Error::io(path, "opened"))?;
        loop {
            match file.try_lock() {
                Ok(()) => break,
                Err(TryLockError::Error(e)) => return Err(Error::io(path, "locked")(e)),
                Err(TryLockError::WouldBlock) if Instant::now() < deadline => std::thread::sleep(LOOK_AGAIN),
                Err(TryLockError::WouldBlock) => return Err(Error::Held { holder: named(&mut file) }),
            }
        }
        name(&mut file).map_err(Error::io(path, "written"))?;
        Ok(Self { _file: file })
    }

    pub(crate) fn is_held(path: &Path) -> Result<bool, Error> {
        let file = match File::open(path) {
            Ok(file) => file,
            Err(e) if e.kind() == std::io::ErrorKind::NotFound => return Ok(false),
            Err(e) => return Err(Error::io(path, "opened")(e)),
        };
        match file.try_lock_shared() {
            Ok(()) => Ok(false),
            Err(TryLockError::WouldBlock) => Ok(true),
            Err(TryLockError::Error(e)) => Err(Error::io(path, "locked")(e)),
        }
    }
}

/// Writes who holds the lock, for other processes. Machines may share a folder.
fn name(file: &mut File) -> std::io::Result<()> {
    let name = std::fs::read_to_string("/proc/sys/kernel/hostname").ok();
    let name = name.or_else(|| std::env::var("COMPUTERNAME").ok()).or_else(|| std::env::var("HOSTNAME").ok());
    let host = name.map_or_else(|| "this machine".to_owned(), |name| name.trim().to_owned());
    let holder = Holder { pid: std::process::id(), host, started_utc: Timestamp::now() };
    file.set_len(0)?;
    file.rewind()?;
    file.write_all(serde_json::to_string(&holder)?.as_bytes())
}

/// What the holder wrote about itself; it may be writing just now.
fn named(file: &mut File) -> String {
    let mut text = String::new();
    let read = file.rewind().and_then(|()| file.read_to_string(&mut text));
    let Some(holder) = read.ok().and_then(|_| serde_json::from_str::<Holder>(&text).ok()) else {
        return "held by another process".to_owned();
    };
    let since = holder.started_utc.strftime("%Y-%m-%d %H:%M:%S UTC");
    format!("held by pid {} on {} since {since}", holder.pid, holder.host)
}
