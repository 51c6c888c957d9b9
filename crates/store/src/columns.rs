//! The columns of a gap record: the contract with everybody who opens the table from outside.

use arrow::array::RecordBatch;
use arrow::datatypes::SchemaRef;
use records::{
    Flight, FlightId, GapEstimate, GapRecord, PartNumber, Position, Provenance, SerialNumber, Status,
    TailNumber,
};

use crate::error::Error;
use crate::tabled::{self, Cells, Column, Get, Tabled};

/// The columns of `gaps`, in order: text as `Utf8`, times as microseconds UTC, flags as a list of text.
pub fn schema() -> SchemaRef {
    tabled::schema::<GapRecord>()
}

/// Records as columns. Times are cut to whole microseconds.
///
/// # Errors
/// [`Error::Arrow`] when there are more rows than a batch can hold.
pub fn to_batch(records: &[GapRecord]) -> Result<RecordBatch, Error> {
    tabled::to_batch(records)
}

/// Columns as records; columns of other names are passed over.
///
/// # Errors
/// [`Error::Column`] when one is missing or of another type; [`Error::Value`] when a time is out of
/// range, a name is empty or a status unknown.
pub fn from_batch(batch: &RecordBatch) -> Result<Vec<GapRecord>, Error> {
    tabled::from_batch(batch)
}

fn status(text: &str) -> Result<Status, String> {
    [Status::Estimated, Status::Refused]
        .into_iter()
        .find(|status| status.as_str() == text)
        .ok_or_else(|| format!("`{text}` is no status"))
}

