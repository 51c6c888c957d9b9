//! The filter over whole flights: S(t) of every segment.

use crate::error::Error;
use crate::kalman::filter::Filter;
use crate::kalman::nis::{Nis, NisBlocks};
use crate::kalman::stream::Stream;
use crate::samples::Samples;

/// S(t) of one actuator's flight, and how well the model explained it.
#[derive(Debug, Clone, PartialEq)]
pub struct FilterOutput {
    /// S at each sample, m; NaN outside the segments.
    pub s_m: Vec<f64>,
    /// Mean normalised innovation squared, its standard error, and the measured samples.
    pub nis: Nis,
}

/// Innovations of a batch, one value per sample.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct InnovationBuffers {
    /// e, m; NaN where nothing was measured.
    pub innovation_m: Vec<f64>,
    /// Its variance, m².
    pub variance_m2: Vec<f64>,
}

/// Settled gain and bandwidth of one filter: they depend on no measurement, so one schedule serves every series of these
/// parameters, this step and this noise.
#[derive(Debug, Clone)]
pub struct GainSchedule {
    /// At the start of a segment.
    start: Stream,
    bandwidth_hz: Result<f64, Error>,
}

impl GainSchedule {
    /// Iterates the covariance (25, 26, 28) from P₀ until the steady state.
    pub fn new(filter: &Filter) -> Self {
        Self { start: Stream::steady_state(filter), bandwidth_hz: filter.bandwidth_hz() }
    }

    /// The filter it was made for.
    pub fn filter(&self) -> &Filter {
        self.start.filter()
    }

    /// As [`Filter::bandwidth_hz`], stored.
    ///
    /// # Errors
    /// As [`Filter::steady_state_gain`].
    pub fn bandwidth_hz(&self) -> Result<f64, Error> {
        self.bandwidth_hz.clone()
    }

    /// Filters all segments (24–28), each from its own initial state, and returns S at each sample, m.
    ///
    /// Channels have one value per sample: δX in m and load in N. A missing load (NaN) is replaced by the one before.
    ///
    /// # Errors
    /// [`Error::Lengths`] for channels that do not fit, [`Error::NothingMeasured`] when no segment
    /// holds a measurement.
    pub fn track(
        &self,
        samples: &Samples<'_>,
        innovations: Option<&mut InnovationBuffers>,
    ) -> Result<FilterOutput, Error> {
        let mut s_m = Vec::new();
        let nis = self.filter_with(samples, innovations, &mut s_m)?;
        Ok(FilterOutput { s_m, nis })
    }

    /// As [`GainSchedule::track`], with S, m, at each sample in memory that many series share.
    ///
    /// # Errors
    /// As [`GainSchedule::track`].
    pub fn filter_with(
        &self,
        samples: &Samples<'_>,
        mut innovations: Option<&mut InnovationBuffers>,
        s_m: &mut Vec<f64>,
    ) -> Result<Nis, Error> {
        samples.check()?;
        let count = samples.dx_m.len();
        s_m.clear();
        s_m.resize(count, f64::NAN);
        if let Some(out) = innovations.as_deref_mut() {
            out.innovation_m = vec![f64::NAN; count];
            out.variance_m2 = vec![f64::NAN; count];
        }
        let mut nis = NisBlocks::new(count);
        for segment in samples.segments {
            let (y_m, load_n) = (&samples.dx_m[segment.clone()], &samples.load_n[segment.clone()]);
            let Some(first) = y_m.iter().position(|y| !y.is_nan()) else { continue };
            let held_n = load_n[..=first].iter().rfind(|u| !u.is_nan()).copied().unwrap_or(0.0);
            let mut stream = self.start;
            stream.start(y_m[first], held_n);
            let mut at = segment.start;
            stream.push_all(y_m.iter().zip(load_n), |step| {
                s_m[at] = step.s_m();
                nis.add_sample(step.innovation_m, step.innovation_variance_m2);
                if let Some(out) = innovations.as_deref_mut() {
                    out.innovation_m[at] = step.innovation_m;
                    out.variance_m2[at] = step.innovation_variance_m2;
                }
                at += 1;
            })?;
        }
        nis.finish()
    }
}

impl Filter {
    /// [`GainSchedule::track`] (24–28) for a single flight.
    ///
    /// # Errors
    /// As there.
    pub fn track(
        &self,
        samples: &Samples<'_>,
        innovations: Option<&mut InnovationBuffers>,
    ) -> Result<FilterOutput, Error> {
        GainSchedule::new(self).track(samples, innovations)
    }
}
