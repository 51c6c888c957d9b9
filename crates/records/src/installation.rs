//! Installations table: which unit was installed in which position of which tail, and when.
//!
//! Logs identify actuators by position, not by serial number; this table maps one to the other. The whole table
//! is validated first: a unit cannot be in two positions at once, nor two units in one position.

use std::cmp::Ordering;
use std::collections::BTreeMap;

use jiff::{SignedDuration, Timestamp};
use serde::{Deserialize, Serialize};

use crate::ids::{PartNumber, Position, SerialNumber, TailNumber};

/// Installation of one unit in one position during `[installed_utc, removed_utc)`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[expect(missing_docs, reason = "each field is named for what it holds")]
pub struct Installation {
    pub tail_number: TailNumber,
    pub position: Position,
    pub part_number: PartNumber,
    pub serial_number: SerialNumber,
    pub installed_utc: Timestamp,
    /// First instant after the installation; `None` while the unit is still installed.
    pub removed_utc: Option<Timestamp>,
    pub unit_hours_at_install: Option<f64>,
    pub tail_hours_at_install: Option<f64>,
    /// Part and serial number of the unit today, where it was modified or re-identified since this installation.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub today: Option<(PartNumber, SerialNumber)>,
}

/// A unit's former part and serial number, and those that it has today.
#[derive(Debug, Clone, PartialEq, Eq)]
#[expect(missing_docs, reason = "each field is named for what it holds")]
pub struct Alias {
    /// Former part number; `None` for any.
    pub former_part_number: Option<PartNumber>,
    pub former_serial_number: SerialNumber,
    /// Part number today; `None` where it is unchanged.
    pub part_number: Option<PartNumber>,
    pub serial_number: SerialNumber,
}

impl Alias {
    /// Whether a unit with this serial number, and this part number where it is known, is the former one.
    fn is_of(&self, part: Option<&str>, serial: &str) -> bool {
        let is_part = |(former, part): (&PartNumber, &str)| former.as_str() == part;
        self.former_serial_number.as_str() == serial
            && self.former_part_number.as_ref().zip(part).is_none_or(is_part)
    }
}

impl Installation {
    /// Age of the unit when the tail has `tail_hours` total hours, if the installation records both hours.
    pub fn unit_hours(&self, tail_hours: Option<f64>) -> Option<f64> {
        Some(self.unit_hours_at_install? + (tail_hours? - self.tail_hours_at_install?).max(0.0))
    }

    /// Part and serial number by which the unit is followed: those of today.
    pub fn unit(&self) -> (&PartNumber, &SerialNumber) {
        self.today.as_ref().map_or((&self.part_number, &self.serial_number), |(part, serial)| (part, serial))
    }

    /// Whether the unit was installed at that instant.
    pub fn covers(&self, at: Timestamp) -> bool {
        self.installed_utc <= at && self.removed_utc.is_none_or(|removed| at < removed)
    }
}

/// A contradiction in the installations table. Its text counts rows from 1, without the header.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{0}")]
pub struct Error(String);

/// The validated installations table: rows by tail, position and date, and their numbers by unit; found by bisection.
#[derive(Debug, Clone, Default)]
pub struct Installations {
    rows: Vec<Installation>,
    /// Numbers of the rows by the serial number that the unit has today, the earliest installation first.
    by_serial: Vec<usize>,
    /// Numbers of the rows whose unit has other numbers today, by the serial number of the row.
    former: BTreeMap<String, Vec<usize>>,
    aliases: Vec<Alias>,
}

impl Installations {
    /// Builds the table from rows in any order; an error has every contradiction between them, in row order.
    ///
    /// # Errors
    /// Every contradiction, in row order: see [`Error`].
    pub fn new(mut rows: Vec<Installation>) -> Result<Self, Vec<Error>> {
        let reversed = |(row, Installation { serial_number, installed_utc, removed_utc, .. }): (
            usize,
            &_,
        )| {
            let removed = removed_utc.filter(|removed| removed < installed_utc)?;
            Some(Error(format!(
                "row {row}: {serial_number} is removed at {removed} before it is installed at {installed_utc}"
            )))
        };
        let mut errors: Vec<Error> = (1..).zip(&rows).filter_map(reversed).collect();
        errors.extend(clashes(&rows, place).into_iter().map(|(row, other)| {
            let Installation { tail_number, position, installed_utc, .. } = &rows[other - 1];
            Error(format!(
                "rows {row} and {other}: {tail_number} {position} holds two units at {installed_utc}; give the earlier \
                 one its `removed_utc`"
            ))
        }));
        let as_booked = clashes(&rows, |row| (&row.part_number, &row.serial_number));
        errors.extend(as_booked.into_iter().map(|(row, other)| {
            let Installation { part_number, serial_number, installed_utc, .. } = &rows[other - 1];
            Error(format!(
                "rows {row} and {other}: {part_number} / {serial_number} is installed in two places at {installed_utc}; \
                 set `removed_utc` of the earlier installation"
            ))
        }));
        if !errors.is_empty() {
            return Err(errors);
        }
        rows.sort_unstable_by(|a, b| place(a).cmp(&place(b)).then_with(|| period(a).cmp(&period(b))));
        follow_modifications(&mut rows);
        Ok(Self::indexed(rows))
    }

