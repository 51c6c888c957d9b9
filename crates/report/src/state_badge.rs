//! State badge: word, shape and colour of a unit's state, so that no reader depends on colour.

use trend::State;

/// State of a unit as readers see it. Not assessed, for lack of data, must never be read as normal.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct StateBadge(Option<State>);

impl StateBadge {
    /// No action.
    pub(crate) const NORMAL: Self = Self(Some(State::Normal));

    /// All states, in the order of the counts at the top of the fleet page.
    pub const ALL: [Self; 5] =
        [Self(Some(State::Act)), Self(Some(State::Plan)), Self(Some(State::Watch)), Self::NORMAL, Self(None)];

    /// Parses the `state` of an assessment; `None` or an unknown word means not assessed.
    pub fn from_state(word: Option<&str>) -> Self {
        Self(word.and_then(State::from_word))
    }

    /// Rank by urgency, the most urgent first. A unit that is not assessed comes before a normal one.
    pub fn rank(self) -> u8 {
        match self.0 {
            Some(State::Act) => 0,
            Some(State::Plan) => 1,
            Some(State::Watch) => 2,
            None => 3,
            Some(State::Normal) => 4,
        }
    }

    /// Word shown to readers.
    pub fn word(self) -> &'static str {
        self.0.map_or("not assessed", State::as_str)
    }

    /// Shape, distinguishable without colour.
    pub fn shape(self) -> &'static str {
        match self.0 {
            Some(State::Act) => "◆",
            Some(State::Plan) => "▲",
            Some(State::Watch) => "●",
            Some(State::Normal) => "○",
            None => "–",
        }
    }

    /// CSS class that sets the colour.
    pub fn class(self) -> &'static str {
        self.0.map_or("unstated", State::as_str)
    }

    /// Whether the unit must be replaced now.
    pub(crate) fn is_act(self) -> bool {
        self.0 == Some(State::Act)
    }

    /// Whether the unit belongs on the work list.
    pub fn needs_action(self) -> bool {
        self.0.is_some_and(|state| state > State::Normal)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_missing_or_unknown_word_is_never_normal() {
        assert_eq!(StateBadge::from_state(None), StateBadge(None));
        assert_eq!(StateBadge::from_state(Some("fine")), StateBadge(None));
    }
}
