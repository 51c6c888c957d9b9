//! Merge of the history builders of several workers, unit by unit.

use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::Arc;

use rayon::prelude::*;

use crate::error::Error;
use crate::fleet::builder::{HistoryBuilder, RowBlock, StagedRow, UnitEntry};
use crate::fleet::extras::ExtrasArena;
use crate::fleet::flight_row::FlightRow;
use crate::fleet::histories::{Histories, History, Positions, UnitKey};
use crate::fleet::settings_counts::SettingsCounts;

/// Shares of a table that a worker is given: the slower one leaves some of its own to the others.
const SHARES: usize = 4;

/// Histories of the rows of all builders, as if one builder had received them in this order.
///
/// Each worker takes the rows of its own units, so no worker waits for another, and a block is freed
/// after its last use.
pub(crate) fn merge(gathered: Vec<HistoryBuilder>, is_booked: bool) -> Histories {
    let mut capacities = capacities(&gathered);
    let targets: Vec<TargetMap> =
        gathered.iter().map(|one| TargetMap::of(&one.units, &mut capacities)).collect();
    let mut partitions: Vec<Partition<'_>> = sections(capacities).into_iter().map(Partition::of).collect();
    for (one, targets) in gathered.into_iter().zip(&targets) {
        for block in one.blocks.into_iter().map(Arc::new) {
            let takers = partitions.iter_mut().filter(|partition| targets.are_in(&partition.ranks));
            takers.for_each(|partition| partition.blocks.push((targets, Arc::clone(&block))));
        }
    }
    let full: Vec<Vec<_>> = partitions.into_par_iter().map(Partition::histories).collect();
    Histories::new(full.into_iter().flatten().collect(), is_booked)
}

/// What all rows of a unit will need.
#[derive(Default)]
struct UnitCapacity {
    /// Which of all units it is, by name.
    rank: u32,
    places: Positions,
    rows: usize,
    bytes: usize,
    settings: SettingsCounts,
}

fn capacities(gathered: &[HistoryBuilder]) -> BTreeMap<UnitKey, UnitCapacity> {
    let mut capacities: BTreeMap<UnitKey, UnitCapacity> = BTreeMap::new();
    for unit in gathered.iter().flat_map(|one| &one.units) {
        let capacity = capacities.entry(unit.name.clone()).or_default();
        capacity.rows += unit.rows;
        capacity.bytes += unit.bytes;
        capacity.settings.add_all(&unit.settings);
    }
    for (rank, capacity) in capacities.values_mut().enumerate() {
        capacity.rank = rank as u32;
    }
    capacities
}

/// Where the rows of each unit go that one gathering knows.
struct TargetMap(Vec<Target>);

/// Which of all units it is, and the numbers that its places have there.
struct Target {
    rank: u32,
    places: Vec<u32>,
}

impl TargetMap {
    fn of(units: &[UnitEntry], capacities: &mut BTreeMap<UnitKey, UnitCapacity>) -> Self {
        let target = |unit: &UnitEntry| {
            // Each unit's target was made from these names.
            let capacity = capacities.entry(unit.name.clone()).or_default();
            Target { rank: capacity.rank, places: capacity.places.numbers(&unit.places) }
        };
        Self(units.iter().map(target).collect())
    }

    /// Whether any of them is one of those units.
    fn are_in(&self, ranks: &Range<u32>) -> bool {
        self.0.iter().any(|target| ranks.contains(&target.rank))
    }
}

/// One section per worker, with about equal numbers of rows; the units of one section follow each other by name.
fn sections(capacities: BTreeMap<UnitKey, UnitCapacity>) -> Vec<Vec<(UnitKey, UnitCapacity)>> {
    let rows: usize = capacities.values().map(|capacity| capacity.rows).sum();
    let most = rows.div_ceil(rayon::current_num_threads());
    let (mut sections, mut some, mut held) = (Vec::new(), Vec::new(), 0);
    for capacity in capacities {
        held += capacity.1.rows;
        some.push(capacity);
        if held >= most {
            sections.push(std::mem::take(&mut some));
            held = 0;
        }
    }
    sections.push(some);
    sections
}

/// A section, and the blocks in which rows of it may be.
struct Partition<'a> {
    ranks: Range<u32>,
    section: Vec<(UnitKey, UnitCapacity)>,
    blocks: Vec<(&'a TargetMap, Arc<RowBlock>)>,
}

