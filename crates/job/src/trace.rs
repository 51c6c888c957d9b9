//! Trace: inputs and outputs of the filter, sample by sample.

use estimator::{GainSchedule, StreamStep};
use ingest::ActuatorChannels;
use ingest::parquet::writer::Column;
use records::Diagnostic;

use crate::{Part, estimate};

const COLUMNS: [&str; 11] = [
    "time_s",
    "motor_m",
    "dx_m",
    "load_n",
    "s_m",
    "innovation_m",
    "innovation_variance_m2",
    "flank",
    "dx_estimated_m",
    "dx_speed_estimated_m_per_s",
    "motor_speed_m_per_s",
];

/// S(t), its inputs, innovation and its variance of one or more actuators, one after the other.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Trace {
    log: Vec<String>,
    position: Vec<String>,
    /// In the order of [`COLUMNS`]; `flank` is 1 or −1 where the regression saw the upper or lower flank pressed, else 0.
    numbers: [Vec<f64>; COLUMNS.len()],
}

impl Trace {
    /// Number of samples.
    pub fn samples(&self) -> usize {
        self.log.len()
    }

    /// Puts the samples of an actuator of a log behind those that are there.
    ///
    /// # Errors
    /// A diagnostic when the settings of the part do not fit the step of the log.
    pub fn add(&mut self, log: &str, channels: &ActuatorChannels, part: &Part) -> Result<(), Diagnostic> {
        let count = channels.dx_m.len();
        let (log, position) = (vec![log.to_owned(); count], vec![channels.position.to_string(); count]);
        self.extend(Self { log, position, numbers: numbers(channels, part)? });
        Ok(())
    }

    /// Puts another trace behind this one.
    pub fn extend(&mut self, other: Self) {
        self.log.extend(other.log);
        self.position.extend(other.position);
        for (mine, theirs) in self.numbers.iter_mut().zip(other.numbers) {
            mine.extend(theirs);
        }
    }

    /// As columns of a file.
    pub fn columns(&self) -> Vec<(String, Column)> {
        let text = [("log_path", &self.log), ("position", &self.position)];
        let text = text.into_iter().map(|(name, values)| (name.to_owned(), Column::Text(values.clone())));
        let numbers = COLUMNS.iter().zip(&self.numbers);
        text.chain(numbers.map(|(name, values)| ((*name).to_owned(), Column::Real(values.clone())))).collect()
    }
}

fn numbers(channels: &ActuatorChannels, part: &Part) -> Result<[Vec<f64>; COLUMNS.len()], Diagnostic> {
    let (samples, count) = (estimate::samples(channels), channels.dx_m.len());
    let mut steps: [Vec<f64>; 5] = std::array::from_fn(|_| vec![f64::NAN; count]);
    let schedule = GainSchedule::new(&estimate::filter(channels, part)?);
    let put = |k: usize, step: &StreamStep| {
        let numbers = [step.s_m(), step.innovation_m, step.innovation_variance_m2, step.x[0], step.x[1]];
        steps.iter_mut().zip(numbers).for_each(|(column, number)| column[k] = number);
    };
    schedule.for_each_step(&samples, put).map_err(|e| Diagnostic::new("estimate_failed", e))?;
    let [s_m, innovation_m, variance_m2, mut position_m, mut speed_m_per_s] = steps;
    for segment in samples.segments {
        let missing = channels.dx_m[segment.clone()].iter().take_while(|y| y.is_nan()).count();
        for column in [&mut position_m, &mut speed_m_per_s] {
            column[segment.start..][..missing].fill(f64::NAN);
        }
    }
    Ok([
        (0..count).map(|k| channels.time_s(k)).collect(),
        channels.motor_m.clone(),
        channels.dx_m.clone(),
        channels.load_n.clone(),
        s_m,
        innovation_m,
        variance_m2,
        flanks(channels, part, count)?,
        position_m,
        speed_m_per_s,
        motor_speed_m_per_s(channels),
    ])
}

/// Speed of the motor at the screw axis, m/s: central difference over two steps; NaN at the ends of a segment and
/// next to a missing position.
fn motor_speed_m_per_s(channels: &ActuatorChannels) -> Vec<f64> {
    let mut speed = vec![f64::NAN; channels.motor_m.len()];
    for segment in estimate::samples(channels).segments {
        let inner = speed.iter_mut().skip(segment.start + 1);
        for (speed, around) in inner.zip(channels.motor_m[segment.clone()].windows(3)) {
            *speed = (around[2] - around[0]) / (2.0 * channels.step_s);
        }
    }
    speed
}

/// Which flank was pressed at each sample, as the contact regression saw it.
fn flanks(channels: &ActuatorChannels, part: &Part, count: usize) -> Result<Vec<f64>, Diagnostic> {
    let mut pressed = vec![0.0; count];
    for touch in estimate::plot_data(channels, part)?.iter().flat_map(|picture| &picture.touches) {
        let at = |time_s: f64| ((time_s / channels.step_s).round().max(0.0) as usize).min(count);
        let half_s = 0.5 * touch.duration_s;
        pressed[at(touch.time_s - half_s)..at(touch.time_s + half_s)].fill(touch.flank.sign());
    }
    Ok(pressed)
}
