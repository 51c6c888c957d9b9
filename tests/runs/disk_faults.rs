//! Disks that are full, and disks whose power is cut.
//!
//! Both need file systems of their own, which only root may mount: without that right, the tests report that
//! they were skipped, and why. A copy of a mounted disk image is what a power cut at that moment leaves: what
//! was not synced is still in the kernel's memory and not in the image, and mounting the copy replays its
//! journal.

use crate::gate::is_gate;
use crate::harness::{TestFleet, each, print_line, spread, wait_until};
use crate::runs::injected_faults::{few, few_records, seed};
use crate::runs::interruption::{small, stored_records, whole_flights};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// Power cuts with syncing as it is, by the tests and by the gate, and the most without it: the first of those should be
/// caught.
const CUTS: [usize; 2] = [3, 8];
const CONTROL_CUTS: usize = 4;

/// A mounted file system, gone when it is dropped.
struct Mounted(PathBuf);

impl Mounted {
    /// Mounts the file system, or returns why it cannot be mounted here.
    fn new(args: &[&str], at: &Path) -> Result<Self, String> {
        std::fs::create_dir_all(at).unwrap();
        done(Command::new("mount").args(args).arg(at))?;
        Ok(Self(at.to_owned()))
    }
}

impl Drop for Mounted {
    fn drop(&mut self) {
        // Detached at the latest when its last file is closed.
        let _ = done(Command::new("umount").arg("--lazy").arg(&self.0));
    }
}

fn done(command: &mut Command) -> Result<(), String> {
    let result = command.stdin(Stdio::null()).output().map_err(|e| format!("{command:?}: {e}"))?;
    let errors = String::from_utf8_lossy(&result.stderr);
    if result.status.success() { Ok(()) } else { Err(format!("{command:?}: {}", errors.trim())) }
}

/// What a machine can do, or a line that says why the test is skipped.
fn if_possible<T>(result: Result<T, String>) -> Option<T> {
    result.inspect_err(|why| print_line(&format!("skipped: not possible here: {why}"))).ok()
}

/// A disk that is full at some byte: the run reports it with code 3, earlier results stay whole, and with
/// free space again the next run finishes.
#[test]
fn a_full_disk_leaves_the_store_whole_and_the_next_run_finishes() {
    let mut full = 0;
    let sizes = spread(&[16, 64, 96, 128, 192, 256, 384, 512, 1024, 4096], 3);
    for &kib in &sizes {
        let fleet = few();
        let disk = fleet.path("results");
        let size = format!("size={kib}k");
        let mounted = Mounted::new(&["-t", "tmpfs", "-o", &size, "tmpfs"], &disk);
        let Some(_mounted) = if_possible(mounted) else { return };
        let result = fleet.freeplay(&["run", "--jobs", "1"]);
        // A disk that is full after the results were stored leaves work requests and alerts to the next run.
        let named = match result.code {
            Some(0) => "",
            Some(3) => "error[store_",
            Some(5) => "error[follow_up_failed]",
            _ => panic!("{kib} KiB: {result:?}"),
        };
        full += usize::from(result.code != Some(0));
        assert!(result.err.contains(named), "{kib} KiB: {}", result.err);
        whole_flights(&fleet);
        done(Command::new("mount").args(["-o", "remount,size=16m"]).arg(&disk)).unwrap();
        fleet.run_ok(&["run"]);
        assert_eq!(fleet.exported(), few_records(), "{kib} KiB");
    }
    print_line(&format!("the disk was full in {full} of {} runs", sizes.len()));
    assert!((1..sizes.len()).contains(&full), "{full} runs met a full disk");
}

/// A disk in a file. Its journal is written only by processes that sync.
struct Disk<'b> {
    fleet: &'b TestFleet,
    image: PathBuf,
    mounted: Option<Mounted>,
}

impl<'b> Disk<'b> {
    fn new(fleet: &'b TestFleet) -> Result<Self, String> {
        let image = fleet.path("live.img");
        std::fs::File::create(&image).and_then(|file| file.set_len(24 << 20)).unwrap();
        done(Command::new("mkfs.ext4").arg("-q").arg(&image))?;
        let mut disk = Self { fleet, image, mounted: None };
        disk.mount()?;
        Ok(disk)
    }

    fn mount(&mut self) -> Result<(), String> {
        let image = self.image.to_str().unwrap();
        self.mounted = Some(Mounted::new(&["-o", "loop,commit=300", image], &self.fleet.path("disk"))?);
        Ok(())
    }

    /// Takes what is on the disk at this moment.
    fn copy(&self) -> PathBuf {
        let copy = self.fleet.path("cut.img");
        std::fs::copy(&self.image, &copy).unwrap();
        copy
    }

    /// Puts a copy in the place of the disk, as a machine does that starts again.
    fn start_again(&mut self, copy: PathBuf) -> Result<(), String> {
        self.mounted = None;
        self.image = copy;
        self.mount()
    }
}

