//! Files, columns and channels of a flight log.

use std::collections::BTreeMap;
use std::ops::Range;
use std::path::PathBuf;

use records::Position;

use crate::channel::buffer_pool;
use crate::channel::quality::Quality;
use crate::time::clock::TimestampRepairs;

/// The files of one flight log: usually one.
#[derive(Debug, Clone, Default, PartialEq, Eq, PartialOrd, Ord, serde::Serialize, serde::Deserialize)]
pub struct LogFiles {
    /// The main log, in one piece or in several.
    pub main: Vec<PathBuf>,
    /// Files of other kinds, by the name of their group.
    pub groups: BTreeMap<String, Vec<PathBuf>>,
}

impl LogFiles {
    /// A log that is one file.
    pub fn one(path: impl Into<PathBuf>) -> Self {
        Self { main: vec![path.into()], groups: BTreeMap::new() }
    }

    /// Every file, the main log first.
    pub fn all(&self) -> impl Iterator<Item = &PathBuf> {
        self.main.iter().chain(self.groups.values().flatten())
    }
}

/// The columns of one actuator in one log.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ActuatorColumns {
    /// Its place.
    pub position: Position,
    /// The channels that make it, as mapped: motor position, screw position, load, temperature. Of
    /// redundant ones the first that the log has.
    pub columns: [Option<String>; 4],
    /// Mapped channels that the log lacks, without which this actuator cannot be estimated.
    pub lacking: Vec<String>,
}

/// The channels of one actuator: SI, at the screw axis, on one clock.
#[derive(Debug, Clone, PartialEq)]
pub struct ActuatorChannels {
    /// Its place.
    pub position: Position,
    /// Step between samples, s.
    pub step_s: f64,
    /// Whether the output is fixed: δX is then minus the motor position.
    pub output_locked: bool,
    /// Motor position X₁ brought to the screw axis, m; NaN where missing.
    pub motor_m: Vec<f64>,
    /// Relative position δX = X₂ − X₁, m; NaN where either is missing.
    pub dx_m: Vec<f64>,
    /// Load, N, held where it was recorded more slowly.
    pub load_n: Vec<f64>,
    /// Unbroken stretches with a load.
    pub segments: Vec<Range<usize>>,
    /// The first sample after each break of the clock, and its time since the first sample by the log's stamps, s.
    pub breaks: Vec<(usize, f64)>,
    /// Mean temperature, °C.
    pub temperature_c: Option<f64>,
    /// Samples that no condition leaves: NaN in every channel.
    pub excluded: usize,
    /// Share of the other samples without δX.
    pub missing_share: f64,
    /// The columns of motor, screw and load that were read: of redundant ones the first that is alive.
    pub columns: [Option<String>; 3],
    /// Quality of each raw channel: motor, screw, load.
    pub quality: [Quality; 3],
    /// Quality flags of the channels: stable codes.
    pub flags: Vec<String>,
    /// Repairs of the clock.
    pub repairs: TimestampRepairs,
}

impl ActuatorChannels {
    /// Time of a sample since the first one, s: the step within a segment, the log's own stamps at breaks.
    pub fn time_s(&self, sample: usize) -> f64 {
        records::sample_time_s(sample as f64, self.step_s, &self.breaks)
    }

    /// Quality of δX.
    pub fn dx_quality(&self) -> Quality {
        Quality::of(&self.dx_m, &self.segments, None, self.step_s, self.excluded)
    }

    /// Leaves the memory of its channels to the next actuator that this thread reads.
    pub fn recycle_buffers(self) {
        [self.motor_m, self.dx_m, self.load_n].into_iter().for_each(buffer_pool::release);
    }
}
