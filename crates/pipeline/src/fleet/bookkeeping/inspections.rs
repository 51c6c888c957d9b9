//! Inspections table: free play measured in the hangar.

use std::collections::BTreeSet;

use ingest::tables::{TableBatch, name, number, utc};
use jiff::Timestamp;
use job::Config;
use job::config::limits::PLAUSIBLE_LIMIT_M;
use records::time::days_between;
use records::{Installations, SerialNumber};

use crate::error::Error;
use crate::fleet::bookkeeping::dates_ahead::DateAhead;
use crate::fleet::flight_row::FlightRow;
use crate::fleet::histories::UnitKey;

/// Estimates compared with an inspection: at most this many, from at most this many days before it.
const MAX_COMPARED: usize = 10;
const MAX_COMPARED_DAYS: f64 = 30.0;
/// An inspection and the estimates before it contradict each other when they differ by this share of the larger and by this
/// length, m: joints beside the actuator and the force of the check account for less.
const CONTRADICTION: (f64, f64) = (0.3, 30e-6);

#[derive(Debug, Clone, PartialEq)]
pub(crate) struct InspectionRow {
    /// Part, where it is stated, and serial number that the unit has today.
    pub(crate) unit: UnitKey,
    pub(crate) date_utc: Timestamp,
    pub(crate) play_m: f64,
    pub(crate) instrument: Option<String>,
    pub(crate) force_n: Option<f64>,
}

impl InspectionRow {
    pub(crate) fn is_of(&self, unit: &UnitKey) -> bool {
        self.unit.1 == unit.1 && (self.unit.0.is_none() || self.unit.0 == unit.0)
    }

    pub(crate) fn date(&self) -> DateAhead {
        DateAhead::new(self.unit.0.clone(), self.unit.1.clone(), "date_utc", self.date_utc)
    }

    /// Median of the last estimates before it, m, and their number.
    pub(crate) fn estimate_before(&self, records: &[FlightRow]) -> (Option<f64>, usize) {
        let near = records
            .iter()
            .rev()
            .filter(|r| (0.0..=MAX_COMPARED_DAYS).contains(&days_between(r.departure_utc(), self.date_utc)));
        let gaps: Vec<f64> = near.filter_map(FlightRow::gap_m).take(MAX_COMPARED).collect();
        let count = gaps.len();
        (trend::quantity::median(gaps), count)
    }

    /// The measured play, in words, and the estimates before the inspection if they contradict it.
    pub(crate) fn statement(&self, records: &[FlightRow]) -> (String, bool) {
        let day = self.date_utc.strftime("%Y-%m-%d");
        let measured = format!("the hangar check of {day} measured {:.1} µm", self.play_m * 1e6);
        let contradicts = |gap_m: &f64| {
            let apart_m = (self.play_m - gap_m).abs();
            apart_m > CONTRADICTION.0 * self.play_m.max(*gap_m) && apart_m > CONTRADICTION.1
        };
        match self.estimate_before(records).0.filter(contradicts) {
            Some(gap_m) => {
                let read =
                    format!("the records before it read {:.1} µm: find out which is wrong", gap_m * 1e6);
                (format!("{measured} where {read}"), true)
            }
            None => (measured, false),
        }
    }
}

/// The latest of some inspections of a unit until a date, since its installation in its position then and after its last renewal.
pub(crate) fn latest<'i>(
    inspections: &'i [InspectionRow],
    unit: &UnitKey,
    installed_utc: Timestamp,
    renewed: Option<Timestamp>,
    as_of: Timestamp,
) -> Option<&'i InspectionRow> {
    let is_of_now = |inspection: &&InspectionRow| {
        inspection.is_of(unit)
            && (installed_utc..=as_of).contains(&inspection.date_utc)
            && renewed.is_none_or(|renewed| renewed < inspection.date_utc)
    };
    // Of several at one time, the largest play counts, whatever the order of the rows.
    let order = |a: &&InspectionRow, b: &&InspectionRow| {
        a.date_utc.cmp(&b.date_utc).then(a.play_m.total_cmp(&b.play_m))
    };
    inspections.iter().filter(is_of_now).max_by(order)
}

/// A note on inspections of some units after the date of assessments, which no state counts.
pub(crate) fn later_note(
    inspections: &[InspectionRow],
    units: &BTreeSet<UnitKey>,
    as_of: Timestamp,
    today: Timestamp,
) -> Option<String> {
    let is_later = |inspection: &&InspectionRow| {
        inspection.date_utc > as_of
            && inspection.date_utc <= today
            && units.iter().any(|unit| inspection.is_of(unit))
    };
    let count = inspections.iter().filter(is_later).count();
    (count > 0).then(|| {
        let (what, day) = (if count == 1 { "inspection is" } else { "inspections are" }, as_of.strftime("%Y-%m-%d"));
        format!("{count} {what} later than {day}, the date of all states, and not counted; set `trend.as_of = \"now\"`")
    })
}

/// A measured play, m.
fn plausible_play(text: &str) -> Result<f64, String> {
    let (least, most) = (0.0, PLAUSIBLE_LIMIT_M.1);
    let play_m = number(text)?;
    if (least..=most).contains(&play_m) {
        return Ok(play_m);
    }
    Err(format!("`{text}` is not between {least} and {most} m: 64 µm are 64e-6"))
}

/// The configured inspections; none without a table.
///
/// # Errors
/// When the table cannot be read, lacks a column, or holds a cell that cannot be right.
pub(crate) fn read(config: &Config, installations: &Installations) -> Result<Vec<InspectionRow>, Error> {
    let Some(file) = &config.document.logs.inspections else { return Ok(Vec::new()) };
    let table = TableBatch::read(&config.path(file))?;
    let serial = table.column(&["serial_number", "serial"])?;
    let date = table.column(&["date_utc", "date"])?;
    let play = table.column(&["play_m"])?;
    let [part, instrument, force] =
        ["part_number", "instrument", "force_n"].map(|column| table.find(&[column]));
    let text = |row, column: Option<usize>| column.and_then(|c| table.text(row, c)).map(str::to_owned);
    let check = |row| {
        let serial = table.required(row, serial, name::<SerialNumber>)?.to_string();
        let date_utc = table.required(row, date, utc)?;
        Ok(InspectionRow {
            unit: installations.unit_today((text(row, part), serial), date_utc),
            date_utc,
            play_m: table.required(row, play, plausible_play)?,
            instrument: text(row, instrument),
            force_n: table.optional(row, force, number)?,
        })
    };
    table.rows().map(check).collect()
}
