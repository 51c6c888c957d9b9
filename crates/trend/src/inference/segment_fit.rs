//! Fit of a segment: its bins, their common filter, and the regression of a candidate.

use crate::data::bins::{Bin, Segment};
use crate::inference::level_filter::{Filter, Pass, Regression};
use crate::prior::{FleetPrior, LogPrior};

/// A segment's bins filtered once for all candidates, each of which is fitted together with the season.
pub(crate) struct SegmentFit<'a> {
    pub(crate) segment: &'a Segment<'a>,
    pub(crate) prior: &'a FleetPrior,
    pub(crate) logs: LogPrior<'a>,
    pub(crate) bins: Vec<Bin>,
    pub(crate) filter: Filter,
    /// Pass of the gaps minus the fleet's mean season; its two levels are also without the unit's own seasonal deviation.
    pub(crate) gaps: Pass,
    /// Variance of the first level about a new unit's mean gap, and its logarithm.
    pub(crate) new_m2: f64,
    pub(crate) ln_new_m2: f64,
    /// Pass of the season with unit amplitude.
    pub(crate) wave: Pass,
    wave_by_gaps: f64,
    wave_information: f64,
    /// Variance of the unit's seasonal amplitude.
    pub(crate) seasonal_m2: f64,
}

impl<'a> SegmentFit<'a> {
    /// `growth_m` is the expected wear, m, by usage since the begin of the segment: the process variance of the
    /// level is proportional to it.
    pub(crate) fn new(
        segment: &'a Segment<'a>,
        prior: &'a FleetPrior,
        bins: Vec<Bin>,
        growth_m: impl Fn(f64) -> f64,
    ) -> Self {
        let walk_m2 = process_variance(&bins, segment.begin, prior, growth_m);
        let filter = Filter::new(&bins, &walk_m2, prior.limit_m());
        let seasonal: Vec<f64> = bins.iter().map(|b| prior.season.wave(b.departure_us)).collect();
        let wave = filter.pass(seasonal.iter().copied());
        let mut gaps =
            filter.pass(bins.iter().zip(&seasonal).map(|(b, w)| b.gap_m - prior.season.mean_m * w));
        let own = filter.regress(&gaps, &wave, &seasonal);
        let wave_information = own.sff + prior.season.sd_m.powi(-2);
        gaps.end -= own.sfy / wave_information * wave.end;
        gaps.start -= own.sfy / wave_information * wave.start;
        let new_m2 = filter.start_m2 + prior.new_sd_m.powi(2);
        Self {
            segment,
            prior,
            logs: prior.logs(),
            bins,
            filter,
            gaps,
            new_m2,
            ln_new_m2: new_m2.ln(),
            wave,
            wave_by_gaps: own.sfy,
            wave_information,
            seasonal_m2: wave_information.recip(),
        }
    }

    /// A candidate's regression, with the unit's own seasonal amplitude fitted and shrunk to the fleet's.
    pub(crate) fn with_season(&self, mut pass: Regression) -> Regression {
        let share = pass.sfs * self.seasonal_m2;
        pass.sff -= share * pass.sfs;
        pass.sfy -= share * self.wave_by_gaps;
        pass.end -= share * self.wave.end;
        pass.start -= share * self.wave.start;
        pass
    }

    /// Variance of the level now, which is the same for every curve.
    pub(crate) fn level_m2(&self) -> f64 {
        self.filter.end_m2 + self.wave.end * self.wave.end * self.seasonal_m2
    }

    /// Part of the log-likelihood that all curves share; it matters only for comparing usage axes.
    pub(crate) fn shared_log_likelihood(&self) -> f64 {
        let fitted = self.wave_by_gaps * self.wave_by_gaps / self.wave_information;
        -0.5 * (self.gaps.square - fitted + self.filter.log_variance + self.wave_information.ln())
    }
}

/// Process variance of the level before each bin, m²: of wear, of a small drift, and of the bias of the
/// installation where that changes.
pub(crate) fn process_variance(
    bins: &[Bin],
    begin: f64,
    prior: &FleetPrior,
    growth_m: impl Fn(f64) -> f64,
) -> Vec<f64> {
    let mut walk_m2 = vec![0.0; bins.len()];
    let mut before_m = bins.first().map_or(0.0, |bin| growth_m(bin.usage - begin));
    for (step_m2, pair) in walk_m2.iter_mut().skip(1).zip(bins.windows(2)) {
        let grown_m = growth_m(pair[1].usage - begin);
        let moved = f64::from(u8::from(pair[0].installation != pair[1].installation));
        *step_m2 = prior.wear_noise_m * (grown_m - before_m).max(0.0)
            + prior.drift_m2_per_hour * (pair[1].usage - pair[0].usage)
            + 2.0 * moved * prior.bias_sd_m * prior.bias_sd_m;
        before_m = grown_m;
    }
    walk_m2
}

/// Growth over all bins, m, extrapolated from the means of the first and the last quarter.
pub(crate) fn linear_growth(bins: &[Bin]) -> f64 {
    let quarter = bins.len().div_ceil(4);
    let mean = |bins: &[Bin]| bins.iter().map(|b| b.gap_m).sum::<f64>() / bins.len() as f64;
    (4.0 / 3.0 * (mean(&bins[bins.len() - quarter..]) - mean(&bins[..quarter]))).max(0.0)
}