/// One power cut: some runs that finish, then a cut at a random instant of another run, or right after the last one.
/// Returns how many records the store holds afterwards, or what is wrong with them.
fn cut(
    disk: &mut Disk<'_>,
    chance: &mut fastrand::Rng,
    preload: Option<&Path>,
    mid: bool,
) -> Result<usize, String> {
    let run = || {
        let mut command = disk.fleet.command(&["run", "--jobs", "1", "--limit", "3", "-q"]);
        command.stdout(Stdio::null()).stderr(Stdio::null());
        command.envs(preload.map(|library| ("LD_PRELOAD", library)));
        command
    };
    let runs = if mid { (chance.f64() * 3.0) as usize } else { 1 };
    for _ in 0..runs {
        assert!(run().status().unwrap().success());
    }
    let copy = if mid {
        // A run makes some twenty files.
        let files = files_of(disk.fleet) + 1 + (chance.f64() * 20.0) as usize;
        let mut child = run().spawn().unwrap();
        let mut is_over = false;
        wait_until(|| {
            is_over = child.try_wait().unwrap().is_some();
            is_over || files_of(disk.fleet) >= files
        });
        if !is_over {
            done(Command::new("kill").args(["-STOP", &child.id().to_string()])).unwrap();
        }
        let copy = disk.copy();
        child.kill().unwrap();
        child.wait().unwrap();
        copy
    } else {
        disk.copy()
    };
    disk.start_again(copy)?;
    state(disk.fleet, runs * 3 * 4, !mid)
}

fn files_of(fleet: &TestFleet) -> usize {
    fleet.glob("disk/results/**/*").len()
}

/// Number of stored records, if the store is whole and holds at least what finished runs had reported as stored.
/// A run that finished must have recorded its exit code.
fn state(fleet: &TestFleet, promised: usize, ended: bool) -> Result<usize, String> {
    let folder = fleet.path("disk/results");
    let records = stored_records(&folder)?;
    if records < promised {
        return Err(format!("{promised} records were promised, {records} are there"));
    }
    let runs = || store::Store::open(&folder).and_then(|store| store.runs()).map_err(|e| e.to_string());
    if ended && runs()?.last().is_none_or(|run| run.exit_code != Some(0)) {
        return Err("the last run finished, and its run record does not hold it".to_owned());
    }
    Ok(records)
}

fn on_a_disk() -> TestFleet {
    let fleet = small();
    fleet.configure("path = \"results\"", "path = \"disk/results\"");
    fleet
}

#[test]
fn a_power_cut_at_any_instant_loses_nothing_that_was_promised() {
    let plain = small();
    plain.run_ok(&["run"]);
    let wanted = plain.exported();
    let (seed, cuts) = (seed(), CUTS[usize::from(is_gate())]);
    let (mut chance, mut partly) = (fastrand::Rng::with_seed(seed), 0);
    for number in 0..cuts {
        let fleet = on_a_disk();
        let Some(mut disk) = if_possible(Disk::new(&fleet)) else { return };
        let kept = cut(&mut disk, &mut chance, None, number % 4 != 0);
        let kept = kept.unwrap_or_else(|wrong| panic!("cut {number}, seed {seed}: {wrong}"));
        partly += usize::from((1..40).contains(&kept));
        fleet.run_ok(&["run"]);
        assert_eq!(fleet.exported(), wanted, "cut {number}, seed {seed}");
    }
    print_line(&format!("{cuts} power cuts, seed {seed}: {partly} left a store part full, none a wrong one"));
    assert!(partly > 0, "no cut came between two commits");
}

/// The control: where syncing of anything or of folders is a lie, a cut must be seen to lose what was promised.
#[test]
fn without_syncing_a_power_cut_is_caught() {
    each(&[("anything", &[][..]), ("folders", &["-DFOLDERS"])], |(what, flags)| is_caught(what, flags));
}

fn is_caught(what: &str, flags: &[&str]) {
    let library = tempfile::tempdir().unwrap();
    let (source, lie) =
        (crate::harness::top().join("tests/data/disk/nosync.c"), library.path().join("lie.so"));
    let mut compile = Command::new("cc");
    compile.args(["-shared", "-fPIC", "-o"]).arg(&lie).arg(source).args(flags);
    if if_possible(done(&mut compile)).is_none() {
        return;
    }
    let mut chance = fastrand::Rng::with_seed(1);
    for number in 1..=CONTROL_CUTS {
        let fleet = on_a_disk();
        let Some(mut disk) = if_possible(Disk::new(&fleet)) else { return };
        if let Err(wrong) = cut(&mut disk, &mut chance, Some(&lie), false) {
            return print_line(&format!("without syncing {what}, cut {number} was caught: {wrong}"));
        }
    }
    panic!("{CONTROL_CUTS} cuts without syncing {what} lost nothing: the harness cannot see a loss");
}
