//! Steps and drift of a quantity: forward selection of regressors, then elimination of those that do not hold.
//!
//! ```text
//! y_i = b + d·(u_i − ū) + Σ_k s_k·[i ≥ k] + e_i         Var e_i = inflation · factor · se_i²
//! ```
//! with u the usage. A step's place is that of the largest decrease of the weighted squares of what the other
//! regressors leave (Bai & Perron 1998, one break at a time).

use nalgebra::{SMatrix, SVector};

use super::{MIN_FLIGHTS, QuantityValue};
use crate::data::noise::{Assumed, Noise, inflation};

const MAX_STEPS: usize = 4;
/// Regressors: one, the drift, the steps. Where one is not selected, its column is zero.
const COLUMNS: usize = FIRST_STEP + MAX_STEPS;
const DRIFT: usize = 1;
const FIRST_STEP: usize = 2;
/// Fewest flights before the first step, and from each step to the next or to the end.
const LEAST_BEFORE: usize = 5;
const LEAST_AFTER: usize = 3;
/// Squared t-value from which a step is selected: it is the largest over all flights, and each run searches again.
const STEP_GAIN: f64 = 32.0;
/// Squared t-value from which a drift is selected.
const DRIFT_GAIN: f64 = 18.0;
/// Standard deviations by which two values that agree differ at most: neighbours share errors.
const AGREEMENT_SDS: f64 = 6.0;
/// Variance inflation of means assumed before neighbours were seen to share errors.
const USUAL_INFLATION: f64 = 2.5;

type Row = SVector<f64, COLUMNS>;
type Square = SMatrix<f64, COLUMNS, COLUMNS>;

/// A step of a quantity.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct QuantityStep {
    /// Departure of the first flight after it, µs since 1970 UTC.
    pub departure_us: i64,
    /// Size, in the quantity's unit.
    pub size: f64,
    /// Standard error of the size.
    pub size_se: f64,
}

/// Steps, drift and level of a quantity.
#[derive(Debug, Clone, PartialEq)]
pub struct QuantityChanges {
    /// Values used.
    pub flights: usize,
    /// Values excluded as outliers.
    pub outliers: usize,
    /// Fitted value at the first flight.
    pub baseline: f64,
    /// Fitted value at the last flight.
    pub level: f64,
    /// Standard error of the level.
    pub level_se: f64,
    /// Level less baseline; exactly zero where nothing changed significantly.
    pub change: f64,
    /// Standard error of the change.
    pub change_se: f64,
    /// Change per flight hour without the steps, significant or not, and its standard error.
    pub rate_per_hour: Option<(f64, f64)>,
    /// Whether the drift is significant.
    pub is_drifting: bool,
    /// Significant steps, by time.
    pub steps: Vec<QuantityStep>,
}

/// Fits steps and drift to the values of one unit, in order of departure; none below two values.
///
/// `least_scatter` is the smallest scatter between flights to assume, in the quantity's unit.
///
/// ```
/// use trend::quantity::{QuantityValue, changes};
///
/// // A delay of 0.1 ms that is 2.1 ms from the 31st flight on, with a scatter of 50 µs.
/// let value = |k: i64| QuantityValue {
///     departure_us: k * 86_400_000_000,
///     usage_hours: 2.0 * k as f64,
///     value: if k < 30 { 0.1e-3 } else { 2.1e-3 } + 50e-6 * (1.7 * k as f64).sin(),
///     se: 10e-6,
///     ..QuantityValue::default()
/// };
/// let values: Vec<QuantityValue> = (0..40).map(value).collect();
/// let found = changes::fit(&values, 1e-6).ok_or("too few values")?;
/// assert_eq!(found.steps[0].departure_us, values[30].departure_us);
/// assert!((found.change - 2e-3).abs() < 5.0 * found.change_se);
/// # Ok::<(), &str>(())
/// ```
pub fn fit(values: &[QuantityValue], least_scatter: f64) -> Option<QuantityChanges> {
    let (all, stated): (Vec<f64>, Vec<f64>) = values.iter().map(|v| (v.value, v.se)).unzip();
    let (least, largest) = (least_scatter, f64::MAX);
    // Stated errors do not contain the scatter from flight to flight, so they count for nothing.
    let noise = Noise::of(&all, &stated, &Assumed { least, largest, unstated: least, differences: 0.0 });
    let weighted = values.iter().zip(&noise.errors).zip(noise.are_sound(&all, AGREEMENT_SDS));
    let sound = weighted.filter(|(_, is_sound)| *is_sound).map(|((value, error), _)| (*value, *error));
    let (sound, errors): (Vec<QuantityValue>, Vec<f64>) = sound.unzip();
    let inflation = inflation(&sound.iter().map(|v| v.value).collect::<Vec<_>>(), &errors, USUAL_INFLATION);
    let weights: Vec<f64> = errors.iter().map(|error| (inflation * error * error).recip()).collect();
    let mut model = Model::new(&sound, &weights);
    if sound.len() >= MIN_FLIGHTS {
        // Adds the regressor with the largest gain as long as one is significant, then removes those that are not.
        while model.steps.len() < MAX_STEPS && model.add_best() {}
        while model.remove_worst() {}
    }
    let (beta, covariance) = model.solve_with(model.has_drift)?;
    let (x_first, x_last) = (model.row(0), model.row(sound.len().checked_sub(1)?));
    let variance = |x: &Row| (x.transpose() * covariance * x)[(0, 0)].max(0.0);
    let moved = x_last - x_first;
    let steps = model.steps.iter().enumerate().map(|(k, step)| {
        let (column, departure_us) = (FIRST_STEP + k, sound[step.place].departure_us);
        QuantityStep {
            departure_us,
            size: beta[column],
            size_se: covariance[(column, column)].max(0.0).sqrt(),
        }
    });
    Some(QuantityChanges {
        flights: sound.len(),
        outliers: values.len() - sound.len(),
        baseline: x_first.dot(&beta),
        level: x_last.dot(&beta),
        level_se: variance(&x_last).sqrt(),
        change: moved.dot(&beta),
        change_se: variance(&moved).sqrt(),
        rate_per_hour: model.rate_per_hour(),
        is_drifting: model.has_drift,
        steps: steps.collect(),
    })
}

