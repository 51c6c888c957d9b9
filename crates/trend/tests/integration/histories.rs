//! Drawn histories with known truth: a calm unit, and what then happens to it.

use trend::{FleetPrior, MaintenanceEvent, Observation, SerialExecutor, Series, Settings, State};

use crate::random::Random;

pub(crate) const DAY_US: i64 = 86_400_000_000;
pub(crate) const LIMIT_M: f64 = 150e-6;
pub(crate) const LIMIT_UM: f64 = 150.0;

pub(crate) const HOURS: f64 = 2.0;

/// A flight of a unit that departs once in a period and has an hour meter; its gap and the stated error, µm.
pub(crate) fn row(number: i64, period_us: i64, hours: f64, gap_um: f64, error_um: f64) -> Observation {
    Observation {
        departure_us: number * period_us,
        flight_hours: Some(hours),
        tail_hours_end: Some(hours * (number + 1) as f64),
        load_reversals: Some(150),
        gap_m: Some(gap_um * 1e-6),
        gap_se_m: Some(error_um * 1e-6),
        ..Observation::default()
    }
}

/// The unit of some flights, with the usual defaults.
pub(crate) fn series(rows: impl IntoIterator<Item = Observation>) -> Series {
    Series::new(rows).unwrap()
}

pub(crate) struct Drawn {
    random: Random,
    pub(crate) rows: Vec<Observation>,
    pub(crate) maintenance: Vec<MaintenanceEvent>,
    /// Standard error of a record, and what it is stated to be, µm.
    pub(crate) error_um: f64,
    stated: f64,
    /// The gap of the last logs that stayed where they were, µm.
    pub(crate) um: f64,
    /// Flights from one log to the next.
    pub(crate) every: i64,
    pub(crate) flight: i64,
    pub(crate) installation: u32,
}

impl Drawn {
    pub(crate) fn new(seed: u64, every: i64) -> Self {
        let mut random = Random::new(seed);
        let error_um = random.between(0.3, 1.5);
        let stated = random.between(0.8, 1.25);
        let (rows, maintenance) = (Vec::new(), Vec::new());
        Self { random, rows, maintenance, error_um, stated, um: 0.0, every, flight: 0, installation: 0 }
    }

    pub(crate) fn between(&mut self, low: f64, high: f64) -> f64 {
        self.random.between(low, high)
    }

    pub(crate) fn count(&mut self, low: usize, high: usize) -> usize {
        low + (self.random.uniform() * (high - low + 1) as f64) as usize
    }

    pub(crate) fn log(&mut self, um: f64) {
        let measured_um = um + self.error_um * self.random.normal();
        self.flown(Some(measured_um));
    }

    /// Logs of a gap that grows from one value to another, µm.
    pub(crate) fn logs(&mut self, count: usize, gap_um: impl Fn(f64) -> f64) {
        (0..count).for_each(|k| self.log(gap_um((k + 1) as f64 / count as f64)));
    }

    /// Logs of one gap, µm, which is remembered; gap and number are drawn between two.
    pub(crate) fn stay(&mut self, (least, most): (usize, usize), (low, high): (f64, f64)) {
        self.um = self.between(low, high);
        self.above((least, most), (0.0, 0.0));
    }

    /// Logs of a gap that is above the remembered one by as much, µm.
    pub(crate) fn above(&mut self, (least, most): (usize, usize), (low, high): (f64, f64)) {
        let (um, count) = (self.um + self.between(low, high), self.count(least, most));
        self.logs(count, |_| um);
    }

    pub(crate) fn jump(&mut self, (least, most): (usize, usize)) {
        let um = self.between(155.0, 300.0).max(LIMIT_UM + 8.0 * self.error_um);
        let count = self.count(least, most);
        self.logs(count, |_| um);
    }

    /// Logs of a gap that rises from the remembered one to a share of the limit, along a power of the time.
    pub(crate) fn rise(&mut self, (least, most): (usize, usize), share: (f64, f64), power: (f64, f64)) {
        let (from_um, to_um) = (self.um, LIMIT_UM * self.between(share.0, share.1));
        let (power, count) = (self.between(power.0, power.1), self.count(least, most));
        self.logs(count, |t| from_um + (to_um - from_um) * t.powf(power));
    }

    pub(crate) fn doubt(&mut self, count: usize) {
        let from = self.rows.len() - count;
        self.rows[from..].iter_mut().for_each(|row| row.is_doubtful = true);
    }

    /// A flight with a log of this gap, or one that was refused.
    pub(crate) fn flown(&mut self, gap_um: Option<f64>) {
        self.flight += self.every;
        self.rows.push(Observation {
            departure_us: self.flight * DAY_US / 2,
            installation: self.installation,
            flight: 0,
            flight_hours: Some(HOURS),
            tail_hours_end: Some(HOURS * self.flight as f64 + 5000.0 * f64::from(self.installation)),
            load_reversals: Some(120),
            gap_m: gap_um.map(|um| um * 1e-6),
            gap_se_m: gap_um.map(|_| self.stated * self.error_um * 1e-6),
            is_doubtful: false,
        });
    }

    pub(crate) fn now_us(&self) -> i64 {
        self.flight * DAY_US / 2
    }

    pub(crate) fn series(&self) -> Series {
        series(self.rows.clone()).with_maintenance(self.maintenance.clone())
    }

    /// The state that the last records of the present installation call for by the two plain rules, at least.
    pub(crate) fn due(&self) -> State {
        let since = self.maintenance.last().map_or(i64::MIN, |entry| entry.utc_us);
        let here = |row: &&Observation| row.installation == self.installation && row.departure_us > since;
        let last = self.rows.iter().rev().filter(here).filter_map(|row| Some((row.gap_m?, row.is_doubtful)));
        let above: Vec<bool> =
            last.take_while(|(gap_m, _)| *gap_m >= LIMIT_M).map(|(_, doubt)| !doubt).collect();
        match above.len() {
            0 => State::Normal,
            2.. if above.contains(&true) => State::Act,
            _ => State::Plan,
        }
    }
}

pub(crate) fn prior<'a>(fleet: impl IntoIterator<Item = &'a Drawn>) -> FleetPrior {
    let series: Vec<Series> = fleet.into_iter().map(Drawn::series).collect();
    FleetPrior::learn(&series, i64::MAX, LIMIT_M, None, &SerialExecutor)
}

pub(crate) fn settings() -> Settings {
    Settings::for_limit(LIMIT_M)
}
