//! The paper's claims of its method, measured.

use estimator::gap::{GapStatistic, mid_range};
use estimator::{Filter, KalmanState};
use rayon::prelude::*;
use simulator::{Flight, Plant, Sensors};

use crate::paper::{GAP_M, STEP_S, backlash_m, filter, fly, states};

/// Seeds of the flights; the figures show the first.
const SEEDS: [u64; 5] = [11, 12, 13, 14, 15];
/// Factors on damping and mass.
const DECADES: [f64; 7] = [0.1, 0.3, 1.0, 3.0, 10.0, 30.0, 100.0];
/// Factors on the stiffness.
const TENTHS: [f64; 5] = [0.9, 0.95, 1.0, 1.05, 1.1];
/// Factors on W_d.
const TUNINGS: [f64; 7] = [1e-3, 1e-2, 1e-1, 1.0, 1e1, 1e2, 1e3];
/// Factors on the noise of both positions.
const NOISES: [f64; 5] = [0.1, 1.0, 3.0, 10.0, 30.0];
/// Factors on P₀.
const SPREADS: [f64; 5] = [1e-6, 1e-3, 1.0, 1e3, 1e6];
/// A wrong initial backlash, m.
const WRONG_M: f64 = 1e-3;
/// Growth of the varying gap over the flight, as a share.
const GROWTH: f64 = 1.0;
/// Window of the statistic of a varying gap, s.
const WINDOW_S: f64 = 12.0;
/// The state has converged once S is within this share of the gap.
const CONVERGED: f64 = 0.01;

/// A change of ΔS, % of the gap, over the flights.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Change {
    pub(crate) factor: f64,
    /// Least, mean and most over the flights.
    pub(crate) percent: [f64; 3],
}

impl Change {
    fn of(factor: f64, percent: &[f64]) -> Self {
        let least = percent.iter().copied().fold(f64::INFINITY, f64::min);
        let most = percent.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        Self { factor, percent: [least, percent.iter().sum::<f64>() / percent.len() as f64, most] }
    }

    /// The largest amount of any flight, %.
    pub(crate) fn largest(&self) -> f64 {
        self.percent[0].abs().max(self.percent[2].abs())
    }
}

#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Convergence {
    pub(crate) name: String,
    /// Difference of S from that of the right start, m, sample by sample.
    pub(crate) error_m: Vec<f64>,
    /// Time until the difference stays below 1 % of the gap, s.
    pub(crate) time_s: f64,
}

/// One window of a flight whose gap grows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Window {
    /// Its middle, s.
    pub(crate) time_s: f64,
    pub(crate) true_m: f64,
    /// ΔS of its samples, m.
    pub(crate) gap_m: f64,
}

#[derive(Debug, Clone)]
pub(crate) struct Claims {
    /// The flight of the figures.
    pub(crate) flight: Flight,
    /// The filter's state after each of its samples.
    pub(crate) states: Vec<KalmanState>,
    /// Its ΔS (29–31).
    pub(crate) gap: GapStatistic,
    /// Error of ΔS with everything known, %.
    pub(crate) known: Change,
    /// From wrong states.
    pub(crate) starts: Vec<Convergence>,
    /// From a wrong backlash with wrong covariances.
    pub(crate) spreads: Vec<Convergence>,
    /// Error of ΔS against the noise of both positions.
    pub(crate) noise: Vec<Change>,
    /// Error of ΔS against W_d/V_d.
    pub(crate) tuning: Vec<Change>,
    /// Changes of ΔS by an assumed damping, mass and stiffness.
    pub(crate) damping: Vec<Change>,
    pub(crate) mass: Vec<Change>,
    pub(crate) stiffness: Vec<Change>,
    /// A gap that grows within the flight.
    pub(crate) varying: Vec<Window>,
}

/// An error is one of the simulator or of the estimator.
type Result<T> = std::result::Result<T, Box<dyn std::error::Error + Send + Sync>>;

