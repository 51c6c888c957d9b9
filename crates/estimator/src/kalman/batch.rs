//! The filter over whole flights: S(t) of every segment.
//!
//! The covariance depends on no measurement, so while every sample is measured the gain settles. From
//! there predict and correct fold into one map with constant coefficients, for eight parts of the flight at a
//! time. A missing sample sets the covariance moving again, and the plain recursion runs until it is back.

use std::ops::Range;

use nalgebra::Vector3;

use crate::error::Error;
use crate::kalman::filter::{Filter, KalmanState};
use crate::kalman::gain_schedule::GainSchedule;
use crate::kalman::nis::{BLOCK_SAMPLES, Nis, NisBlocks};
use crate::kalman::parallel::{ChunkIo, ChunkPlan, ChunkStates, PARTS};
use crate::kalman::steady_state::{self, SteadyState, SteadyStateFilter};
use crate::samples::Samples;
use crate::simd::dispatch::simd_dispatch;

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

impl GainSchedule {
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
        let mut workspace = FilterWorkspace::default();
        let nis = self.filter_with(samples, innovations, &mut workspace)?;
        Ok(FilterOutput { s_m: workspace.s_m, nis })
    }

    /// As [`GainSchedule::track`], with S in the workspace.
    ///
    /// # Errors
    /// As [`GainSchedule::track`].
    pub fn filter_with(
        &self,
        samples: &Samples<'_>,
        mut innovations: Option<&mut InnovationBuffers>,
        workspace: &mut FilterWorkspace,
    ) -> Result<Nis, Error> {
        samples.check()?;
        let count = samples.dx_m.len();
        if let Some(out) = innovations.as_deref_mut() {
            out.innovation_m = vec![f64::NAN; count];
            out.variance_m2 = vec![f64::NAN; count];
        }
        // What no segment covers is NaN; all else will be written.
        workspace.s_m.resize(count, 0.0);
        for_each_uncovered(samples.segments, count, |gap| workspace.s_m[gap].fill(f64::NAN));
        let mut pass = FilterPass {
            schedule: self,
            innovations,
            workspace,
            squares: 0.0,
            blocks: NisBlocks::default(),
            measured: 0,
            checked_until: 0,
        };
        for segment in samples.segments {
            let (y_m, load_n) = (&samples.dx_m[segment.clone()], &samples.load_n[segment.clone()]);
            pass.segment(y_m, load_n, segment.start)?;
        }
        let FilterPass { squares, blocks, measured, .. } = pass;
        if measured == 0 { Err(Error::NothingMeasured) } else { Ok(blocks.finish(squares, measured)) }
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

/// Memory for S(t), reused for the next series.
#[derive(Debug, Default)]
pub struct FilterWorkspace {
    s_m: Vec<f64>,
    /// Squared innovations of eight parts, group by group.
    squares_m2: Vec<[f64; PARTS]>,
}

impl FilterWorkspace {
    /// S of the last series at each sample, m; NaN outside its segments.
    pub fn s_m(&self) -> &[f64] {
        &self.s_m
    }
}

/// The stretches that no segment covers.
fn for_each_uncovered(segments: &[Range<usize>], count: usize, mut note: impl FnMut(Range<usize>)) {
    let mut sorted: Vec<&Range<usize>> = segments.iter().collect();
    sorted.sort_unstable_by_key(|segment| segment.start);
    let mut covered = 0;
    for segment in sorted {
        note(covered..segment.start.max(covered));
        covered = covered.max(segment.end);
    }
    note(covered..count);
}

/// A run over segments, and what it has handed out so far.
struct FilterPass<'f> {
    schedule: &'f GainSchedule,
    innovations: Option<&'f mut InnovationBuffers>,
    workspace: &'f mut FilterWorkspace,
    /// Sum of the normalised squared innovations, and the sums of its blocks.
    squares: f64,
    blocks: NisBlocks,
    measured: usize,
    /// Samples before this one are checked for missing values.
    checked_until: usize,
}

