//! State badge: word, shape and colour of a unit's state, so that no reader depends on colour.

use serde::Serialize;

/// State of a unit, most urgent first.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum StateBadge {
    /// Replace the unit.
    Act,
    /// Plan the replacement.
    Plan,
    /// Inspect or monitor the unit.
    Watch,
    /// Not assessed, for lack of data; must never be read as normal.
    NotAssessed,
    /// No action.
    Normal,
}

impl StateBadge {
    /// All states, in the order of the counts at the top of the fleet page.
    pub const ALL: [Self; 5] = [Self::Act, Self::Plan, Self::Watch, Self::Normal, Self::NotAssessed];

    /// Parses the `state` of an assessment; `None` or an unknown word means not assessed.
    pub fn from_state(word: Option<&str>) -> Self {
        match word {
            Some("act") => Self::Act,
            Some("plan") => Self::Plan,
            Some("watch") => Self::Watch,
            Some("normal") => Self::Normal,
            _ => Self::NotAssessed,
        }
    }

    /// Word shown to readers.
    pub fn word(self) -> &'static str {
        match self {
            Self::Act => "act",
            Self::Plan => "plan",
            Self::Watch => "watch",
            Self::Normal => "normal",
            Self::NotAssessed => "not assessed",
        }
    }

    /// Shape, distinguishable without colour.
    pub fn shape(self) -> &'static str {
        match self {
            Self::Act => "◆",
            Self::Plan => "▲",
            Self::Watch => "●",
            Self::Normal => "○",
            Self::NotAssessed => "–",
        }
    }

    /// CSS class that sets the colour.
    pub fn class(self) -> &'static str {
        match self {
            Self::NotAssessed => "unstated",
            other => other.word(),
        }
    }

    /// Whether the unit belongs on the work list.
    pub fn needs_action(self) -> bool {
        matches!(self, Self::Act | Self::Plan | Self::Watch)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_missing_or_unknown_word_is_never_normal() {
        assert_eq!(StateBadge::from_state(None), StateBadge::NotAssessed);
        assert_eq!(StateBadge::from_state(Some("fine")), StateBadge::NotAssessed);
    }
}
