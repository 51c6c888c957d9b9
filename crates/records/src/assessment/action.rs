//! What the state of a unit asks for, and until when: one statement for every table, page and message.

use jiff::Timestamp;

use crate::assessment::trend_row::TrendRow;
use crate::time::day_text;

/// What a unit's state asks for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
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

impl Action {
    /// Its word in columns.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Replace => "replace",
            Self::Inspect => "inspect",
            Self::CheckLogs => "check_logs",
            Self::SetLimit => "set_limit",
        }
    }

    /// The action that a state and its reason ask for, with the states of other quantities.
    ///
    /// `at_limit` is what the unit's part asks for in state `act`.
    pub fn of(
        state: Option<&str>,
        reason_code: Option<&str>,
        conditions: &[String],
        at_limit: Self,
    ) -> Option<Self> {
        match state {
            Some("act") => Some(at_limit),
            Some("plan" | "watch") => Some(Self::Inspect),
            Some("unassessed") if reason_code == Some("no_limit") => Some(Self::SetLimit),
            Some("unassessed") => Some(Self::CheckLogs),
            Some(_) if !conditions.is_empty() => Some(Self::Inspect),
            _ => None,
        }
    }
}

/// Reasons whose inspection is due at once: the next record alone would be too late.
const DUE_NOW: [&str; 3] = ["unconfirmed", "jumped", "changed"];

impl TrendRow {
    /// The row with its action and the date until when; `at_limit` is what its part asks for in state `act`.
    ///
    /// A unit in `act`, and one whose gap jumped, is due at once; another in `plan` or `watch` before the earliest date on
    /// which it reaches its limit.
    #[must_use]
    pub fn with_action(mut self, at_limit: Action) -> Self {
        let action = Action::of(self.state, self.reason_code, &self.conditions, at_limit);
        self.action = action.map(Action::as_str);
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

    /// The date until when, for readers: `now`, `28 Dec`, `348 FH` where no usage is known, or nothing.
    pub fn due_text(&self) -> Option<String> {
        let is_now = self.due_utc.is_some_and(|due| due <= self.as_of_utc);
        match (self.action?, self.due_utc, self.crossing_hours_p05) {
            _ if is_now => Some("now".to_owned()),
            (_, Some(due), _) => Some(self.day(due)),
            ("inspect", None, Some(hours)) => Some(format!("{hours:.0} FH")),
            _ => None,
        }
    }

    /// What to do, for readers: `replace now`, `inspect before 28 Dec`, `inspect`.
    pub fn action_text(&self) -> Option<String> {
        let action = self.action?.replace('_', " ");
        Some(match self.due_text() {
            Some(due) if due == "now" => format!("{action} now"),
            Some(due) if due.ends_with(" FH") => format!("{action} within {due}"),
            Some(due) => format!("{action} before {due}"),
            None => action,
        })
    }

    /// Order of urgency: by state, then by the date until when, then by the hours to the limit.
    pub fn urgency(&self) -> (u8, f64, f64, &str) {
        let rank = match self.state {
            Some("act") => 0,
            Some("plan") => 1,
            Some("unassessed") => 2,
            Some("watch") => 3,
            Some(_) if self.action.is_some() => 4,
            Some(_) => 5,
            None => 6,
        };
        let due = self.due_utc.map_or(f64::INFINITY, |due| due.as_second() as f64);
        (rank, due, self.crossing_hours_p05.unwrap_or(f64::INFINITY), &self.serial_number)
    }

    /// A date for readers: `28 Dec`, with its year where it is more than 300 days from `as_of_utc`.
    pub fn day(&self, at: Timestamp) -> String {
        day_text(at, self.as_of_utc)
    }
}
