//! What several workers put down, brought together unit by unit.

use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::Arc;

use rayon::prelude::*;

use crate::flown::Flown;
use crate::gathering::{Block, Counted, Gathering, Put};
use crate::histories::{Histories, History, HistoryName, Places};
use crate::shelf::Shelves;

/// Histories of the rows of all, as if one had put them down in this order.
///
/// Each worker takes the rows of its own units, so that nobody waits for another one's, and a block is given up
/// once nobody needs it any more.
pub(crate) fn joined(gathered: Vec<Gathering>, is_booked: bool) -> Histories {
    let mut rooms = rooms(&gathered);
    let homes: Vec<Homes> = gathered.iter().map(|one| Homes::of(&one.units, &mut rooms)).collect();
    let mut stacks: Vec<Stack<'_>> = sections(rooms).into_iter().map(Stack::of).collect();
    for (one, homes) in gathered.into_iter().zip(&homes) {
        for block in one.blocks.into_iter().map(Arc::new) {
            let takers = stacks.iter_mut().filter(|stack| homes.are_in(&stack.ranks));
            takers.for_each(|stack| stack.blocks.push((homes, Arc::clone(&block))));
        }
    }
    let full: Vec<Vec<_>> = stacks.into_par_iter().map(Stack::histories).collect();
    Histories::new(full.into_iter().flatten().collect(), is_booked)
}

/// What all rows of a unit will need.
#[derive(Default)]
struct Room {
    /// Which of all units it is, by name.
    rank: u32,
    places: Places,
    rows: usize,
    bytes: usize,
}

fn rooms(gathered: &[Gathering]) -> BTreeMap<HistoryName, Room> {
    let mut rooms: BTreeMap<HistoryName, Room> = BTreeMap::new();
    for unit in gathered.iter().flat_map(|one| &one.units) {
        let room = rooms.entry(unit.name.clone()).or_default();
        room.rows += unit.rows;
        room.bytes += unit.bytes;
    }
    for (rank, room) in rooms.values_mut().enumerate() {
        room.rank = rank as u32;
    }
    rooms
}

/// Where the rows of each unit go that one gathering knows.
struct Homes(Vec<Home>);

/// Which of all units it is, and the numbers that its places have there.
struct Home {
    rank: u32,
    places: Vec<u32>,
}

impl Homes {
    fn of(units: &[Counted], rooms: &mut BTreeMap<HistoryName, Room>) -> Self {
        let home = |unit: &Counted| {
            // Each unit's room was made from these names.
            let room = rooms.entry(unit.name.clone()).or_default();
            Home { rank: room.rank, places: room.places.numbers(&unit.places) }
        };
        Self(units.iter().map(home).collect())
    }

    /// Whether any of them is one of those units.
    fn are_in(&self, ranks: &Range<u32>) -> bool {
        self.0.iter().any(|home| ranks.contains(&home.rank))
    }
}

/// As many sections as there are workers, of about as many rows each; the units of one follow each other by name.
fn sections(rooms: BTreeMap<HistoryName, Room>) -> Vec<Vec<(HistoryName, Room)>> {
    let rows: usize = rooms.values().map(|room| room.rows).sum();
    let most = rows.div_ceil(rayon::current_num_threads());
    let (mut sections, mut some, mut held) = (Vec::new(), Vec::new(), 0);
    for room in rooms {
        held += room.1.rows;
        some.push(room);
        if held >= most {
            sections.push(std::mem::take(&mut some));
            held = 0;
        }
    }
    sections.push(some);
    sections
}

/// A section, and the blocks in which rows of it may be.
struct Stack<'a> {
    ranks: Range<u32>,
    section: Vec<(HistoryName, Room)>,
    blocks: Vec<(&'a Homes, Arc<Block>)>,
}

impl Stack<'_> {
    fn of(section: Vec<(HistoryName, Room)>) -> Self {
        let first = section.first().map_or(0, |(_, room)| room.rank);
        Self { ranks: first..first + section.len() as u32, section, blocks: Vec::new() }
    }

    fn histories(self) -> Vec<(HistoryName, History)> {
        let mut shelves = Shelves::with_room(self.section.iter().map(|(_, room)| room.rows));
        let history =
            |(name, room): (_, Room)| (name, History::with_room(room.places, room.rows, room.bytes));
        let mut units: Vec<(HistoryName, History)> = self.section.into_iter().map(history).collect();
        for (homes, block) in self.blocks {
            each_row(&block, homes, |home, put, name| {
                let unit = home.rank.wrapping_sub(self.ranks.start) as usize;
                let Some((_, history)) = units.get_mut(unit) else { return };
                let row = history.flights().len() as u32;
                let place = home.places[put.place as usize];
                history.put(Flown::new(put.departure_us, put.gap_m, place, row), name);
                shelves.put(unit, row, put.beside);
            });
        }
        let full = units.into_iter().zip(shelves.of_units());
        full.map(|((name, history), beside)| (name, history.finish(beside))).collect()
    }
}

/// Hands over the rows of a block in order, each with where it goes and its flight's name.
fn each_row(block: &Block, homes: &Homes, mut take: impl FnMut(&Home, &Put, &str)) {
    let mut begin = 0;
    for put in &block.rows {
        let end = put.name_end as usize;
        take(&homes.0[put.unit as usize], put, &block.names[begin..end]);
        begin = end;
    }
}
