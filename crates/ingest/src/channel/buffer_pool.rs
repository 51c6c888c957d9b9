//! Memory of channels that are no longer needed, for those read next.
//!
//! A fresh column costs a fault for every page of memory it touches, about as much as decoding half of it; so each
//! thread keeps the columns of one actuator.

use std::cell::RefCell;

/// Columns that a thread keeps: an actuator has three.
const MAX_BUFFERS: usize = 3;
/// Longer ones are given back: a flight of two hours at 250 Hz is shorter.
const MAX_VALUES: usize = 2 << 20;

thread_local! {
    static POOL: RefCell<Vec<Vec<f64>>> = const { RefCell::new(Vec::new()) };
}

/// An empty column with capacity for this number of values.
pub(crate) fn acquire(values: usize) -> Vec<f64> {
    let fits = |column: &Vec<f64>| column.capacity() >= values;
    let kept = POOL.with_borrow_mut(|pool| pool.iter().position(fits).map(|at| pool.swap_remove(at)));
    kept.unwrap_or_else(|| Vec::with_capacity(values))
}

pub(crate) fn release(mut column: Vec<f64>) {
    if !(1..=MAX_VALUES).contains(&column.capacity()) {
        return;
    }
    column.clear();
    POOL.with_borrow_mut(|pool| {
        if pool.len() == MAX_BUFFERS {
            pool.remove(0);
        }
        pool.push(column);
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_column_given_back_is_the_next_one_that_fits() {
        let mut column = acquire(100);
        column.push(1.0);
        let address = column.as_ptr();
        release(column);
        assert!(acquire(1000).capacity() >= 1000);
        let again = acquire(50);
        assert_eq!((again.as_ptr(), again.len()), (address, 0));
        // Few are kept, and none beyond the usual length.
        release(Vec::with_capacity(MAX_VALUES + 1));
        (0..2 * MAX_BUFFERS).for_each(|_| release(Vec::with_capacity(10)));
        POOL.with_borrow(|pool| assert!(pool.iter().all(|column| column.capacity() == 10)));
        POOL.with_borrow(|pool| assert_eq!(pool.len(), MAX_BUFFERS));
    }
}
