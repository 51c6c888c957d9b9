//! The flights after a checkpoint, as long as they follow the forecast.
//!
//! Where they do not, the whole history is assessed again.

use crate::data::bins::{self, BINS};
use crate::data::outliers::WeightedGap;
use crate::data::series::Flight;
use crate::data::steps::has_step;
use crate::incremental::checkpoint::Checkpoint;
use crate::inference::consistency::{level_check, recent_estimates};
use crate::inference::mixture::Mixture;
use crate::inference::posterior::Posterior;
use crate::inference::update::{UpdateStart, update};
use crate::prior::fleet_prior::FleetPrior;

/// A tail longer than this share of its segment's estimates is no small thing to add.
const SHARE: usize = 8;

/// Estimates after which a step's size, and what kind of a step it is, is settled.
const SETTLED: usize = 30;

/// What a tail's flights measured.
#[derive(Debug, Clone, Default)]
pub(crate) struct Tail {
    /// By usage, their offsets undone.
    estimates: Vec<WeightedGap>,
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
        let (mut estimates, outliers) = checkpoint.scatter.mark_outliers(flights)?;
        if SHARE * estimates.len() > checkpoint.in_segment || checkpoint.near.len() < SETTLED {
            return None;
        }
        for estimate in &mut estimates {
            estimate.gap_m -= checkpoint.undone_m;
        }
        if is_broken(checkpoint, &estimates, prior.limit_m()) {
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
        let start = UpdateStart { usage: begin, installation: checkpoint.recent.last()?.installation };
        // Bins of about as many estimates as those of the segment.
        let of_bin = checkpoint.in_segment.div_ceil(BINS).max(1);
        let bins = bins::bin(&self.estimates, self.estimates.len().div_ceil(of_bin));
        let fitted = update(mixture.posterior(prior), start, &bins, now, prior)?;
        let recent = [&checkpoint.recent[..], &self.estimates[..]].concat();
        level_check(recent_estimates(&recent), now, &fitted, prior, checkpoint.offset_m2)
            .holds()
            .then_some(fitted)
    }
}

/// Whether a step shows, that the flights until the checkpoint did not show.
fn is_broken(checkpoint: &Checkpoint, tail: &[WeightedGap], limit_m: f64) -> bool {
    let Some(first) = tail.first() else { return false };
    let near = checkpoint.near.iter().map(|near| WeightedGap {
        usage: f64::from(near.hours),
        gap_m: f64::from(near.gap_m),
        weight: f64::from(near.weight),
        ..*first
    });
    let estimates: Vec<WeightedGap> = near.chain(tail.iter().copied()).collect();
    has_step(&estimates, checkpoint.near.len(), limit_m)
}