    fn indexed(rows: Vec<Installation>) -> Self {
        let mut by_serial: Vec<usize> = (0..rows.len()).collect();
        by_serial.sort_by_key(|&row| (rows[row].unit().1, rows[row].installed_utc));
        let mut former = BTreeMap::<String, Vec<usize>>::new();
        for (row, stay) in rows.iter().enumerate().filter(|(_, stay)| stay.today.is_some()) {
            former.entry(stay.serial_number.to_string()).or_default().push(row);
        }
        Self { rows, by_serial, former, aliases: Vec::new() }
    }

    /// The same with units under the part and serial numbers that they have today.
    #[must_use]
    pub fn with_aliases(mut self, aliases: &[Alias]) -> Self {
        for row in &mut self.rows {
            // Each alias leads to a later name; as many steps as there are aliases end a circle.
            for _ in 0..aliases.len() {
                let (part, serial) = row.unit();
                let is_former = |alias: &&Alias| alias.is_of(Some(part.as_str()), serial.as_str());
                let Some(alias) = aliases.iter().find(is_former) else { break };
                let part = alias.part_number.clone().unwrap_or_else(|| part.clone());
                row.today = Some((part, alias.serial_number.clone()));
            }
        }
        Self { aliases: aliases.to_vec(), ..Self::indexed(self.rows) }
    }

    /// The unit of today that a table names on a date: that of the latest installation until then under this name, or else of
    /// the next one, or else of an alias.
    pub fn unit_today(&self, named: (Option<String>, String), at: Timestamp) -> (Option<String>, String) {
        let mut unit = named;
        for _ in 0..=self.aliases.len() {
            let (part, serial) = (unit.0.as_deref(), unit.1.as_str());
            let former = self.former.get(serial).into_iter().flatten().map(|&row| &self.rows[row]);
            let former = former.filter(|row| part.is_none_or(|part| row.part_number.as_str() == part));
            let order =
                |row: &&Installation| (row.installed_utc > at, row.installed_utc.duration_since(at).abs());
            let installed = former.chain(self.of_unit(&unit)).min_by_key(order);
            if let Some((part, serial)) = installed.map(Installation::unit) {
                return (unit.0.map(|_| part.to_string()), serial.to_string());
            }
            let Some(alias) = self.aliases.iter().find(|alias| alias.is_of(part, serial)) else { break };
            let part = unit.0.map(|part| alias.part_number.as_ref().map_or(part, ToString::to_string));
            unit = (part, alias.serial_number.to_string());
        }
        unit
    }

    /// Two places that one unit has at once by the numbers of today, which aliases made of two units: what is wrong, in words.
    pub fn merged_by_aliases(&self) -> Option<String> {
        let (earlier, later) = *clashes(&self.rows, Installation::unit).first()?;
        let [one, other] = [&self.rows[earlier - 1], &self.rows[later - 1]];
        let (_, serial) = one.unit();
        Some(format!(
            "by the aliases, {} on {} and {} on {} are both {serial} at {}",
            one.serial_number, one.tail_number, other.serial_number, other.tail_number, other.installed_utc
        ))
    }

    /// Every installation in one position of a tail, by date.
    pub fn of_position(&self, tail: &str, position: &str) -> &[Installation] {
        self.between(|row| (row.tail_number.as_str(), row.position.as_str()).cmp(&(tail, position)))
    }

    /// The unit installed in that position at that instant.
    pub fn installed_at(
        &self,
        tail: &TailNumber,
        position: &Position,
        at: Timestamp,
    ) -> Option<&Installation> {
        self.of_position(tail.as_str(), position.as_str()).iter().find(|installation| installation.covers(at))
    }

