//! The filter over whole flights: S(t) of every segment.

use crate::error::Error;
use crate::kalman::filter::Filter;
use crate::kalman::nis::{Nis, NisBlocks};
use crate::kalman::stream::{Stream, StreamStep};
use crate::samples::Samples;

/// Steady-state gain and bandwidth of one filter. They depend on no measurement, so all series with the same parameters,
/// step and noise share one schedule.
#[derive(Debug, Clone)]
pub struct GainSchedule {
    /// The filter before the first sample of a segment.
    start: Stream,
    bandwidth_hz: Result<f64, Error>,
}

impl GainSchedule {
    /// Iterates the covariance (25, 26, 28) from P₀ until the steady state.
    pub fn new(filter: &Filter) -> Self {
        Self { start: Stream::steady_state(filter), bandwidth_hz: filter.bandwidth_hz() }
    }

    /// As [`Filter::bandwidth_hz`], stored.
    ///
    /// # Errors
    /// As [`Filter::steady_state_gain`].
    pub fn bandwidth_hz(&self) -> Result<f64, Error> {
        self.bandwidth_hz.clone()
    }

    /// Filters all segments (24–28), each from its own initial state, and passes index and step of each sample to `put`.
    ///
    /// Channels have one value per sample: δX in m and load in N. A missing load (NaN) is replaced by the one before.
    ///
    /// # Errors
    /// [`Error::Lengths`] for channels that do not fit, [`Error::NothingMeasured`] when no segment
    /// holds a measurement.
    pub fn for_each_step(
        &self,
        samples: &Samples<'_>,
        mut put: impl FnMut(usize, &StreamStep),
    ) -> Result<Nis, Error> {
        samples.check()?;
        let mut nis = NisBlocks::new(samples.dx_m.len());
        for segment in samples.segments {
            let (y_m, load_n) = (&samples.dx_m[segment.clone()], &samples.load_n[segment.clone()]);
            let Some(first) = y_m.iter().position(|y| !y.is_nan()) else { continue };
            let held_n = load_n[..=first].iter().rfind(|u| !u.is_nan()).copied().unwrap_or(0.0);
            let mut stream = self.start;
            stream.start(y_m[first], held_n);
            let mut at = segment.start;
            stream.push_all(y_m.iter().zip(load_n), |step| {
                nis.add_sample(step.innovation_m, step.innovation_variance_m2);
                put(at, step);
                at += 1;
            })?;
        }
        nis.finish()
    }

    /// Writes S at each sample, m, into `s_m`, whose memory is reused; NaN outside the segments.
    ///
    /// # Errors
    /// As [`GainSchedule::for_each_step`].
    pub fn track(&self, samples: &Samples<'_>, s_m: &mut Vec<f64>) -> Result<Nis, Error> {
        s_m.clear();
        s_m.resize(samples.dx_m.len(), f64::NAN);
        self.for_each_step(samples, |k, step| s_m[k] = step.s_m())
    }
}
