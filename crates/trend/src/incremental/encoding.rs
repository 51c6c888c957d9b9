//! The bytes of a kept state: a form's number, what postcard makes of the state, and a digest of both.

use crate::data::series::{Flight, UsageAccumulator};
use crate::incremental::checkpoint::{self, Checkpoint, SegmentPosterior};
use crate::incremental::snapshot::UnitSnapshot;
use crate::math::fnv::fnv1a;
use crate::prior::fleet_prior::FleetPrior;

/// The number of the form. A change of what is kept, or of how statements are made of it, asks for the
/// next one: a state of another form is made anew.
const FORM: u8 = 4;

/// Bytes of the digest.
const DIGEST: usize = 8;

/// What is kept, in the order of its bytes.
type SnapshotWire = (Checkpoint, Vec<Flight>, Option<UsageAccumulator>, Option<f64>, u64);

impl UnitSnapshot {
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
        let (checkpoint, tail, meter, unit_hours_at_start, judged_by): SnapshotWire =
            postcard::from_bytes(state).ok()?;
        let snapshot = Self { checkpoint, tail, meter, unit_hours_at_start, prior: judged_by };
        (judged_by == prior.digest() && snapshot.is_whole()).then_some(snapshot)
    }

    /// Whether its parts belong together.
    fn is_whole(&self) -> bool {
        let count = self.checkpoint.flights.checked_add(self.tail.len());
        let fits = |count| self.tail.is_empty() || checkpoint::before(count) == self.checkpoint.flights;
        let is_known = match &self.checkpoint.fitted {
            SegmentPosterior::By(mixture) => {
                mixture.components.iter().all(|component| component.law.is_valid())
            }
            _ => true,
        };
        count.is_some_and(fits) && is_known
    }
}

fn digest_of(bytes: &[u8]) -> u64 {
    let (words, rest) = bytes.as_chunks::<8>();
    let last = rest.iter().fold(rest.len() as u64, |word, byte| word << 8 | u64::from(*byte));
    fnv1a(words.iter().map(|word| u64::from_le_bytes(*word)).chain([last]))
}