    /// Every installation of a unit, the earliest first; where the part number is not known, of all units with the serial
    /// number.
    pub fn of_unit<'s>(
        &'s self,
        (part, serial): &(Option<String>, String),
    ) -> impl Iterator<Item = &'s Installation> {
        let serial_of = |row: usize| self.rows[row].unit().1.as_str();
        let first = self.by_serial.partition_point(|&row| serial_of(row) < serial.as_str());
        let of_serial = self.by_serial[first..].iter().map(|&row| &self.rows[row]);
        of_serial
            .take_while(move |row| row.unit().1.as_str() == serial)
            .filter(move |row| part.as_deref().is_none_or(|part| row.unit().0.as_str() == part))
    }

    /// The installation that a unit is in on a date.
    pub fn installed(&self, unit: &(Option<String>, String), as_of: Timestamp) -> Option<&Installation> {
        self.of_unit(unit).find(|installation| installation.covers(as_of))
    }

    /// Since when a unit is in the position that it has on a date; a modification that splits its installation ends no stay.
    pub fn installed_since(&self, unit: &(Option<String>, String), as_of: Timestamp) -> Option<Timestamp> {
        let first = self.installed(unit, as_of)?;
        let just_before = first.installed_utc.checked_sub(SignedDuration::from_nanos(1)).ok();
        let before = just_before.and_then(|at| self.installed(unit, at));
        match before.filter(|before| place(before) == place(first)) {
            Some(before) => self.installed_since(unit, before.installed_utc),
            None => Some(first.installed_utc),
        }
    }

    /// The last installation of a unit that is in none on a date; nothing of a unit without installations before it.
    pub fn removal(&self, unit: &(Option<String>, String), as_of: Timestamp) -> Option<&Installation> {
        let before = || self.of_unit(unit).filter(|installation| installation.installed_utc <= as_of);
        let is_open = |i: &Installation| i.removed_utc.is_none_or(|removed| removed > as_of);
        if before().any(is_open) { None } else { before().max_by_key(|i| i.removed_utc) }
    }

    /// Every unit installed on that tail at that instant, by position.
    pub fn units_on_tail(&self, tail: &TailNumber, at: Timestamp) -> impl Iterator<Item = &Installation> {
        // No two stays in one position cover one instant.
        self.of_tail(tail).iter().filter(move |installation| installation.covers(at))
    }

    /// Every installation on that tail, by position and date.
    pub fn of_tail(&self, tail: &TailNumber) -> &[Installation] {
        self.between(|row| row.tail_number.cmp(tail))
    }

    /// Every installation, by tail, position and date.
    pub fn iter(&self) -> impl Iterator<Item = &Installation> {
        self.rows.iter()
    }

    /// The rows that are equal by an order of the table.
    fn between(&self, order: impl Fn(&Installation) -> Ordering) -> &[Installation] {
        let first = self.rows.partition_point(|row| order(row).is_lt());
        let count = self.rows[first..].partition_point(|row| order(row).is_eq());
        &self.rows[first..first + count]
    }
}

fn place(installation: &Installation) -> (&TailNumber, &Position) {
    (&installation.tail_number, &installation.position)
}

/// A part number that changes on the same serial number, in the same position and without a gap in time, is a modification:
/// the unit is followed under its last part number.
fn follow_modifications(rows: &mut [Installation]) {
    for later in (1..rows.len()).rev() {
        let (earlier, next) = (&rows[later - 1], &rows[later]);
        let is_modified = place(earlier) == place(next)
            && earlier.serial_number == next.serial_number
            && earlier.part_number != next.part_number
            && earlier.removed_utc == Some(next.installed_utc);
        if is_modified {
            let (part, serial) = next.unit();
            rows[later - 1].today = Some((part.clone(), serial.clone()));
        }
    }
}

/// Start and end, the end of a unit that is still installed last: an installation without length is before one that follows.
fn period(installation: &Installation) -> (Timestamp, Timestamp) {
    (installation.installed_utc, installation.removed_utc.unwrap_or(Timestamp::MAX))
}

