//! State badge: word, shape and colour of a unit's state, so that no reader depends on colour.

use trend::State;

/// State of a unit as readers see it; a removed unit has none. An unknown word must never be read as normal.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct StateBadge(Option<State>);

impl StateBadge {
    /// Parses the `state` of an assessment; `None` is a removed unit, an unknown word an unassessed one.
    pub fn from_state(word: Option<&str>) -> Self {
        Self(word.map(|word| word.parse().unwrap_or(State::Unassessed)))
    }

    pub(crate) fn word(self) -> &'static str {
        self.0.map_or("removed", State::as_str)
    }

    /// Shape, distinguishable without colour.
    pub fn shape(self) -> &'static str {
        match self.0 {
            Some(State::Act) => "◆",
            Some(State::Plan) => "▲",
            Some(State::Unassessed) => "?",
            Some(State::Watch) => "●",
            Some(State::Normal) => "○",
            None => "–",
        }
    }

    /// CSS class that sets the colour.
    pub(crate) fn class(self) -> &'static str {
        match self.0 {
            None | Some(State::Unassessed) => "unstated",
            Some(state) => state.as_str(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_unknown_word_is_never_normal() {
        assert_eq!(StateBadge::from_state(Some("fine")), StateBadge(Some(State::Unassessed)));
    }
}