/// Regressors: one, the drift if selected, and a step from each place on.
struct Model<'a> {
    values: &'a [QuantityValue],
    weights: &'a [f64],
    /// The drift of each value, from −1 to 1 over the span of the usage.
    drifts: Vec<f64>,
    /// Half the span of the usage, hours; zero where usage is constant.
    half_span_hours: f64,
    has_drift: bool,
    all: Sums,
    /// The steps by place, each with the sums from it on.
    steps: Vec<Sums>,
}

/// Weighted sums from a place on. The normal equations need no others: a step is one from its place on, and zero before.
#[derive(Clone, Copy, Default)]
struct Sums {
    place: usize,
    one: f64,
    drift: f64,
    drift_square: f64,
    value: f64,
    drift_value: f64,
}

impl<'a> Model<'a> {
    fn new(values: &'a [QuantityValue], weights: &'a [f64]) -> Self {
        let low = values.iter().map(|v| v.usage_hours).fold(f64::INFINITY, f64::min);
        let high = values.iter().map(|v| v.usage_hours).fold(f64::NEG_INFINITY, f64::max);
        let (middle, half_span_hours) = (0.5 * (low + high), 0.5 * (high - low));
        let drifts = values.iter().map(|v| (v.usage_hours - middle) / half_span_hours).collect();
        let (has_drift, all, steps) = (false, Sums::default(), Vec::new());
        let mut model = Self { values, weights, drifts, half_span_hours, has_drift, all, steps };
        model.all = model.sums_from(0);
        model
    }

    fn sums_from(&self, place: usize) -> Sums {
        let mut sums = Sums { place, ..Sums::default() };
        let weighted_drifts = self.drifts[place..].iter().zip(&self.weights[place..]);
        for (value, (drift, weight)) in self.values[place..].iter().zip(weighted_drifts) {
            sums.one += weight;
            sums.drift += weight * drift;
            sums.drift_square += weight * drift * drift;
            sums.value += weight * value.value;
            sums.drift_value += weight * value.value * drift;
        }
        sums
    }

    fn columns(&self) -> impl Iterator<Item = usize> + Clone {
        let drift = self.has_drift.then_some(DRIFT);
        std::iter::once(0).chain(drift).chain(FIRST_STEP..FIRST_STEP + self.steps.len())
    }

    fn row(&self, index: usize) -> Row {
        let mut row = Row::zeros();
        row[0] = 1.0;
        if self.has_drift {
            row[DRIFT] = self.drifts[index];
        }
        for (k, step) in self.steps.iter().enumerate() {
            row[FIRST_STEP + k] = f64::from(u8::from(index >= step.place));
        }
        row
    }

