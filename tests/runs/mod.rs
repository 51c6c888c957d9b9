//! Runs: incremental, interrupted, killed, and on failing disks.

#[cfg(target_os = "linux")]
mod disk_faults;
#[cfg(target_os = "linux")]
mod injected_faults;
mod interruption;
#[cfg(target_os = "linux")]
mod soak;
