//! Memory of channels that are no longer needed, for those read next.
//!
//! A fresh column costs a fault for every page of memory it touches, about as much as decoding half of it; so each
//! thread keeps the columns of one actuator.

use std::cell::RefCell;

/// Columns that a thread keeps: an actuator has three.
const KEPT: usize = 3;
/// Longer ones are given back: a flight of two hours at 250 Hz is shorter.
const LONGEST: usize = 2 << 20;

thread_local! {
    static SPARE: RefCell<Vec<Vec<f64>>> = const { RefCell::new(Vec::new()) };
}

/// An empty column with room for so many values.
pub(crate) fn take(values: usize) -> Vec<f64> {
    let kept = SPARE.with_borrow_mut(|spare| {
        let fits = spare.iter().position(|column| column.capacity() >= values);
        fits.map(|at| spare.swap_remove(at))
    });
    kept.unwrap_or_else(|| Vec::with_capacity(values))
}

/// Takes a column back.
pub(crate) fn give(mut column: Vec<f64>) {
    if column.capacity() == 0 || column.capacity() > LONGEST {
        return;
    }
    column.clear();
    SPARE.with_borrow_mut(|spare| {
        if spare.len() == KEPT {
            spare.remove(0);
        }
        spare.push(column);
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_column_given_back_is_the_next_one_that_fits() {
        let mut column = take(100);
        column.push(1.0);
        let address = column.as_ptr();
        give(column);
        let longer = take(1000);
        assert_ne!(longer.as_ptr(), address);
        let again = take(50);
        assert_eq!((again.as_ptr(), again.len()), (address, 0));
    }

    #[test]
    fn columns_beyond_the_usual_are_not_kept() {
        give(Vec::with_capacity(LONGEST + 1));
        assert!(take(LONGEST).capacity() <= LONGEST);
        (0..2 * KEPT).for_each(|_| give(Vec::with_capacity(10)));
        SPARE.with_borrow(|spare| assert_eq!(spare.len(), KEPT));
    }
}