impl Partition<'_> {
    fn of(section: Vec<(UnitKey, UnitCapacity)>) -> Self {
        let first = section.first().map_or(0, |(_, capacity)| capacity.rank);
        Self { ranks: first..first + section.len() as u32, section, blocks: Vec::new() }
    }

    fn histories(self) -> Vec<(UnitKey, History)> {
        let mut arena = ExtrasArena::with_capacity(self.section.iter().map(|(_, capacity)| capacity.rows));
        let history = |(name, capacity): (_, UnitCapacity)| {
            let UnitCapacity { places, rows, bytes, settings, .. } = capacity;
            (name, History::with_capacity(places, rows, bytes, settings))
        };
        let mut units: Vec<(UnitKey, History)> = self.section.into_iter().map(history).collect();
        for (targets, block) in self.blocks {
            each_row(&block, targets, |target, put, name| {
                let unit = target.rank.wrapping_sub(self.ranks.start) as usize;
                let Some((_, history)) = units.get_mut(unit) else { return };
                let row = history.flights().len() as u32;
                let place = target.places[put.place as usize];
                history.put(FlightRow::new(put.departure_us, put.gap_m, place, row), name);
                arena.put(unit, row, put.extras);
            });
        }
        let full = units.into_iter().zip(arena.of_units());
        full.map(|((name, history), extras)| (name, history.finish(extras))).collect()
    }
}

/// Hands over the rows of a block in order, each with where it goes and its flight's name.
fn each_row(block: &RowBlock, targets: &TargetMap, mut take: impl FnMut(&Target, &StagedRow, &str)) {
    let mut begin = 0;
    for put in &block.rows {
        let end = put.name_end as usize;
        take(&targets.0[put.unit as usize], put, &block.names[begin..end]);
        begin = end;
    }
}

impl HistoryBuilder {
    /// The histories of a table made elsewhere.
    pub fn into_external(self) -> Histories {
        merge(vec![self], false)
    }

    /// The histories of the store, whose flights belong to rows of the installations table.
    pub fn into_store(self) -> Histories {
        merge(vec![self], true)
    }
}