impl FilterPass<'_> {
    fn segment(&mut self, y_m: &[f64], load_n: &[f64], offset: usize) -> Result<(), Error> {
        let GainSchedule { filter, folded, .. } = self.schedule;
        let Some(first) = y_m.iter().position(|y| !y.is_nan()) else {
            self.workspace.s_m[offset..offset + y_m.len()].fill(f64::NAN);
            return Ok(());
        };
        let mut state = filter.initial_state(y_m[first], held(load_n, first));
        let mut k = self.open(&mut state, y_m, load_n, offset);
        let mut settled = k == self.schedule.transient.len() && self.schedule.settles;
        while k < y_m.len() {
            if let Some(folded) = folded.as_ref().filter(|_| settled) {
                k += self.filter_run(folded, &mut state.x, &y_m[k..], &load_n[k - 1..], offset + k);
                settled = false;
                continue;
            }
            if k > 0 {
                state = filter.predict(&state, held(load_n, k - 1));
            }
            let step = filter.update(&state, y_m[k])?;
            self.put(offset + k, &step.posterior.x, step.innovation_m, step.innovation_variance_m2);
            state = step.posterior;
            k += 1;
            settled = folded.as_ref().is_some_and(|folded| folded.is_converged(&step));
        }
        Ok(())
    }

    /// The first samples by the gains of the schedule, as long as none is missing; how many.
    fn open(&mut self, state: &mut KalmanState, y_m: &[f64], load_n: &[f64], offset: usize) -> usize {
        let GainSchedule { filter, transient, .. } = self.schedule;
        let mut done = 0;
        for (opening, &y_m) in transient.iter().zip(y_m).take_while(|(_, y_m)| !y_m.is_nan()) {
            if done > 0 {
                state.x = filter.predict_state(&state.x, held(load_n, done - 1));
            }
            let innovation_m = y_m - state.x[0];
            *state = KalmanState { x: state.x + opening.gain * innovation_m, p: opening.p };
            self.put(offset + done, &state.x, innovation_m, opening.variance_m2);
            done += 1;
        }
        done
    }

    fn put(&mut self, at: usize, x: &Vector3<f64>, innovation_m: f64, variance_m2: f64) {
        self.workspace.s_m[at] = x[2];
        if let Some(out) = self.innovations.as_deref_mut() {
            (out.innovation_m[at], out.variance_m2[at]) = (innovation_m, variance_m2);
        }
        if !innovation_m.is_nan() {
            let square = innovation_m * innovation_m / variance_m2;
            self.squares += square;
            self.blocks.add_sample(square);
            self.measured += 1;
        }
    }

    /// Samples until the first that lacks something, under a settled gain; how many. Each goes with the load before
    /// it.
    fn filter_run(
        &mut self,
        map: &SteadyStateFilter,
        x: &mut Vector3<f64>,
        y_m: &[f64],
        load_n: &[f64],
        at: usize,
    ) -> usize {
        let (from, load_n) = (map.transform(x), &load_n[..y_m.len()]);
        let s_m = &mut self.workspace.s_m[at..at + y_m.len()];
        let (done, last, squares_m2) = match self.innovations.as_deref_mut() {
            None => {
                let checked = self.checked_until.saturating_sub(at);
                let blocks = &mut self.blocks;
                let mut filter_run =
                    SampleRun { schedule: self.schedule, map, y_m, load_n, s_m, blocks, checked };
                let found = filter_run.run(from, &mut self.workspace.squares_m2);
                self.checked_until = at + filter_run.checked;
                found
            }
            Some(out) => {
                let done = whole_until(y_m, load_n);
                out.variance_m2[at..at + done].fill(map.variance_m2);
                let innovation_m = &mut out.innovation_m[at..at + done];
                let columns = (&y_m[..done], &load_n[..done]);
                let (last, squares_m2) =
                    steady_state::run(map, from, 0.0, columns, &mut s_m[..done], innovation_m);
                for innovations in innovation_m.chunks(BLOCK_SAMPLES) {
                    let square_m2: f64 = innovations.iter().map(|e| e * e).sum();
                    self.blocks.add(square_m2 / map.variance_m2, innovations.len());
                }
                (done, last, squares_m2)
            }
        };
        if done > 0 {
            *x = map.inverse_transform(last);
        }
        self.squares += squares_m2 / map.variance_m2;
        self.measured += done;
        done
    }
}

/// Number of samples that are checked before they are filtered, per sample in which a value was missing. The check
/// takes a tenth of the time of filtering.
const RESCAN_FACTOR: usize = 16;

/// Samples under a converged gain, and the output slice for their S.
struct SampleRun<'a> {
    schedule: &'a GainSchedule,
    map: &'a SteadyStateFilter,
    y_m: &'a [f64],
    load_n: &'a [f64],
    s_m: &'a mut [f64],
    blocks: &'a mut NisBlocks,
    /// Number of samples, from the first on, that are checked before they are filtered, since some were missing.
    checked: usize,
}