impl Tabled for GapRecord {
    const COLUMNS: &'static [Column<Self>] = &[
        Column::must("tail_number", Get::Text(|r| Some(r.flight.tail_number.as_str()))),
        Column::must("position", Get::Text(|r| Some(r.position.as_str()))),
        Column::must("part_number", Get::Text(|r| Some(r.part_number.as_str()))),
        Column::must("serial_number", Get::Text(|r| Some(r.serial_number.as_str()))),
        Column::must("flight_id", Get::Text(|r| Some(r.flight.flight_id.as_str()))),
        Column::must("departure_utc", Get::Time(|r| Some(r.flight.departure_utc))),
        Column::may("flight_hours", Get::Number(|r| r.flight.flight_hours)),
        Column::may("tail_hours_end", Get::Number(|r| r.flight.tail_hours_end)),
        Column::may("unit_hours", Get::Number(|r| r.unit_hours)),
        Column::must("status", Get::Text(|r| Some(r.estimate.status.as_str()))),
        Column::may("reason", Get::Text(|r| r.estimate.reason.as_deref())),
        Column::must("flags", Get::Texts(|r| &r.estimate.flags)),
        Column::may("gap_m", Get::Number(|r| r.estimate.gap_m)),
        Column::may("gap_se_m", Get::Number(|r| r.estimate.gap_se_m)),
        Column::may("gap_p05_m", Get::Number(|r| r.estimate.gap_p05_m)),
        Column::may("gap_p95_m", Get::Number(|r| r.estimate.gap_p95_m)),
        Column::may("gap_midrange_m", Get::Number(|r| r.estimate.gap_midrange_m)),
        Column::may("stiffness_n_per_m", Get::Number(|r| r.estimate.stiffness_n_per_m)),
        Column::may("stiffness_se_n_per_m", Get::Number(|r| r.estimate.stiffness_se_n_per_m)),
        Column::may("skew_s", Get::Number(|r| r.estimate.skew_s)),
        Column::may("loop_width_m", Get::Number(|r| r.estimate.loop_width_m)),
        Column::may("lost_motion_m", Get::Number(|r| r.estimate.lost_motion_m)),
        Column::may("reference_radius_m", Get::Number(|r| r.estimate.reference_radius_m)),
        Column::must("load_reversals", Get::Count(|r| Some(r.estimate.load_reversals))),
        Column::must("samples", Get::Count(|r| Some(r.estimate.samples))),
        Column::must("samples_upper", Get::Count(|r| Some(r.estimate.samples_upper))),
        Column::must("samples_lower", Get::Count(|r| Some(r.estimate.samples_lower))),
        Column::may("load_p05_n", Get::Number(|r| r.estimate.load_p05_n)),
        Column::may("load_p95_n", Get::Number(|r| r.estimate.load_p95_n)),
        Column::may("temperature_c", Get::Number(|r| r.estimate.temperature_c)),
        Column::may("nis", Get::Number(|r| r.estimate.nis)),
        Column::must("log_path", Get::Text(|r| Some(&r.provenance.log_path))),
        Column::must("log_digest", Get::Text(|r| Some(&r.provenance.log_digest))),
        Column::must("config_digest", Get::Text(|r| Some(&r.provenance.config_digest))),
        Column::must("program_version", Get::Text(|r| Some(&r.provenance.program_version))),
        Column::must("run_id", Get::Text(|r| Some(&r.provenance.run_id))),
        Column::must("processed_utc", Get::Time(|r| Some(r.provenance.processed_utc))),
        // What came later stands behind, so that the contract's columns keep their order.
        Column::may("skew_se_s", Get::Number(|r| r.estimate.skew_se_s)),
        Column::may("loop_width_se_m", Get::Number(|r| r.estimate.loop_width_se_m)),
        Column::may("lost_motion_se_m", Get::Number(|r| r.estimate.lost_motion_se_m)),
    ];

    fn from_cells(cells: &mut Cells<'_>) -> Result<Self, Error> {
        let tail_number = cells.parse(TailNumber::new)?;
        let position = cells.parse(Position::new)?;
        let part_number = cells.parse(PartNumber::new)?;
        let serial_number = cells.parse(SerialNumber::new)?;
        let flight = Flight {
            tail_number,
            flight_id: cells.parse(FlightId::new)?,
            departure_utc: cells.time()?,
            flight_hours: cells.number(),
            tail_hours_end: cells.number(),
        };
        let unit_hours = cells.number();
        let (estimate, provenance) = (estimate(cells)?, provenance(cells)?);
        let [skew_se_s, loop_width_se_m, lost_motion_se_m] = [cells.number(), cells.number(), cells.number()];
        let estimate = GapEstimate { skew_se_s, loop_width_se_m, lost_motion_se_m, ..estimate };
        Ok(Self { flight, position, part_number, serial_number, unit_hours, estimate, provenance })
    }
}

fn estimate(cells: &mut Cells<'_>) -> Result<GapEstimate, Error> {
    Ok(GapEstimate {
        status: cells.parse(status)?,
        reason: cells.owned_or_none(),
        flags: cells.texts(),
        gap_m: cells.number(),
        gap_se_m: cells.number(),
        gap_p05_m: cells.number(),
        gap_p95_m: cells.number(),
        gap_midrange_m: cells.number(),
        stiffness_n_per_m: cells.number(),
        stiffness_se_n_per_m: cells.number(),
        skew_s: cells.number(),
        skew_se_s: None,
        loop_width_m: cells.number(),
        loop_width_se_m: None,
        lost_motion_m: cells.number(),
        lost_motion_se_m: None,
        reference_radius_m: cells.number(),
        load_reversals: cells.count()?,
        samples: cells.count()?,
        samples_upper: cells.count()?,
        samples_lower: cells.count()?,
        load_p05_n: cells.number(),
        load_p95_n: cells.number(),
        temperature_c: cells.number(),
        nis: cells.number(),
    })
}

fn provenance(cells: &mut Cells<'_>) -> Result<Provenance, Error> {
    Ok(Provenance {
        log_path: cells.owned()?,
        log_digest: cells.owned()?,
        config_digest: cells.owned()?,
        program_version: cells.owned()?,
        run_id: cells.owned()?,
        processed_utc: cells.time()?,
    })
}
