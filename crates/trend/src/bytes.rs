//! The bytes of a kept state: a form's number, what postcard makes of the state, and a digest of both.

use serde::{Deserialize, Serialize};

use crate::checkpoint::{self, Checkpoint, Judged};
use crate::digest::digest;
use crate::kept::Kept;
use crate::prior::FleetPrior;
use crate::series::{Flight, Meter};

/// The number of the form. A change of what is kept, or of how statements are made of it, asks for the
/// next one: a state of another form is made anew.
const FORM: u8 = 3;

/// Bytes of the digest.
const DIGEST: usize = 8;

/// What is kept, in the order of its bytes.
type Parts = (Checkpoint, Vec<Flight>, Option<Meter>, Option<f64>, u64);

impl Kept {
    /// The state as bytes, of one form on every machine: some 10 kB for a unit of 10,000 flights.
    pub fn to_bytes(&self) -> Vec<u8> {
        // Only a sequence of unknown length or a failing writer can fail, and there is neither.
        let Self { checkpoint, tail, meter, unit_hours_at_start, prior } = self;
        let parts = (checkpoint, tail, meter, unit_hours_at_start, prior);
        let mut bytes = postcard::to_extend(&parts, vec![FORM]).unwrap_or_default();
        bytes.extend(digest_of(&bytes).to_le_bytes());
        bytes
    }

    /// The state of such bytes; nothing where they are damaged, of another form, or made with another prior.
    pub fn from_bytes(bytes: &[u8], prior: &FleetPrior) -> Option<Self> {
        let (bytes, digest) = bytes.split_last_chunk::<DIGEST>()?;
        let (form, state) = bytes.split_first()?;
        if *form != FORM || u64::from_le_bytes(*digest) != digest_of(bytes) {
            return None;
        }
        let (checkpoint, tail, meter, unit_hours_at_start, judged_by): Parts =
            postcard::from_bytes(state).ok()?;
        let kept = Self { checkpoint, tail, meter, unit_hours_at_start, prior: judged_by };
        (judged_by == prior.digest() && kept.is_whole()).then_some(kept)
    }

    /// Whether its parts belong together.
    fn is_whole(&self) -> bool {
        let count = self.checkpoint.flights.checked_add(self.tail.len());
        let fits = |count| self.tail.is_empty() || checkpoint::before(count) == self.checkpoint.flights;
        let is_known = match &self.checkpoint.judged {
            Judged::By(mixture) => mixture.points.iter().all(|point| point.law.is_known()),
            _ => true,
        };
        count.is_some_and(fits) && is_known
    }
}

fn digest_of(bytes: &[u8]) -> u64 {
    let (words, rest) = bytes.as_chunks::<8>();
    let last = rest.iter().fold(rest.len() as u64, |word, byte| word << 8 | u64::from(*byte));
    digest(words.iter().map(|word| u64::from_le_bytes(*word)).chain([last]))
}

/// Departures in order, each as its distance from the one before.
pub(crate) mod distances {
    use super::{Deserialize, Serialize};

    pub(crate) fn serialize<S: serde::Serializer>(departures: &[i64], to: S) -> Result<S::Ok, S::Error> {
        let before = std::iter::once(&0).chain(departures);
        let distances: Vec<i64> =
            departures.iter().zip(before).map(|(us, before)| us.wrapping_sub(*before)).collect();
        distances.serialize(to)
    }

    pub(crate) fn deserialize<'de, D: serde::Deserializer<'de>>(from: D) -> Result<Vec<i64>, D::Error> {
        let add = |us: &mut i64, distance: i64| {
            *us = us.wrapping_add(distance);
            Some(*us)
        };
        Ok(Vec::<i64>::deserialize(from)?.into_iter().scan(0, add).collect())
    }
}