/// Pairs of row numbers, counted from 1, that claim the same key at the same time.
fn clashes<'a, K: Ord + 'a>(
    rows: &'a [Installation],
    key: impl Fn(&'a Installation) -> K,
) -> Vec<(usize, usize)> {
    let mut order: Vec<usize> = (0..rows.len()).collect();
    order.sort_by(|&a, &b| {
        key(&rows[a]).cmp(&key(&rows[b])).then_with(|| period(&rows[a]).cmp(&period(&rows[b])))
    });
    let is_clash = |pair: &&[usize]| {
        let [earlier, later] = [&rows[pair[0]], &rows[pair[1]]];
        let overlap = earlier.removed_utc.is_none_or(|removed| later.installed_utc < removed);
        key(earlier) == key(later) && overlap
    };
    let mut found: Vec<_> =
        order.windows(2).filter(is_clash).map(|pair| (pair[0] + 1, pair[1] + 1)).collect();
    found.sort_unstable();
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    fn installation(tail: &str, position: &str, serial: &str, from: &str, to: Option<&str>) -> Installation {
        Installation {
            tail_number: TailNumber::new(tail).unwrap(),
            position: Position::new(position).unwrap(),
            part_number: PartNumber::new("EMA").unwrap(),
            serial_number: SerialNumber::new(serial).unwrap(),
            installed_utc: from.parse().unwrap(),
            removed_utc: to.map(|t| t.parse().unwrap()),
            unit_hours_at_install: None,
            tail_hours_at_install: None,
            today: None,
        }
    }

    const JAN: &str = "2026-01-01T00:00:00Z";
    const FEB: &str = "2026-02-01T00:00:00Z";
    const MAR: &str = "2026-03-01T00:00:00Z";

    #[test]
    fn a_unit_keeps_its_history_through_a_modification_and_a_new_serial_number() {
        let part = |text: &str| PartNumber::new(text).unwrap();
        let serial = |text: &str| SerialNumber::new(text).unwrap();
        let mut rows = vec![
            installation("N1", "aileron", "A", JAN, Some(FEB)),
            installation("N1", "aileron", "A", FEB, Some(MAR)),
            installation("N2", "aileron", "B", MAR, None),
        ];
        rows[0].part_number = part("EMA-OLD");
        let unit = |row: &Installation| (row.unit().0.to_string(), row.unit().1.to_string());
        let table = Installations::new(rows.clone()).unwrap();
        let units: Vec<_> = table.iter().map(unit).collect();
        let named = |serial: &str| ("EMA".to_owned(), serial.to_owned());
        assert_eq!(units, [named("A"), named("A"), named("B")]);
        let alias = Alias {
            former_part_number: Some(part("EMA")),
            former_serial_number: serial("A"),
            part_number: None,
            serial_number: serial("B"),
        };
        let units: Vec<_> =
            table.clone().with_aliases(std::slice::from_ref(&alias)).iter().map(unit).collect();
        assert_eq!(units, [named("B"), named("B"), named("B")]);
        // C has no installation but by its number of today.
        let of_c = Alias { former_serial_number: serial("C"), serial_number: serial("A"), ..alias.clone() };
        let aliased = table.clone().with_aliases(&[of_c, alias.clone()]);
        for (part, serial) in [("EMA-OLD", "A"), ("EMA", "A"), ("EMA", "B"), ("EMA", "C")] {
            let unit = aliased.unit_today((Some(part.to_owned()), serial.to_owned()), JAN.parse().unwrap());
            assert_eq!((unit.0.unwrap(), unit.1), named("B"), "{part} {serial}");
        }
        // A circle of aliases ends.
        let back = Alias { former_serial_number: serial("B"), serial_number: serial("A"), ..alias.clone() };
        assert_eq!(table.with_aliases(&[alias, back]).iter().count(), 3);
        // With a gap in time, one of the same serial number and another part number is another unit.
        rows[1].installed_utc = "2026-02-02T00:00:00Z".parse().unwrap();
        let apart = Installations::new(rows).unwrap();
        assert_eq!(unit(apart.iter().next().unwrap()), ("EMA-OLD".to_owned(), "A".to_owned()));
    }

    /// The table is a set. Each unit is removed at the instant at which the next one is installed.
    #[test]
    fn a_unit_owns_the_instant_it_is_installed_and_not_the_one_it_leaves_in_any_order_of_rows() {
        let months: Vec<String> = (1..=7).map(|m| format!("2026-{m:02}-01T00:00:00Z")).collect();
        let stay =
            |i: usize| installation("N1", "aileron", &format!("S{i}"), &months[i], Some(&months[i + 1]));
        let (tail, place) = (TailNumber::new("N1").unwrap(), Position::new("aileron").unwrap());
        for order in [[0, 1, 2, 3, 4, 5], [5, 4, 3, 2, 1, 0], [3, 0, 5, 1, 4, 2]] {
            let table = Installations::new(order.map(stay).to_vec()).unwrap();
            let at = |time: &str| table.installed_at(&tail, &place, time.parse().unwrap());
            assert_eq!(at("2025-12-31T23:59:59Z"), None);
            (0..6).for_each(|i| assert_eq!(at(&months[i]), Some(&stay(i))));
        }
    }
}
