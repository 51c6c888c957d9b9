//! Gain schedule: gains and covariances, which depend on no measurement, computed once per tuning.

use nalgebra::{Matrix3, Vector3};

use crate::error::Error;
use crate::kalman::filter::Filter;
use crate::kalman::steady_state::SteadyStateFilter;

/// Steps of a start that are kept, at most; a sound tuning settles in far fewer.
const MOST_STEPS: usize = 4096;
/// Relative size of an initial-state error below which it is forgotten to the last bit. Of 4800 starts under 120
/// tunings of 50 to 5000 Hz half had become bitwise identical at 1e-16, nine in ten at 1e-22. One in seventy, of parts
/// with a weakly damped mode or very soft compared with the bandwidth, had not at 1e-48, and is recomputed.
const FORGOTTEN: f64 = 1e-24;
/// A tuning that forgets more slowly is not cut into parts.
const LONGEST_LEAD: usize = 65_536;

/// A step after a start, while every sample is measured.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct TransientGain {
    pub(crate) gain: Vector3<f64>,
    pub(crate) variance_m2: f64,
    /// Covariance after the step.
    pub(crate) p: Matrix3<f64>,
}

/// Gains of one filter from the initial state until the steady state, and the steady-state filter: the covariance
/// depends on no measurement, so one schedule serves every series of these parameters, this step and this noise.
#[derive(Debug, Clone)]
pub struct GainSchedule {
    pub(crate) filter: Filter,
    pub(crate) transient: Vec<TransientGain>,
    /// Whether the settled map takes over after them.
    pub(crate) settles: bool,
    pub(crate) folded: Option<SteadyStateFilter>,
    /// Steps after which a start is forgotten to the last bit.
    pub(crate) lead: Option<usize>,
    bandwidth_hz: Result<f64, Error>,
}

impl GainSchedule {
    /// Iterates the covariance (25, 26, 28) from P₀ until the steady state.
    pub fn new(filter: &Filter) -> Self {
        let settled = filter.steady_state_gain();
        let radius = settled.as_ref().map(|(gain, _)| filter.radius_at(gain)).map_err(Clone::clone);
        let folded = settled.ok().map(|(gain, p)| SteadyStateFilter::new(filter, &gain, &p));
        let lead = radius.as_ref().ok().map(|radius| FORGOTTEN.ln() / radius.ln());
        let (transient, settles) = transient(filter, folded.as_ref());
        Self {
            filter: *filter,
            transient,
            settles,
            folded,
            lead: lead.filter(|n| (1.0..LONGEST_LEAD as f64).contains(n)).map(|n| n.ceil() as usize),
            bandwidth_hz: radius.map(|radius| filter.bandwidth_at_hz(radius)),
        }
    }

    /// The filter it was made for.
    pub fn filter(&self) -> &Filter {
        &self.filter
    }

    /// As [`Filter::bandwidth_hz`], stored.
    ///
    /// # Errors
    /// As [`Filter::steady_state_gain`].
    pub fn bandwidth_hz(&self) -> Result<f64, Error> {
        self.bandwidth_hz.clone()
    }
}

/// Steps from a start until the settled map takes over, and whether it does; none where the noise levels
/// forbid a first one.
fn transient(filter: &Filter, folded: Option<&SteadyStateFilter>) -> (Vec<TransientGain>, bool) {
    let mut transient = Vec::new();
    let mut state = filter.initial_state(0.0, 0.0);
    while transient.len() < MOST_STEPS {
        let Ok(step) = filter.update(&state, 0.0) else { break };
        let p = step.posterior.p;
        transient.push(TransientGain { gain: step.gain, variance_m2: step.innovation_variance_m2, p });
        if folded.is_some_and(|folded| folded.is_converged(&step)) {
            return (transient, true);
        }
        state = filter.predict(&step.posterior, 0.0);
    }
    (transient, false)
}
