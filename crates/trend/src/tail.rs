//! The flights after a checkpoint: what they say as long as they go on as was foretold.
//!
//! Where they do not, nothing is said of them apart from the rest: the whole history is to be judged anew.

use crate::advance::{Place, advance};
use crate::bins::{self, BINS};
use crate::checkpoint::Checkpoint;
use crate::clean::Estimate;
use crate::grounded::{check, last};
use crate::jump::shows_step;
use crate::mixture::Mixture;
use crate::posterior::Posterior;
use crate::prior::FleetPrior;
use crate::series::Flight;

/// A tail longer than this share of its segment's estimates is no small thing to add.
const SHARE: usize = 8;

/// Estimates after which a step's size, and what kind of a step it is, is settled.
const SETTLED: usize = 30;

/// What a tail's flights measured.
#[derive(Debug, Clone, Default)]
pub(crate) struct Tail {
    /// By usage, their offsets undone.
    estimates: Vec<Estimate>,
    pub(crate) outliers_us: Vec<i64>,
}

impl Tail {
    /// Estimates that take part.
    pub(crate) fn len(&self) -> usize {
        self.estimates.len()
    }

    /// Reads the flights after a checkpoint; nothing where they may change how those before are read: a step
    /// shows or is not settled, or an outlier turns out to be none.
    pub(crate) fn read(checkpoint: &Checkpoint, flights: &[Flight], prior: &FleetPrior) -> Option<Self> {
        let (mut estimates, outliers) = checkpoint.scatter.clean(flights)?;
        if SHARE * estimates.len() > checkpoint.in_segment || checkpoint.near.len() < SETTLED {
            return None;
        }
        for estimate in &mut estimates {
            estimate.gap_m -= checkpoint.undone_m;
        }
        if is_broken(checkpoint, &estimates) {
            return None;
        }
        for estimate in &mut estimates {
            estimate.usage = prior.usage(&flights[estimate.flight]);
        }
        let outliers_us = outliers.into_iter().map(|flight| flights[flight].departure_us).collect();
        Some(Self { estimates, outliers_us })
    }

    /// Moves a checkpoint's mixture on to the last flight; nothing where the tail does not fit it.
    pub(crate) fn follow(
        &self,
        checkpoint: &Checkpoint,
        mixture: &Mixture,
        flights: &[Flight],
        prior: &FleetPrior,
    ) -> Option<Posterior> {
        let (begin, now) = (prior.usage(checkpoint.last.as_ref()?), prior.usage(flights.last()?));
        let place = Place { usage: begin, installation: checkpoint.recent.last()?.installation };
        // Bins of about as many estimates as those of the segment.
        let of_bin = checkpoint.in_segment.div_ceil(BINS).max(1);
        let bins = bins::bin(&self.estimates, self.estimates.len().div_ceil(of_bin));
        let judged = advance(mixture.posterior(prior), place, &bins, now, prior)?;
        let recent = [&checkpoint.recent[..], &self.estimates[..]].concat();
        check(last(&recent), now, &judged, prior, checkpoint.offset_m2).holds().then_some(judged)
    }
}

/// Whether a step shows, that the flights until the checkpoint did not show.
fn is_broken(checkpoint: &Checkpoint, tail: &[Estimate]) -> bool {
    let Some(first) = tail.first() else { return false };
    let near = checkpoint.near.iter().map(|near| Estimate {
        usage: f64::from(near.hours),
        gap_m: f64::from(near.gap_m),
        weight: f64::from(near.weight),
        ..*first
    });
    let estimates: Vec<Estimate> = near.chain(tail.iter().copied()).collect();
    shows_step(&estimates, checkpoint.near.len())
}
