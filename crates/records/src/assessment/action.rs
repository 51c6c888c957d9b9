//! What the state of a unit asks for, and until when: one statement for every table, page and message.

use std::cmp::Ordering;
use std::collections::BTreeMap;

use jiff::Timestamp;
use strum::IntoStaticStr;

use crate::assessment::trend_row::{ChangePoint, TrendRow};
use crate::time::day_text;

/// What a unit's state asks for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, IntoStaticStr)]
#[strum(serialize_all = "snake_case")]
pub enum Action {
    /// State `act`: the gap is at or above the limit, and the part does not ask for an inspection first.
    Replace,
    /// State `plan` or `watch`, or another quantity changed; state `act` where the part asks for it.
    Inspect,
    /// State `unassessed`: no record shows how large the gap is.
    CheckLogs,
    /// State `unassessed` without a limit.
    SetLimit,
}

/// Reasons whose inspection is due at once: the next record alone would be too late.
const DUE_NOW: [&str; 4] = ["unconfirmed", "repeated", "jumped", "changed"];

impl TrendRow {
    /// The row with its action and due date; `at_limit` is what its part asks for in state `act`.
    ///
    /// A unit in `act`, and one whose gap jumped, is due at once; another in `plan` or `watch` before the earliest date on
    /// which it reaches its limit.
    #[must_use]
    pub fn with_action(mut self, at_limit: Action) -> Self {
        let action = match (self.state, self.reason_code) {
            (Some("act"), _) => Some(at_limit),
            (Some("plan" | "watch"), _) => Some(Action::Inspect),
            (Some("unassessed"), Some("no_limit")) => Some(Action::SetLimit),
            (Some("unassessed"), _) => Some(Action::CheckLogs),
            (Some(_), _) if !self.conditions.is_empty() => Some(Action::Inspect),
            _ => None,
        };
        self.action = action.map(Action::into);
        self.due_utc = match action {
            _ if self.state == Some("act") => Some(self.as_of_utc),
            Some(Action::Inspect) if self.reason_code.is_some_and(|code| DUE_NOW.contains(&code)) => {
                Some(self.as_of_utc)
            }
            Some(Action::Inspect) => self.not_before_utc,
            Some(Action::Replace | Action::CheckLogs | Action::SetLimit) | None => None,
        };
        self
    }

    /// The due date as text: `now`, `28 Dec`, `348 FH` where no usage is known, `open` where a record is missing, or
    /// nothing.
    pub fn due_text(&self) -> Option<String> {
        let is_now = self.due_utc.is_some_and(|due| due <= self.as_of_utc);
        match (self.action?, self.due_utc, self.crossing_hours_p05) {
            _ if self.lacks_record() => Some("open".to_owned()),
            _ if is_now => Some("now".to_owned()),
            (_, Some(due), _) => Some(self.day(due)),
            ("inspect", None, Some(hours)) => Some(format!("{hours:.0} FH")),
            _ => None,
        }
    }

    /// What to do, for readers: `replace now`, `inspect before 28 Dec`, `confirm and record the repair`, `inspect`.
    pub fn action_text(&self) -> Option<String> {
        let action = self.verb()?;
        Some(match self.due_text() {
            Some(due) if due == "now" => format!("{action} now"),
            Some(due) if due == "open" => action,
            Some(due) if due.ends_with(" FH") => format!("{action} within {due}"),
            Some(due) => format!("{action} before {due}"),
            None => action,
        })
    }

    /// What to do without its date: `replace`, `inspect`, `check logs`, `set limit`, `confirm and record the repair`.
    pub fn verb(&self) -> Option<String> {
        let action = self.action?;
        Some(if self.lacks_record() {
            "confirm and record the repair".to_owned()
        } else {
            action.replace('_', " ")
        })
    }

    /// Whether the gap fell as by a repair, and no table has one.
    fn lacks_record(&self) -> bool {
        let fell = |change: &ChangePoint| change.kind == "reset" && change.step_m < 0.0 && !change.tail_wide;
        self.state == Some("watch")
            && self.reason_code == Some("changed")
            && self.unexplained_change().is_some_and(fell)
    }

    /// Order of urgency: by state, then by due date, then by the hours to the limit.
    fn urgency(&self) -> (u8, f64, f64, &str) {
        let rank = match state_rank(self.state) {
            NORMAL_RANK if self.action.is_some() => NORMAL_RANK - 1,
            rank => rank,
        };
        let due = self.due_utc.map_or(f64::INFINITY, |due| due.as_second() as f64);
        (rank, due, self.crossing_hours_p05.unwrap_or(f64::INFINITY), &self.serial_number)
    }

    /// Compares two units for a list with the most urgent first.
    pub fn by_urgency(&self, other: &Self) -> Ordering {
        self.urgency().partial_cmp(&other.urgency()).unwrap_or(Ordering::Equal)
    }

    /// A date for readers, as seen on `as_of_utc`.
    pub fn day(&self, at: Timestamp) -> String {
        day_text(at, self.as_of_utc)
    }
}

/// Rank of state `normal`; one less is a normal unit with another quantity to inspect.
const NORMAL_RANK: u8 = 5;

/// Rank of a state by urgency, the most urgent first; a removed unit, which has none, last.
pub fn state_rank(state: Option<&str>) -> u8 {
    match state {
        Some("act") => 0,
        Some("plan") => 1,
        Some("unassessed") => 2,
        Some("watch") => 3,
        Some(_) => NORMAL_RANK,
        None => NORMAL_RANK + 1,
    }
}

/// Number of installed units by action, the most urgent first: `1 replace now · 2 inspect, the first before 14 Dec · 8
/// fine`.
pub fn counts_text<'a>(rows: impl IntoIterator<Item = &'a TrendRow>) -> String {
    let mut kinds = BTreeMap::<(u8, String), (usize, Option<&TrendRow>)>::new();
    for row in rows.into_iter().filter(|row| row.removed_utc.is_none()) {
        let due = row.due_text().unwrap_or_default();
        let (rank, kind) = match row.verb() {
            None => (4, "fine".to_owned()),
            Some(_) if due == "open" => (2, "record missing".to_owned()),
            Some(verb) if due == "now" => (0, format!("{verb} now")),
            Some(verb) if row.due_utc.is_some() => (1, verb),
            Some(verb) => (3, verb),
        };
        let (count, first) = kinds.entry((rank, kind)).or_default();
        *count += 1;
        *first = first.iter().copied().chain([row]).min_by_key(|row| row.due_utc);
    }
    let text = |((rank, kind), (count, first)): ((u8, String), (usize, Option<&TrendRow>))| match first {
        Some(row) if rank == 1 => {
            let which = if count == 1 { "" } else { ", the first" };
            format!("{count} {kind}{which} before {}", row.due_text().unwrap_or_default())
        }
        _ => format!("{count} {kind}"),
    };
    kinds.into_iter().map(text).collect::<Vec<_>>().join(" · ")
}
