//! The columns of a gap record: the contract with everybody who opens the table from outside.

use arrow::array::RecordBatch;
use arrow::datatypes::SchemaRef;
use records::{
    Flight, FlightId, GapEstimate, GapRecord, PartNumber, Position, Provenance, SerialNumber, Status,
    TailNumber,
};

use crate::error::Error;
use crate::rows::row_schema::{self, CellReader, Column, Getter, RowSchema};

/// The columns of `gaps`, in order: text as `Utf8`, times as microseconds UTC, flags as a list of text.
pub fn schema() -> SchemaRef {
    row_schema::schema::<GapRecord>()
}

/// Records as columns. Times are cut to whole microseconds.
///
/// # Errors
/// [`Error::Arrow`] when there are more rows than a batch can hold.
pub fn to_batch(records: &[GapRecord]) -> Result<RecordBatch, Error> {
    row_schema::to_batch(records)
}

/// Columns as records; columns of other names are passed over.
///
/// # Errors
/// [`Error::Column`] when one is missing or of another type; [`Error::Value`] when a time is out of
/// range, a name is empty or a status unknown.
pub fn from_batch(batch: &RecordBatch) -> Result<Vec<GapRecord>, Error> {
    row_schema::from_batch(batch)
}

fn status(text: &str) -> Result<Status, String> {
    [Status::Estimated, Status::Refused]
        .into_iter()
        .find(|status| status.as_str() == text)
        .ok_or_else(|| format!("`{text}` is no status"))
}

impl RowSchema for GapRecord {
    const COLUMNS: &'static [Column<Self>] = &[
        Column::required("tail_number", Getter::Text(|r| Some(r.flight.tail_number.as_str()))),
        Column::required("position", Getter::Text(|r| Some(r.position.as_str()))),
        Column::required("part_number", Getter::Text(|r| Some(r.part_number.as_str()))),
        Column::required("serial_number", Getter::Text(|r| Some(r.serial_number.as_str()))),
        Column::required("flight_id", Getter::Text(|r| Some(r.flight.flight_id.as_str()))),
        Column::required("departure_utc", Getter::Time(|r| Some(r.flight.departure_utc))),
        Column::nullable("flight_hours", Getter::Number(|r| r.flight.flight_hours)),
        Column::nullable("tail_hours_end", Getter::Number(|r| r.flight.tail_hours_end)),
        Column::nullable("unit_hours", Getter::Number(|r| r.unit_hours)),
        Column::required("status", Getter::Text(|r| Some(r.estimate.status.as_str()))),
        Column::nullable("reason", Getter::Text(|r| r.estimate.reason.as_deref())),
        Column::required("flags", Getter::Texts(|r| &r.estimate.flags)),
        Column::nullable("gap_m", Getter::Number(|r| r.estimate.gap_m)),
        Column::nullable("gap_se_m", Getter::Number(|r| r.estimate.gap_se_m)),
        Column::nullable("gap_p05_m", Getter::Number(|r| r.estimate.gap_p05_m)),
        Column::nullable("gap_p95_m", Getter::Number(|r| r.estimate.gap_p95_m)),
        Column::nullable("gap_midrange_m", Getter::Number(|r| r.estimate.gap_midrange_m)),
        Column::nullable("stiffness_n_per_m", Getter::Number(|r| r.estimate.stiffness_n_per_m)),
        Column::nullable("stiffness_se_n_per_m", Getter::Number(|r| r.estimate.stiffness_se_n_per_m)),
        Column::nullable("skew_s", Getter::Number(|r| r.estimate.skew_s)),
        Column::nullable("loop_width_m", Getter::Number(|r| r.estimate.loop_width_m)),
        Column::nullable("lost_motion_m", Getter::Number(|r| r.estimate.lost_motion_m)),
        Column::nullable("reference_radius_m", Getter::Number(|r| r.estimate.reference_radius_m)),
        Column::required("load_reversals", Getter::Count(|r| Some(r.estimate.load_reversals))),
        Column::required("samples", Getter::Count(|r| Some(r.estimate.samples))),
        Column::required("samples_upper", Getter::Count(|r| Some(r.estimate.samples_upper))),
        Column::required("samples_lower", Getter::Count(|r| Some(r.estimate.samples_lower))),
        Column::nullable("load_p05_n", Getter::Number(|r| r.estimate.load_p05_n)),
        Column::nullable("load_p95_n", Getter::Number(|r| r.estimate.load_p95_n)),
        Column::nullable("temperature_c", Getter::Number(|r| r.estimate.temperature_c)),
        Column::nullable("nis", Getter::Number(|r| r.estimate.nis)),
        Column::required("log_path", Getter::Text(|r| Some(&r.provenance.log_path))),
        Column::required("log_digest", Getter::Text(|r| Some(&r.provenance.log_digest))),
        Column::required("config_digest", Getter::Text(|r| Some(&r.provenance.config_digest))),
        Column::required("program_version", Getter::Text(|r| Some(&r.provenance.program_version))),
        Column::required("run_id", Getter::Text(|r| Some(&r.provenance.run_id))),
        Column::required("processed_utc", Getter::Time(|r| Some(r.provenance.processed_utc))),
        // What came later stands behind, so that the contract's columns keep their order.
        Column::nullable("skew_se_s", Getter::Number(|r| r.estimate.skew_se_s)),
        Column::nullable("loop_width_se_m", Getter::Number(|r| r.estimate.loop_width_se_m)),
        Column::nullable("lost_motion_se_m", Getter::Number(|r| r.estimate.lost_motion_se_m)),
        Column::nullable("load_zero_n", Getter::Number(|r| r.estimate.load_zero_n)),
        Column::nullable("load_zero_se_n", Getter::Number(|r| r.estimate.load_zero_se_n)),
        Column::nullable("load_delay_s", Getter::Number(|r| r.estimate.load_delay_s)),
        Column::nullable("load_delay_se_s", Getter::Number(|r| r.estimate.load_delay_se_s)),
        Column::nullable("friction_n", Getter::Number(|r| r.estimate.friction_n)),
        Column::nullable("gap_midrange_fitted_m", Getter::Number(|r| r.estimate.gap_midrange_fitted_m)),
    ];

    fn from_cells(cells: &mut CellReader<'_>) -> Result<Self, Error> {
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
        let estimate = GapEstimate {
            skew_se_s,
            loop_width_se_m,
            lost_motion_se_m,
            load_zero_n: cells.number(),
            load_zero_se_n: cells.number(),
            load_delay_s: cells.number(),
            load_delay_se_s: cells.number(),
            friction_n: cells.number(),
            gap_midrange_fitted_m: cells.number(),
            ..estimate
        };
        Ok(Self { flight, position, part_number, serial_number, unit_hours, estimate, provenance })
    }
}

fn estimate(cells: &mut CellReader<'_>) -> Result<GapEstimate, Error> {
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
        loop_width_m: cells.number(),
        lost_motion_m: cells.number(),
        reference_radius_m: cells.number(),
        load_reversals: cells.count()?,
        samples: cells.count()?,
        samples_upper: cells.count()?,
        samples_lower: cells.count()?,
        load_p05_n: cells.number(),
        load_p95_n: cells.number(),
        temperature_c: cells.number(),
        nis: cells.number(),
        ..GapEstimate::refused("")
    })
}

fn provenance(cells: &mut CellReader<'_>) -> Result<Provenance, Error> {
    Ok(Provenance {
        log_path: cells.owned()?,
        log_digest: cells.owned()?,
        config_digest: cells.owned()?,
        program_version: cells.owned()?,
        run_id: cells.owned()?,
        processed_utc: cells.time()?,
    })
}
