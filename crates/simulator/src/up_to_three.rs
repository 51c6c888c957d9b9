//! A list of at most three tables of a spec, stored in place so that what holds it can be copied.

use serde::{Deserialize, Serialize};

/// The most entries of a list.
const MOST: usize = 3;

/// At most three entries; an unused one is the default and has no amplitude.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Vec<T>", into = "Vec<T>", bound(serialize = "T: Default + Copy + PartialEq + Serialize"))]
#[serde(bound(deserialize = "T: Default + Copy + Deserialize<'de>"))]
pub struct UpToThree<T>(pub(crate) [T; MOST]);

impl<T: Default + Copy> TryFrom<Vec<T>> for UpToThree<T> {
    type Error = String;

    fn try_from(given: Vec<T>) -> Result<Self, String> {
        if given.len() > MOST {
            return Err(format!("{} entries are given; at most {MOST} are possible", given.len()));
        }
        let mut all = [T::default(); MOST];
        all[..given.len()].copy_from_slice(&given);
        Ok(Self(all))
    }
}

impl<T: Default + PartialEq> From<UpToThree<T>> for Vec<T> {
    fn from(list: UpToThree<T>) -> Self {
        list.0.into_iter().filter(|entry| *entry != T::default()).collect()
    }
}

impl<T> From<[T; MOST]> for UpToThree<T> {
    fn from(entries: [T; MOST]) -> Self {
        Self(entries)
    }
}