    /// Coefficients and their covariance, with or without a drift; none where regressors are dependent. A regressor that is
    /// not selected has the coefficient zero.
    fn solve_with(&self, has_drift: bool) -> Option<(Row, Square)> {
        // Of the symmetric matrix, the lower half is read.
        let (mut normal, mut right) = (Square::identity(), Row::zeros());
        let steps = self.steps.iter().enumerate().map(|(k, step)| (FIRST_STEP + k, step));
        for (column, sums) in std::iter::once((0, &self.all)).chain(steps) {
            // Of two steps, both are one from the later on.
            normal.row_mut(column).columns_range_mut(..column + 1).fill(sums.one);
            normal[(column.max(DRIFT), column.min(DRIFT))] = if has_drift { sums.drift } else { 0.0 };
            right[column] = sums.value;
        }
        if has_drift {
            normal[(DRIFT, DRIFT)] = self.all.drift_square;
            right[DRIFT] = self.all.drift_value;
        }
        let factor = normal.cholesky()?;
        Some((factor.solve(&right), factor.inverse()))
    }

    /// The same with a drift; none where usage is constant.
    fn solve_with_drift(&self) -> Option<(Row, Square)> {
        self.solve_with(true).filter(|_| self.half_span_hours > 0.0)
    }

    /// Adds the regressor with the largest gain, if it is significant.
    fn add_best(&mut self) -> bool {
        // Squared t-value of a drift in addition to the present regressors.
        let with_drift = self.solve_with_drift().filter(|_| !self.has_drift);
        let drift_gain =
            with_drift.map_or(0.0, |(beta, covariance)| beta[DRIFT].powi(2) / covariance[(DRIFT, DRIFT)]);
        let (step_gain, at) = self.best_step();
        // A drift explains with one number what steps would follow in stairs.
        if (drift_gain / DRIFT_GAIN).max(step_gain / STEP_GAIN) < 1.0 {
            return false;
        }
        if drift_gain + STEP_GAIN - DRIFT_GAIN >= step_gain {
            self.has_drift = true;
        } else {
            let before = self.steps.partition_point(|step| step.place < at);
            self.steps.insert(before, self.sums_from(at));
        }
        true
    }

    /// The largest squared t-value of a further step, and its place: by suffix sums, in one pass.
    fn best_step(&self) -> (f64, usize) {
        let Some((beta, covariance)) = self.solve_with(self.has_drift) else { return (0.0, 0) };
        let (mut best, columns) = ((0.0, 0), self.columns().collect::<Vec<_>>());
        let (mut residual, mut weight, mut shared) = (0.0, 0.0, Row::zeros());
        for (index, value) in self.values.iter().enumerate().rev() {
            let row = self.row(index);
            let w = self.weights[index];
            residual += w * (value.value - columns.iter().map(|&c| row[c] * beta[c]).sum::<f64>());
            weight += w;
            shared.axpy(w, &row, 1.0);
            if !self.is_free(index) {
                continue;
            }
            let of_column =
                |c: usize| columns.iter().map(|&other| shared[other] * covariance[(other, c)]).sum::<f64>();
            let own = weight - columns.iter().map(|&c| of_column(c) * shared[c]).sum::<f64>();
            if own > 1e-9 * weight && residual * residual / own > best.0 {
                best = (residual * residual / own, index);
            }
        }
        best
    }

    /// Whether a further step may be at an index: far enough from both ends and from the other steps.
    fn is_free(&self, index: usize) -> bool {
        let from_others = self.steps.iter().all(|step| index.abs_diff(step.place) >= LEAST_AFTER);
        index >= LEAST_BEFORE && self.values.len() - index >= LEAST_AFTER && from_others
    }

    /// Removes the least significant regressor, if it is not significant in addition to the others.
    fn remove_worst(&mut self) -> bool {
        let Some((beta, covariance)) = self.solve_with(self.has_drift) else { return false };
        let gain = |column: &usize| {
            let needed = if *column == DRIFT { DRIFT_GAIN } else { STEP_GAIN };
            beta[*column] * beta[*column] / covariance[(*column, *column)] / needed
        };
        let worst = self
            .columns()
            .skip(1)
            .min_by(|a, b| gain(a).total_cmp(&gain(b)))
            .filter(|column| gain(column) < 1.0);
        match worst {
            Some(DRIFT) => self.has_drift = false,
            Some(column) => drop(self.steps.remove(column - FIRST_STEP)),
            None => {}
        }
        worst.is_some()
    }

    /// Drift per hour without the steps, and its standard error, also where it is not significant.
    fn rate_per_hour(&self) -> Option<(f64, f64)> {
        if self.values.len() < MIN_FLIGHTS {
            return None;
        }
        let (beta, covariance) = self.solve_with_drift()?;
        let (rate, se) = (beta[DRIFT], covariance[(DRIFT, DRIFT)].max(0.0).sqrt());
        Some((rate / self.half_span_hours, se / self.half_span_hours))
    }
}
