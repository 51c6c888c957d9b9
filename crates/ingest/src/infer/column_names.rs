//! Names of columns: the words that name a channel, a unit, a redundant sensor or a position.

use std::collections::HashMap;
use std::ops::Range;
use std::sync::LazyLock;

use crate::mapping::Role;
use crate::mapping::column_pattern::PLACEHOLDER;
use crate::mapping::units::{Dimension, SPELLINGS, Unit};

/// A name's words: cut at what is no letter or digit, where a digit follows the name of a channel (`LVDT2`), and where a
/// capital follows a small letter, but for a unit (`kN`).
pub(super) fn words(name: &str) -> Vec<(usize, &str)> {
    let mut found = Vec::new();
    let mut start = None;
    let mut before = ' ';
    for (at, c) in name.char_indices().chain(std::iter::once((name.len(), ' '))) {
        let is_hump = c.is_uppercase() && before.is_lowercase();
        let is_number = |from: usize| c.is_ascii_digit() && is_channel(&name[from..at]);
        let is_cut = !c.is_alphanumeric()
            || start.is_some_and(|from| is_number(from) || (is_hump && !is_unit_at(&name[from..])));
        if let (true, Some(from)) = (is_cut, start) {
            found.push((from, &name[from..at]));
            start = None;
        }
        if c.is_alphanumeric() && start.is_none() {
            start = Some(at);
        }
        before = c;
    }
    found
}

fn is_channel(word: &str) -> bool {
    ROLES.iter().any(|(_, known)| place_in(known, &word.to_lowercase()).is_some())
}

/// Whether a text begins with a unit that no letter or digit follows.
fn is_unit_at(text: &str) -> bool {
    let end = text.find(|c: char| !c.is_alphanumeric()).unwrap_or(text.len());
    unit_of(&text[..end]).is_some()
}

/// Where a word stands in a list of words.
pub(super) fn place_in(list: &str, word: &str) -> Option<usize> {
    list.split(' ').position(|known| known == word)
}

pub(super) fn has_word_of(name: &str, list: &str) -> bool {
    words(name).iter().any(|(_, word)| place_in(list, &word.to_lowercase()).is_some())
}

/// Names of seconds, the symbol first.
const SECONDS: &str = "s sec second seconds";

/// Whether a column seems to hold times; `second` alone is a time, within a name it may be a unit (`deg_per_sec`).
pub(super) fn is_time(name: &str) -> bool {
    has_word_of(name, "time t timestamp stamp elapsed tick ticks clock utc epoch unix gmt zulu tod since")
        || place_in(SECONDS, &name.to_lowercase()).is_some()
}

/// Whether a time of this name counts from midnight, if its values do not contradict.
pub(super) fn is_of_day(name: &str) -> bool {
    has_word_of(name, "gmt utc zulu tod")
}

/// The unit of a time that ends its name or begins it: `t_ms`, `us_since_start`.
pub(super) fn time_unit(name: &str) -> Option<&'static str> {
    let words = words(name);
    let units = [SECONDS, "ms", "us", "ns", "min", "h hours"];
    [words.last()?, &words[0]].into_iter().find_map(|(_, word)| {
        units.iter().find(|list| place_in(list, &word.to_lowercase()).is_some())?.split(' ').next()
    })
}

const ROLES: [(Role, &str); 4] = [
    (Role::Motor, "motor mot mtr rotor input drive resolver rslvr encoder enc"),
    (Role::Screw, "screw scrw ballscrew nut ram output stroke rod joint piston extension travel lvdt rvdt"),
    (Role::Load, "load force frc torque trq moment loadcell"),
    (Role::Temperature, "temp temperature"),
];

/// Kinds of sensors: such a word names a channel where no other does (`output_encoder` is the screw).
const SENSOR_KINDS: &str = "resolver rslvr encoder enc lvdt rvdt loadcell";

/// Words without information.
const FILLERS: &str = "position pos posn angle ang rotation displacement disp length cell sensor meas measured actual feedback fbk \
                       value raw counts of the";

/// The unit that a text names, in letters of either case and with any sign of multiplication or none.
pub(super) fn unit_of(text: &str) -> Option<Unit> {
    static KNOWN: LazyLock<HashMap<String, Unit>> =
        LazyLock::new(|| SPELLINGS.iter().map(|(text, unit)| (plain(text), *unit)).collect());
    KNOWN.get(&plain(text)).copied()
}

/// A text in small letters without signs of multiplication.
fn plain(text: &str) -> String {
    let is_sign = |c: char| matches!(c, '.' | '·' | '-' | '*' | '_') || c.is_whitespace();
    text.to_lowercase().replace(is_sign, "")
}

/// Words of quantities that are no position, load or temperature.
const OTHERS: &str = "current speed velocity vel rate rpm acceleration accel voltage power cmd command demand target setpoint reference \
                      ref status valid ssm mode error fault limit";

/// Words that distinguish redundant sensors of one quantity, best first.
const SENSORS: &str = "a primary main 1 cha ch1 b secondary backup 2 chb ch2";

#[derive(Debug, Clone, PartialEq)]
pub(super) struct ParsedName {
    pub(super) role: Role,
    pub(super) pattern: String,
    pub(super) position: Option<String>,
    pub(super) unit: Option<Unit>,
    /// Which of redundant sensors it is, as a place in [`SENSORS`].
    pub(super) sensor: Option<usize>,
}

