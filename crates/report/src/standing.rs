//! Where a unit stands: one word, one shape and one colour, so that no reader depends on colour.

use serde::Serialize;

/// What to do with a unit, most urgent first.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Standing {
    /// Change it.
    Act,
    /// Plan the change.
    Plan,
    /// Look at it.
    Watch,
    /// Too little is known to say anything; never to be read as normal.
    Unstated,
    /// Nothing.
    Normal,
}

impl Standing {
    /// All of them, as they are counted at the head of a page.
    pub const ALL: [Self; 5] = [Self::Act, Self::Plan, Self::Watch, Self::Normal, Self::Unstated];

    /// From the word of a statement; no word, or one we do not know, is no statement.
    pub fn of(word: Option<&str>) -> Self {
        match word {
            Some("act") => Self::Act,
            Some("plan") => Self::Plan,
            Some("watch") => Self::Watch,
            Some("normal") => Self::Normal,
            _ => Self::Unstated,
        }
    }

    /// The word.
    pub fn word(self) -> &'static str {
        match self {
            Self::Act => "act",
            Self::Plan => "plan",
            Self::Watch => "watch",
            Self::Normal => "normal",
            Self::Unstated => "without a statement",
        }
    }

    /// The shape, told apart in grey.
    pub fn shape(self) -> &'static str {
        match self {
            Self::Act => "◆",
            Self::Plan => "▲",
            Self::Watch => "●",
            Self::Normal => "○",
            Self::Unstated => "–",
        }
    }

    /// The class by which the style sheet knows its colour.
    pub fn class(self) -> &'static str {
        match self {
            Self::Unstated => "unstated",
            other => other.word(),
        }
    }

    /// Whether it belongs on the work list.
    pub fn calls(self) -> bool {
        matches!(self, Self::Act | Self::Plan | Self::Watch)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_missing_or_unknown_word_is_never_normal() {
        assert_eq!(Standing::of(None), Standing::Unstated);
        assert_eq!(Standing::of(Some("fine")), Standing::Unstated);
    }
}