/// The histories of a table in several parts, added by all workers in shares: the same result as if one worker had
/// added all parts in order.
///
/// # Errors
/// The first of the parts' errors.
pub(crate) fn of_parts(
    parts: usize,
    is_booked: bool,
    put: impl Fn(&mut HistoryBuilder, Range<usize>) -> Result<(), Error> + Sync,
) -> Result<Histories, Error> {
    let share = parts.div_ceil(SHARES * rayon::current_num_threads()).max(1);
    let shares: Vec<usize> = (0..parts).step_by(share).collect();
    let gathered = |first: &usize| {
        let mut gathering = HistoryBuilder::default();
        put(&mut gathering, *first..parts.min(first + share))?;
        Ok(gathering)
    };
    let gathered: Vec<Result<HistoryBuilder, Error>> = shares.par_iter().map(gathered).collect();
    Ok(merge(gathered.into_iter().collect::<Result<_, _>>()?, is_booked))
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use arrow::array::{ArrayRef, Int64Array, StringArray, TimestampMicrosecondArray};
    use arrow::compute::cast;
    use arrow::datatypes::DataType;

    use super::*;
    use crate::fleet::flight_row::FlightInput;
    use crate::fleet::flight_row::FlightRow;
    use crate::fleet::histories::History;
    use crate::fleet::row_keys::RowKey;
    use arrow::array::{Float64Array, RecordBatch};
    use ingest::tables::TableBatch;
    use jiff::Timestamp;

    /// Pseudo-random whole numbers below a bound.
    fn chances() -> impl FnMut(u64) -> u64 {
        let mut state = 7_u64;
        move |bound| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 33) % bound
        }
    }

    /// A row's texts (part, serial number, tail, position, flight), its departure and its gap.
    type Cells = ([Option<String>; 5], i64, Option<f64>);

    /// Serial numbers of two parts, units that move about, names with a blank, and flights that arrive late.
    fn rows() -> Vec<Cells> {
        let mut chance = chances();
        let mut row = |at: i64| {
            let mut text = |name: &str, count| (chance(9) > 0).then(|| format!("{name}{}", chance(count)));
            let (part, tail, position, flight) =
                (text("P", 2), text("T", 3), text("place ", 2), text(" F", 40));
            let serial = Some(format!("S{}", chance(4)));
            let departure_us = 1_000_000 * (at - chance(20) as i64);
            ([part, serial, tail, position, flight], departure_us, (chance(5) > 0).then(|| chance(90) as f64))
        };
        (0..600).map(&mut row).collect()
    }

    fn batch(rows: &[Cells], texts: &DataType) -> RecordBatch {
        let names = ["part_number", "serial_number", "tail_number", "position", "flight_id"];
        let text = |column: usize| {
            let plain: StringArray = rows.iter().map(|(texts, ..)| texts[column].as_deref()).collect();
            cast(&plain, texts).unwrap()
        };
        let departures: TimestampMicrosecondArray = rows.iter().map(|row| Some(row.1)).collect();
        let gaps_m: Float64Array = rows.iter().map(|row| row.2).collect();
        let reversals: Int64Array = rows.iter().map(|row| row.2.map(|gap| gap as i64)).collect();
        let numbers: [(&str, ArrayRef); 3] = [
            ("departure_utc", Arc::new(departures)),
            ("gap_m", Arc::new(gaps_m)),
            ("load_reversals", Arc::new(reversals)),
        ];
        let texts = names.into_iter().enumerate().map(|(column, name)| (name, text(column)));
        RecordBatch::try_from_iter(texts.chain(numbers)).unwrap()
    }

    /// Each row by itself, as the tables mean it.
    fn one_by_one(rows: &[Cells]) -> Histories {
        let mut gathering = HistoryBuilder::default();
        for ([part, serial, tail, position, flight], departure_us, gap_m) in rows {
            let who = RowKey {
                part_number: part.as_deref(),
                serial_number: serial.as_deref().unwrap(),
                tail_number: tail.as_deref(),
                position: position.as_deref(),
            };
            let row = FlightInput {
                flight_id: flight.as_deref().map(str::trim),
                departure_utc: Timestamp::from_microsecond(*departure_us).unwrap(),
                flight_hours: None,
                tail_hours_end: None,
                load_reversals: gap_m.map(|gap| gap as u64),
                gap_m: *gap_m,
                gap_se_m: None,
                disagreeing_gap_m: None,
            };
            gathering.put(who, &row);
        }
        gathering.into_store()
    }

    #[test]
    fn rows_of_the_store_and_of_a_foreign_table_are_what_each_of_them_is_by_itself() {
        let rows = rows();
        let coded = DataType::Dictionary(Box::new(DataType::Int32), Box::new(DataType::Utf8));
        let (mut stored, mut plain) = (HistoryBuilder::default(), HistoryBuilder::default());
        // In other parts names have other codes.
        for some in rows.chunks(230) {
            stored.add_store_batch(batch(some, &coded)).unwrap();
            plain.add(&TableBatch::new("table".as_ref(), batch(some, &DataType::Utf8), 0)).unwrap();
        }
        let expected = row_texts(&one_by_one(&rows));
        assert_eq!(row_texts(&stored.into_store()), expected);
        assert_eq!(row_texts(&plain.into_store()), expected);
    }

    /// All that is known of all units.
    fn row_texts(histories: &Histories) -> Vec<String> {
        let of_unit = |(name, history): (&UnitKey, &History)| {
            let flight = |f: &FlightRow| {
                format!("{f:?} {:?} {:?} {:?}", history.place(f), history.flight_id(f), history.extras(f))
            };
            format!("{name:?} {:?}", history.flights().iter().map(flight).collect::<Vec<_>>())
        };
        histories.iter().map(of_unit).collect()
    }

    /// The order of parts decides, not that of the workers, of whom there may be more than parts or units.
    #[test]
    fn any_number_of_workers_brings_together_what_one_does() {
        let rows = rows();
        let expected = row_texts(&one_by_one(&rows));
        let coded = DataType::Dictionary(Box::new(DataType::Int32), Box::new(DataType::Utf8));
        for (rows_of_part, workers) in [(600, 1), (600, 7), (90, 2), (41, 3), (7, 5)] {
            let parts: Vec<RecordBatch> = rows.chunks(rows_of_part).map(|some| batch(some, &coded)).collect();
            let put = |gathering: &mut HistoryBuilder, some: Range<usize>| {
                let mut some = parts[some].iter().cloned();
                some.try_for_each(|batch| gathering.add_store_batch(batch)).unwrap();
                Ok(())
            };
            let pool = rayon::ThreadPoolBuilder::new().num_threads(workers).build().unwrap();
            let found = pool.install(|| of_parts(parts.len(), true, put)).unwrap();
            assert!(row_texts(&found) == expected, "{rows_of_part} rows a part, {workers} workers");
        }
        assert_eq!(of_parts(0, true, |_, _| Ok(())).unwrap().names().count(), 0);
    }

    /// Independent of the order of the workers, the first error of the table is returned.
    #[test]
    fn of_several_errors_the_first_is_returned() {
        let refuse = |_: &mut HistoryBuilder, some: Range<usize>| match some.start {
            0 => Ok(()),
            first => Err(Error::refused(
                TableBatch::new(
                    "t".as_ref(),
                    RecordBatch::new_empty(Arc::new(arrow::datatypes::Schema::empty())),
                    first,
                )
                .error(0, None, "bad".into())
                .diagnostic(),
            )),
        };
        let pool = rayon::ThreadPoolBuilder::new().num_threads(3).build().unwrap();
        let error = pool.install(|| of_parts(24, true, refuse)).unwrap_err();
        assert!(format!("{error:?}").contains("row: Some(3)"), "{error:?}");
    }

    #[test]
    fn a_row_without_a_serial_number_is_reported_by_its_number() {
        let mut rows = rows();
        rows[17].0[1] = Some("  ".into());
        let coded = DataType::Dictionary(Box::new(DataType::Int32), Box::new(DataType::Utf8));
        let error = HistoryBuilder::default().add_store_batch(batch(&rows, &coded)).unwrap_err();
        assert_eq!(error.diagnostic().location().unwrap(), "column `serial_number`, row 18");
    }
}