impl ParsedName {
    /// Parses a name; a word of redundant sensors after the channel is one where `has_sensors`, else part of a position.
    pub(super) fn of(name: &str, has_sensors: bool) -> Option<Self> {
        let words: Vec<(usize, &str, String)> =
            words(name).into_iter().map(|(at, word)| (at, word, word.to_lowercase())).collect();
        let says = |known: &str, word: &str| place_in(known, word).is_some();
        if words.iter().any(|(_, _, word)| says(OTHERS, word)) {
            return None;
        }
        let named = |(role, known): &(Role, &str)| {
            Some((words.iter().position(|(_, _, word)| says(known, word))?, *role))
        };
        let named: Vec<(usize, Role)> = ROLES.iter().filter_map(named).collect();
        let has = |role: Role| named.iter().any(|(_, of)| *of == role);
        if has(Role::Motor) && has(Role::Load) {
            // What the motor bears is not the load of the screw.
            return None;
        }
        // The temperature of a motor is a temperature, and the load of a ram a load.
        let rank = |role: Role| match role {
            Role::Temperature => 0,
            Role::Load => 1,
            _ => 2,
        };
        let is_sensor = |at: usize| says(SENSOR_KINDS, &words[at].2);
        let (at, role) = named.iter().copied().min_by_key(|(at, role)| (rank(*role), is_sensor(*at), *at))?;
        let fits = |unit: &Unit| match role {
            Role::Motor | Role::Screw => matches!(unit.dimension(), Dimension::Length | Dimension::Angle),
            Role::Load => matches!(unit.dimension(), Dimension::Force | Dimension::Torque),
            Role::Temperature => unit.dimension() == Dimension::Temperature,
        };
        // A unit ends a name (in several words: `N.m`), follows the channel, or begins the name.
        let unit_at = |span: Range<usize>| {
            let (first, last) = (&words[span.start], &words[span.end - 1]);
            let unit = unit_of(&name[first.0..last.0 + last.1.len()]).filter(fits)?;
            Some((span, unit))
        };
        let follower = (at + 1..words.len()).find(|i| !says(FILLERS, &words[*i].2));
        let spans = (at + 1..words.len()).map(|i| i..words.len());
        let others = [follower, (at > 0).then_some(0)].into_iter().flatten().map(|i| i..i + 1);
        let found = spans.chain(others).find_map(unit_at);
        let unit = found.as_ref().map(|(_, unit)| *unit);
        let is_unit = |i: usize| found.as_ref().is_some_and(|(span, _)| span.contains(&i));
        let tag = (at + 1..words.len()).find(|i| has_sensors && !is_unit(*i) && says(SENSORS, &words[*i].2));
        let sensor = tag.and_then(|i| place_in(SENSORS, &words[i].2));
        // `RAM_LOAD` and `MTR_RESOLVER`: two words for one channel.
        let is_of_channel = |i: usize| {
            ROLES.iter().any(|(of, known)| {
                let is_beside = i.abs_diff(at) == 1 && (*of == role || is_sensor(i));
                says(known, &words[i].2) && (rank(role) < 2 || is_beside)
            })
        };
        let is_place = |i: &usize| {
            *i != at && !is_unit(*i) && tag != Some(*i) && !says(FILLERS, &words[*i].2) && !is_of_channel(*i)
        };
        let mut place: Vec<usize> = (0..words.len()).filter(is_place).collect();
        let is_run = |place: &[usize]| place.windows(2).all(|w| w[1] == w[0] + 1);
        if !is_run(&place) {
            // `actuatorLoadLeftAileron`: the actuator is no part of the position.
            place.retain(|i| !says("actuator act ema servo", &words[*i].2));
        }
        let run = is_run(&place);
        let (Some(&first), Some(&end)) = (place.first(), place.last()) else {
            return Some(Self { role, pattern: name.to_owned(), position: None, unit, sensor });
        };
        let span = words[first].0..words[end].0 + words[end].1.len();
        let position = run.then(|| name[span.clone()].to_owned())?;
        let pattern = format!("{}{PLACEHOLDER}{}", &name[..span.start], &name[span.end..]);
        Some(Self { role, pattern, position: Some(position), unit, sensor })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Role, pattern, position and unit of a name.
    fn inferred(name: &str) -> Option<String> {
        let ParsedName { role, pattern, position, unit, .. } = ParsedName::of(name, true)?;
        let (position, unit) = (position.unwrap_or("-".into()), unit.map_or("-", Unit::as_str));
        Some([role.as_str(), &pattern, &position, unit].join("; "))
    }

    #[test]
    fn names_of_several_houses_are_understood() {
        let names = include_str!("../../tests/data/column_names.txt").lines().skip(1);
        for (name, wanted) in names.map(|line| line.split_once("; ").unwrap()) {
            assert_eq!(inferred(name).as_deref(), Some(wanted), "{name}");
        }
        for other in [
            "airspeed_kt",
            "aileron_left_motor_torque_nm",
            "aileron_left_motor_current",
            "AIL_L_MOTOR_REF_DEG",
            "rudder_output_rate_deg_s",
        ] {
            assert_eq!(inferred(other), None, "{other}");
        }
    }
}
