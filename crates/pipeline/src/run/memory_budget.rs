//! The memory budget: work waits until what it will need fits, and one piece of work is always let in.

use std::sync::{Condvar, Mutex, PoisonError};

/// Bytes of one sample while an actuator is estimated, measured as the peak of a resident set: 1.24 GiB at
/// 36 million samples, rounded up.
pub(crate) const BYTES_PER_SAMPLE: u64 = 40;

#[derive(Debug)]
pub(crate) struct MemoryBudget {
    limit_bytes: u64,
    in_use_bytes: Mutex<u64>,
    freed: Condvar,
}

/// Bytes in use until it is dropped.
#[derive(Debug)]
pub(crate) struct MemoryPermit<'b> {
    budget: &'b MemoryBudget,
    bytes: u64,
}

impl MemoryBudget {
    /// A budget in MiB; without one, nothing waits.
    pub(crate) fn new(limit_mib: Option<u64>) -> Self {
        let limit_bytes = limit_mib.map_or(u64::MAX, |mib| mib.saturating_mul(1 << 20));
        Self { limit_bytes, in_use_bytes: Mutex::new(0), freed: Condvar::new() }
    }

    /// Waits until these bytes fit in addition to those in use, or nothing is in use.
    pub(crate) fn take(&self, bytes: u64) -> MemoryPermit<'_> {
        let too_much = |in_use: &mut u64| *in_use > 0 && in_use.saturating_add(bytes) > self.limit_bytes;
        let in_use = self.in_use_bytes.lock().unwrap_or_else(PoisonError::into_inner);
        let mut in_use = self.freed.wait_while(in_use, too_much).unwrap_or_else(PoisonError::into_inner);
        *in_use = in_use.saturating_add(bytes);
        MemoryPermit { budget: self, bytes }
    }
}

impl Drop for MemoryPermit<'_> {
    fn drop(&mut self) {
        let mut in_use = self.budget.in_use_bytes.lock().unwrap_or_else(PoisonError::into_inner);
        *in_use = in_use.saturating_sub(self.bytes);
        self.budget.freed.notify_all();
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicU64, Ordering};

    use super::*;

    /// Eight workers with work of 1 to 7 MiB: never more than the budget at once, and all of it is done.
    #[test]
    fn what_is_in_use_never_passes_the_budget() {
        let budget = MemoryBudget::new(Some(10));
        let (in_use, most, done) = (AtomicU64::new(0), AtomicU64::new(0), AtomicU64::new(0));
        std::thread::scope(|scope| {
            for worker in 0..8_u64 {
                let (budget, in_use, most, done) = (&budget, &in_use, &most, &done);
                scope.spawn(move || {
                    for step in 0..50 {
                        let bytes = ((worker * 3 + step) % 7 + 1) << 20;
                        let held = budget.take(bytes);
                        most.fetch_max(in_use.fetch_add(bytes, Ordering::SeqCst) + bytes, Ordering::SeqCst);
                        std::thread::yield_now();
                        in_use.fetch_sub(bytes, Ordering::SeqCst);
                        drop(held);
                        done.fetch_add(1, Ordering::SeqCst);
                    }
                });
            }
        });
        assert!(most.load(Ordering::SeqCst) <= 10 << 20);
        assert_eq!(done.load(Ordering::SeqCst), 400);
    }

    #[test]
    fn work_that_never_fits_is_done_alone() {
        let budget = MemoryBudget::new(Some(1));
        let (large, is_over) = (budget.take(5 << 20), AtomicU64::new(0));
        std::thread::scope(|scope| {
            let small = scope.spawn(|| {
                let _held = budget.take(1);
                assert_eq!(is_over.load(Ordering::SeqCst), 1, "admitted in spite of work over the budget");
            });
            std::thread::sleep(std::time::Duration::from_millis(20));
            is_over.store(1, Ordering::SeqCst);
            drop(large);
            small.join().unwrap();
        });
    }

    /// A panic while estimating must not keep its share for ever.
    #[test]
    fn a_panic_releases_its_permit_and_becomes_a_diagnostic() {
        let budget = MemoryBudget::new(Some(1));
        let ended = job::flight_log::catch_panic("a.parquet", || {
            let _held = budget.take(1 << 20);
            let nothing: &[f64] = &[];
            Ok(nothing[std::hint::black_box(3)])
        });
        let diagnostic = ended.unwrap_err();
        assert_eq!((diagnostic.code.as_str(), diagnostic.file.as_deref()), ("panic", Some("a.parquet")));
        assert_eq!(*budget.in_use_bytes.lock().unwrap(), 0);
    }
}
