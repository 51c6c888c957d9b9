//! Serde module: departures in ascending order, stored as differences.

use serde::{Deserialize, Deserializer, Serialize, Serializer};

pub(crate) fn serialize<S: Serializer>(departures: &[i64], to: S) -> Result<S::Ok, S::Error> {
    let before = std::iter::once(&0).chain(departures);
    let deltas: Vec<i64> =
        departures.iter().zip(before).map(|(us, before)| us.wrapping_sub(*before)).collect();
    deltas.serialize(to)
}

pub(crate) fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<Vec<i64>, D::Error> {
    let add = |us: &mut i64, delta: i64| {
        *us = us.wrapping_add(delta);
        Some(*us)
    };
    Ok(Vec::<i64>::deserialize(from)?.into_iter().scan(0, add).collect())
}