impl SampleRun<'_> {
    /// In eight parts at once while enough is left, then one after the other, until a sample is missing: how many,
    /// the last state, and the sum of the squared innovations, added up in the order of the groups.
    ///
    /// A missing sample shows as NaN in the sums of the parts, which costs less than a test of every sample before.
    fn run(&mut self, from: SteadyState, squares_m2: &mut Vec<[f64; PARTS]>) -> (usize, SteadyState, f64) {
        let Self { schedule, map, y_m, load_n, .. } = *self;
        let (mut x, mut sum_m2, mut at, mut end) = (from, 0.0, 0, y_m.len());
        if self.checked > 0 {
            end = whole_until(y_m, load_n);
        }
        while let Some(cut) = schedule.lead.and_then(|lead| ChunkPlan::new(end - at, lead)) {
            let all = at..at + cut.samples();
            let (y_m, load_n) = (&y_m[at..], &load_n[at..]);
            squares_m2.resize(squares_m2.len().max(cut.groups()), [0.0; PARTS]);
            let states = starts((&schedule.filter, map), cut, x, y_m, load_n);
            let mut work =
                ChunkIo { map, cut, y_m, load_n, s_m: &mut self.s_m[at..], squares_m2, blocks: self.blocks };
            if let Some(found) = work.run(states, sum_m2) {
                (x, sum_m2) = found;
                at = all.end;
                continue;
            }
            self.checked = at + RESCAN_FACTOR * cut.samples();
            let whole = whole_until(&y_m[..cut.samples()], &load_n[..cut.samples()]);
            if whole == cut.samples() {
                break; // Nothing is missing, and something not finite.
            }
            end = at + whole;
        }
        end = at + whole_until(&y_m[at..end], &load_n[at..end]);
        for start in (at..end).step_by(BLOCK_SAMPLES) {
            let block = start..(start + BLOCK_SAMPLES).min(end);
            let before_m2 = sum_m2;
            let columns = (&y_m[block.clone()], &load_n[block.clone()]);
            (x, sum_m2) = steady_state::run(map, x, sum_m2, columns, &mut self.s_m[block.clone()], &mut []);
            self.blocks.add((sum_m2 - before_m2) / map.variance_m2, block.len());
        }
        (end, x, sum_m2)
    }
}

/// The state before each part: known for the first, guessed from the sample before for the others.
fn starts(
    (filter, map): (&Filter, &SteadyStateFilter),
    cut: ChunkPlan,
    x: SteadyState,
    y_m: &[f64],
    load_n: &[f64],
) -> ChunkStates {
    let mut states = x.map(|entry| [entry; PARTS]);
    for part in 1..PARTS {
        let before = cut.start(part) - 1;
        let guess = map.transform(&filter.initial_state(y_m[before], load_n[before]).x);
        states.iter_mut().zip(&guess).for_each(|(entry, guess)| entry[part] = *guess);
    }
    states
}

/// The load at a sample, or the last before it that was there, N.
fn held(load_n: &[f64], at: usize) -> f64 {
    load_n[..=at].iter().rfind(|u| !u.is_nan()).copied().unwrap_or(0.0)
}

/// How many samples from here have both a measurement and a load before it.
fn whole_until(y_m: &[f64], load_n: &[f64]) -> usize {
    let whole = whole_blocks(y_m, load_n) * BLOCK;
    let rest = y_m[whole..].iter().zip(&load_n[whole..]);
    whole + rest.clone().position(|(y, u)| (y + u).is_nan()).unwrap_or(rest.len())
}

/// Samples that are checked together: a loop without early exit is vectorized.
const BLOCK: usize = 64;

simd_dispatch! {
    /// How many blocks from here lack nothing.
    fn whole_blocks(y_m: &[f64], load_n: &[f64]) -> usize {
        let (y_m, load_n) = (y_m.as_chunks::<BLOCK>().0, load_n.as_chunks::<BLOCK>().0);
        let mut count = 0;
        for (y_m, load_n) in y_m.iter().zip(load_n) {
            let mut is_whole = true;
            for (y, u) in y_m.iter().zip(load_n) {
                is_whole &= !(y + u).is_nan();
            }
            if !is_whole {
                return count;
            }
            count += 1;
        }
        count
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]
mod tests {
    use super::*;
    use crate::{ActuatorModel, NoiseModel};
    use nalgebra::{Matrix3, Vector3};

    /// Chunks with any length of warm-up, too short ones included, and a single chunk give bitwise identical results.
    #[test]
    fn a_lead_that_is_too_short_costs_time_and_no_bit() {
        let w_d = Matrix3::from_diagonal(&Vector3::new(1e-14, 1e-8, 1e-12));
        let noise = NoiseModel::PerStep { w_d, v_d_m2: 1e-11 };
        let filter = Filter::new(&ActuatorModel::linear(5e7, 2000.0, 8.0).unwrap(), 0.004, &noise).unwrap();
        let load_n: Vec<f64> = (0..30_000).map(|k| 5e3 * (f64::from(k) * 0.01).sin()).collect();
        let mut dx_m: Vec<f64> = load_n.iter().map(|u| u / 5e7 + 50e-6 * u.signum()).collect();
        dx_m[20_000] = f64::NAN;
        let segments = [0..25_000, 25_500..30_000];
        let samples =
            Samples { step_s: 0.004, motor_m: &dx_m, dx_m: &dx_m, load_n: &load_n, segments: &segments };
        let schedule = GainSchedule::new(&filter);
        assert!(schedule.lead.is_some());
        let track = |lead| {
            let mut schedule = schedule.clone();
            schedule.lead = lead;
            let track = schedule.track(&samples, None).unwrap();
            (
                track.s_m.iter().map(|s| s.to_bits()).collect::<Vec<_>>(),
                track.nis.mean.to_bits(),
                track.nis.measured,
            )
        };
        let wanted = track(None);
        for lead in [schedule.lead, Some(1), Some(17)] {
            assert!(track(lead) == wanted, "a lead of {lead:?} changes the track");
        }
    }
}