impl Claims {
    pub(crate) fn measure() -> Result<Self> {
        let sensors = Sensors::default();
        let flights = fly_all(&sensors)?;
        let nominal = Plant::default();
        let usual = filter(&nominal, 1.0, &sensors)?;
        let own = states(&usual, &flights[0], None)?;
        let converging = Converging { filter: &usual, flight: &flights[0], right: &own };
        let known_m: Vec<f64> = gaps_m(&usual, &flights)?;
        let against_known = |factors: &[f64], spoil: fn(&mut Plant, f64)| {
            let change = |&factor: &f64| {
                let mut assumed = nominal;
                spoil(&mut assumed, factor);
                let found_m = gaps_m(&filter(&assumed, 1.0, &sensors)?, &flights)?;
                let percent: Vec<f64> =
                    found_m.iter().zip(&known_m).map(|(gap, known)| 100.0 * (gap - known) / GAP_M).collect();
                Ok(Change::of(factor, &percent))
            };
            factors.par_iter().map(change).collect::<Result<Vec<Change>>>()
        };
        let tuning = TUNINGS.par_iter().map(|&factor| {
            Ok(Change::of(factor, &errors(&gaps_m(&filter(&nominal, factor, &sensors)?, &flights)?)))
        });
        Ok(Self {
            gap: mid_range(&backlash_m(&own))?,
            known: Change::of(1.0, &errors(&known_m)),
            starts: vec![
                converging.after("backlash 1 mm off", |state| state.x[2] += WRONG_M)?,
                converging.after("position 1 mm off", |state| state.x[0] += WRONG_M)?,
                converging.after("speed 0.1 m/s off", |state| state.x[1] += 0.1)?,
                converging.after("x₀ = 0", |state| state.x.fill(0.0))?,
            ],
            spreads: SPREADS.iter().map(|&factor| converging.with_spread(factor)).collect::<Result<_>>()?,
            noise: NOISES.par_iter().map(|&factor| noise(factor)).collect::<Result<_>>()?,
            tuning: tuning.collect::<Result<_>>()?,
            damping: against_known(&DECADES, |plant, factor| plant.contact.damping_n_s_per_m *= factor)?,
            mass: against_known(&DECADES, |plant, factor| plant.screw_mass_kg *= factor)?,
            stiffness: against_known(&TENTHS, |plant, factor| plant.contact.stiffness_n_per_m *= factor)?,
            varying: varying(&usual, &sensors)?,
            states: own,
            flight: flights.into_iter().next().ok_or(estimator::Error::NothingMeasured)?,
        })
    }
}

fn fly_all(sensors: &Sensors) -> Result<Vec<Flight>> {
    SEEDS.par_iter().map(|&seed| Ok(fly(&Plant::default(), sensors, seed)?)).collect()
}

fn gaps_m(filter: &Filter, flights: &[Flight]) -> Result<Vec<f64>> {
    let gap_m = |flight| Ok(mid_range(&backlash_m(&states(filter, flight, None)?))?.gap_m);
    flights.iter().map(gap_m).collect()
}

/// Errors of gaps, % of the true one.
fn errors(gaps_m: &[f64]) -> Vec<f64> {
    gaps_m.iter().map(|gap| 100.0 * (gap / GAP_M - 1.0)).collect()
}

/// Both positions noisier, with the V_d that belongs to them.
fn noise(factor: f64) -> Result<Change> {
    let mut sensors = Sensors::default();
    sensors.screw.noise_rms *= factor;
    sensors.motor.noise_rms *= factor;
    let filter = filter(&Plant::default(), 1.0, &sensors)?;
    Ok(Change::of(factor, &errors(&gaps_m(&filter, &fly_all(&sensors)?)?)))
}

/// A flight whose S converges from wrong starts to S from the right one.
struct Converging<'a> {
    filter: &'a Filter,
    flight: &'a Flight,
    right: &'a [KalmanState],
}

impl Converging<'_> {
    fn after(&self, name: &str, spoil: impl FnOnce(&mut KalmanState)) -> Result<Convergence> {
        let flight = self.flight;
        let mut start = self.filter.initial_state(flight.screw_m[0] - flight.motor_m[0], flight.load_n[0]);
        spoil(&mut start);
        let found = states(self.filter, flight, Some(start))?;
        let error_m: Vec<f64> =
            found.iter().zip(self.right).map(|(one, other)| (one.x[2] - other.x[2]).abs()).collect();
        let last = error_m.iter().rposition(|error| *error > CONVERGED * GAP_M);
        let time_s = last.map_or(0.0, |k| (k + 1) as f64 * STEP_S);
        Ok(Convergence { name: name.to_owned(), error_m, time_s })
    }

    /// From a wrong backlash, with P₀ times a factor.
    fn with_spread(&self, factor: f64) -> Result<Convergence> {
        let name = match factor.log10().round() as i32 {
            0 => "P₀ as configured".to_owned(),
            exponent => format!("P₀ × 10^{exponent}"),
        };
        self.after(&name, |state| {
            state.x[2] += WRONG_M;
            state.p *= factor;
        })
    }
}

/// A gap that doubles within the flight, by windows.
fn varying(filter: &Filter, sensors: &Sensors) -> Result<Vec<Window>> {
    let mut plant = Plant::default();
    plant.contact.gap_drift = GROWTH;
    let flight = fly(&plant, sensors, SEEDS[0])?;
    let s_m = backlash_m(&states(filter, &flight, None)?);
    let samples = (WINDOW_S / STEP_S).round() as usize;
    let duration_s = s_m.len() as f64 * STEP_S;
    let window = |(k, s_m): (usize, &[f64])| {
        let time_s = (k as f64 + 0.5) * WINDOW_S;
        let true_m = GAP_M * (1.0 + GROWTH * time_s / duration_s);
        Ok(Window { time_s, true_m, gap_m: mid_range(s_m)?.gap_m })
    };
    s_m.chunks_exact(samples).enumerate().map(window).collect()
}
