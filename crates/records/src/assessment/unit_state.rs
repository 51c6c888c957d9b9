//! Unit state: the result of the last run for a unit, so that the next run can show what changed and why.

use jiff::Timestamp;

use crate::assessment::trend_row::TrendRow;
use crate::stored_row;

stored_row! {
    /// State of a unit after a run. A row is written when one of its columns before `as_of_utc` changed.
    #[derive(Debug, Clone, PartialEq)]
    pub struct UnitState {
        /// Part number of the unit.
        pub part_number: Option<String>,
        /// Serial number of the unit. Of the rows of a part and serial number, the newest counts.
        pub serial_number: String,
        /// The aircraft.
        pub tail_number: Option<String>,
        /// Position on the aircraft.
        pub position: Option<String>,
        /// `normal`, `watch`, `unassessed`, `plan` or `act`; none of a removed unit, or one that has no flight.
        pub state: Option<String>,
        /// The limit, m.
        pub limit_m: Option<f64>,
        /// blake3 of the settings of the estimate.
        pub settings_digest: Option<String>,
        /// Change points of the gap: kind and departure of the first flight after it.
        pub change_points: Vec<String>,
        /// Date of the assessment; later data are ignored.
        pub as_of_utc: Timestamp,
        /// The run.
        pub run_id: String,
    }
}

impl UnitState {
    /// The state of an assessed unit.
    pub fn of(row: &TrendRow, settings_digest: Option<String>, run_id: &str) -> Self {
        let change_points = row.change_points.iter().map(|c| format!("{} {}", c.kind, c.departure_utc));
        Self {
            part_number: row.part_number.clone(),
            serial_number: row.serial_number.clone(),
            tail_number: row.tail_number.clone(),
            position: row.position.clone(),
            state: row.state.map(str::to_owned),
            limit_m: row.limit_m,
            settings_digest,
            change_points: change_points.collect(),
            as_of_utc: row.as_of_utc,
            run_id: run_id.to_owned(),
        }
    }

    /// Kind and first departure of each change point.
    pub fn events(&self) -> impl Iterator<Item = (&str, Timestamp)> {
        self.change_points.iter().filter_map(|text| {
            let (kind, at) = text.split_once(' ')?;
            Some((kind, at.parse().ok()?))
        })
    }

    /// Whether two rows are equal apart from date and run.
    pub fn is_same(&self, other: &Self) -> bool {
        let other = Self { as_of_utc: self.as_of_utc, run_id: self.run_id.clone(), ..other.clone() };
        *self == other
    }
}
