//! Runs: incremental, interrupted, killed, on failing disks and on stores of older versions.

#[cfg(target_os = "linux")]
mod disk_faults;
mod incremental_runs;
#[cfg(target_os = "linux")]
mod injected_faults;
mod interruption;
mod killed_run_recovery;
mod large_inputs;
mod mapping_faults;
mod old_store_formats;
#[cfg(target_os = "linux")]
mod quiet_failures;
#[cfg(target_os = "linux")]
mod soak;
