//! Rows of the tables that `report --data` writes in addition to trends, quantities, changes, intervals and work requests.

use std::sync::Arc;

use jiff::Timestamp;
use serde::Serialize;

use crate::row;
use crate::row_schema::NoColumn;

row! {
    /// One flight of one unit, as on the unit's page.
    #[derive(Debug, Clone, PartialEq)]
    pub struct ReportFlightRow {
        /// Part number of the unit.
        pub part_number: Option<String>,
        /// Serial number of the unit.
        pub serial_number: String,
        /// The flight.
        pub flight: ReportFlight,
    }
}

row! {
    /// A flight. A report holds those of the whole fleet, so the flights of a unit share the names of its places.
    #[derive(Debug, Clone, Default, PartialEq)]
    pub struct ReportFlight {
        /// Tail number.
        pub tail_number: Arc<str>,
        /// Position on the aircraft.
        pub position: Arc<str>,
        /// Flight identifier.
        pub flight_id: Box<str>,
        /// Departure.
        pub departure_utc: Timestamp,
        /// The unit's hours after this flight.
        pub unit_hours: Option<f64>,
        /// Gap, m; null for a rejected flight.
        pub gap_m: Option<f64>,
        /// 5 % and 95 % bound of the gap, m.
        pub gap_p05_m: Option<f64>,
        pub gap_p95_m: Option<f64>,
        /// Gap by the published statistic (equations 29–31), m.
        pub gap_midrange_m: Option<f64>,
        /// Load reversals.
        pub load_reversals: Option<i64>,
        /// 5 % and 95 % quantile of the load, N.
        pub load_p05_n: Option<f64>,
        pub load_p95_n: Option<f64>,
        /// Rejection reason or quality flags.
        pub remarks: Box<str>,
        /// Largest gap along the stroke, m, where the gap varies.
        pub gap_largest_m: NoColumn<Option<f64>>,
        /// The gap along the stroke there: screw position, gap and standard error of each place, m.
        pub profile: NoColumn<Box<[[f64; 3]]>>,
        /// Page of its diagnostic plot, relative to the report folder, where one is drawn.
        pub plot_path: NoColumn<Option<Box<str>>>,
    }
}

row! {
    /// A point of the smoothed gap or of the forecast, as in the unit's chart.
    #[derive(Debug, Clone, PartialEq)]
    pub struct ReportGapRow {
        /// Part number of the unit.
        pub part_number: Option<String>,
        /// Serial number of the unit.
        pub serial_number: String,
        /// `level`: smoothed gap over past flights; `forecast`: from the date of the report on.
        pub kind: &'static str,
        /// Time of the point.
        pub at_utc: Timestamp,
        /// Gap, m: median.
        pub gap_m: f64,
        /// 5 % and 95 % bound, m.
        pub gap_p05_m: f64,
        pub gap_p95_m: f64,
    }
}

row! {
    /// One aircraft: its data.
    #[derive(Debug, Clone, Default, PartialEq, Serialize)]
    pub struct ReportTailRow {
        /// Tail number.
        pub tail_number: String,
        /// Flights flown until the date of the report; null without a flights table.
        pub flown: Option<i64>,
        /// Flights with records.
        pub flights: i64,
        /// Records.
        pub records: i64,
        /// Rejected records.
        pub refused: i64,
        /// Logs in error.
        pub logs_in_error: i64,
        /// Departure of the last flight with a record.
        pub last_departure_utc: Option<Timestamp>,
        /// Departure of the last flight with an estimate.
        pub last_estimate_utc: Option<Timestamp>,
    }
}

row! {
    /// A log that could not be read.
    #[derive(Debug, Clone, PartialEq, Serialize)]
    pub struct ReportLogErrorRow {
        /// Path of the log.
        pub log_path: String,
        /// Tail number, as far as the log or its path states it.
        pub tail_number: Option<String>,
        /// Error code.
        #[serde(rename = "code")]
        pub error_code: String,
        /// Time of the attempt.
        pub processed_utc: Timestamp,
    }
}

row! {
    /// An inspection, and the estimate to compare with it.
    #[derive(Debug, Clone, Default, PartialEq, Serialize)]
    pub struct ReportInspectionRow {
        /// Part number of the unit.
        pub part_number: Option<String>,
        /// Serial number of the unit.
        pub serial_number: String,
        /// Date of the inspection.
        pub date_utc: Timestamp,
        /// Measured play, m.
        pub play_m: f64,
        /// Median of the last estimates before the inspection, m.
        pub estimate_m: Option<f64>,
        /// Number of these estimates.
        pub estimates: i64,
        /// Instrument.
        pub instrument: Option<String>,
        /// Force at the surface, N.
        pub force_n: Option<f64>,
    }
}

impl ReportInspectionRow {
    /// Estimate less inspection, m.
    pub fn difference_m(&self) -> Option<f64> {
        self.estimate_m.map(|estimate_m| estimate_m - self.play_m)
    }
}

row! {
    /// A forecast that was made for the date of the report, and the gap found.
    #[derive(Debug, Clone, PartialEq, Serialize)]
    pub struct ReportPastForecastRow {
        /// Part number of the unit.
        pub part_number: Option<String>,
        /// Serial number of the unit.
        pub serial_number: String,
        /// Date of the forecast.
        pub as_of_utc: Timestamp,
        /// Days before the report.
        pub days_ago: i64,
        /// State at that date.
        pub state: Option<String>,
        /// Gap at that date, m.
        pub gap_m: f64,
        /// Forecast for the date of the report, m: median.
        #[serde(rename = "foreseen_m")]
        pub predicted_m: f64,
        /// 5 % and 95 % bound, m.
        #[serde(rename = "foreseen_low_m")]
        pub predicted_p05_m: f64,
        #[serde(rename = "foreseen_high_m")]
        pub predicted_p95_m: f64,
        /// Gap found on the date of the report, m.
        pub found_m: f64,
    }
}

impl ReportPastForecastRow {
    /// Whether the gap found lies within the interval of the forecast.
    pub fn held(&self) -> bool {
        (self.predicted_p05_m..=self.predicted_p95_m).contains(&self.found_m)
    }
}

row! {
    /// Expected removals of the fleet in a month.
    #[derive(Debug, Clone, PartialEq, Serialize)]
    pub struct ReportRemovalsRow {
        /// Month, `YYYY-MM`.
        pub month: String,
        /// Expected number of units that reach their limit.
        pub expected: f64,
        /// 5 % and 95 % bound of `expected`.
        pub low: f64,
        pub high: f64,
    }
}
