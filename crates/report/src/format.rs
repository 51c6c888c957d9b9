//! Number and date formatting; missing values are shown as "no data".

use askama::filters::{Html, escape};
use jiff::Timestamp;
use jiff::tz::TimeZone;
use records::uncertainty::NORMAL_95;

pub(crate) const NO_DATA: &str = "no data";

pub(crate) fn or_no_data<T>(value: Option<T>, text: impl FnOnce(T) -> String) -> String {
    value.map_or_else(|| NO_DATA.to_owned(), text)
}

/// A number with a decimal place; never "-0.0".
fn tenths(value: f64) -> String {
    let text = format!("{value:.1}");
    if text == "-0.0" { "0.0".to_owned() } else { text }
}

pub(crate) fn micrometres(m: f64) -> String {
    tenths(m * 1e6)
}

pub(crate) fn micrometres_or(m: Option<f64>) -> String {
    or_no_data(m, micrometres)
}

/// Cell of a long table: empty if the value is missing, as the table's caption explains.
pub(crate) fn micrometres_cell(m: Option<f64>) -> String {
    m.map(micrometres).unwrap_or_default()
}

/// `118.0 ± 4.1 µm (90 %)`: the gap and half the width of its 90 % interval.
pub(crate) fn level(gap_m: Option<f64>, se_m: Option<f64>) -> String {
    match (gap_m, se_m) {
        (Some(gap), Some(se)) => format!("{} ± {} µm (90 %)", micrometres(gap), micrometres(NORMAL_95 * se)),
        (Some(gap), None) => format!("{} µm", micrometres(gap)),
        _ => NO_DATA.to_owned(),
    }
}

/// Converts metres per hour to µm per 1,000 h.
pub(crate) fn rate(m_per_hour: f64) -> String {
    tenths(m_per_hour * 1e9)
}

/// HTML of a text whose dates and serial numbers do not break at their hyphens, nor numbers before their units; a word wider
/// than a phone does.
pub(crate) fn unbroken(text: &str) -> String {
    const MAX_CHARS: usize = 24;
    let word = |word: &str| {
        let Ok(safe) = escape(word, Html);
        let is_short = word.contains('-') && word.chars().count() <= MAX_CHARS;
        if is_short { format!("<span class=\"d\">{safe}</span>") } else { safe.to_string() }
    };
    let units = ["%", "µm", "FH", "×"].map(|unit| (format!(" {unit}"), format!("\u{a0}{unit}")));
    let text = text.split(' ').map(word).collect::<Vec<_>>().join(" ");
    units.iter().fold(text, |text, (apart, joined)| text.replace(apart, joined))
}

/// HTML of a list of chances, each of which stays on one line.
pub(crate) fn whole_dates(text: &str) -> String {
    let whole = |part: &str| format!("<span class=\"d\">{}</span>", unbroken(part));
    text.split(", ").map(whole).collect::<Vec<_>>().join(", ")
}

pub(crate) fn date(t: Timestamp) -> String {
    t.strftime("%Y-%m-%d").to_string()
}

pub(crate) fn minute(t: Timestamp) -> String {
    t.strftime("%Y-%m-%d %H:%M").to_string()
}

pub(crate) fn minute_or(t: Option<Timestamp>) -> String {
    or_no_data(t, |t| format!("{} UTC", minute(t)))
}

/// `1 205`: thin groups of three.
pub(crate) fn count(n: usize) -> String {
    let digits = n.to_string();
    let head = digits.len() % 3;
    let (first, rest) = digits.split_at(head);
    let groups = rest.as_bytes().chunks(3).map(|g| String::from_utf8_lossy(g).into_owned());
    let first = (!first.is_empty()).then(|| first.to_owned());
    first.into_iter().chain(groups).collect::<Vec<_>>().join("\u{202f}")
}

/// `1 log`, `2 logs`.
pub(crate) fn counted(n: usize, what: &str) -> String {
    format!("{} {what}{}", count(n), if n == 1 { "" } else { "s" })
}

pub(crate) fn hours(h: f64) -> String {
    count(h.max(0.0).round() as usize)
}

/// First instant of the month `months` after that of `from`.
pub(crate) fn month(from: Timestamp, months: i32) -> Option<Timestamp> {
    let day = from.to_zoned(TimeZone::UTC).date().first_of_month();
    let day = day.checked_add(jiff::Span::new().months(months)).ok()?;
    day.to_zoned(TimeZone::UTC).ok().map(|z| z.timestamp())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_grouped_in_threes() {
        assert_eq!(count(7), "7");
        assert_eq!(count(1205), "1\u{202f}205");
        assert_eq!(count(123_456), "123\u{202f}456");
    }

    #[test]
    fn dates_and_names_stay_whole_and_markup_is_escaped() {
        assert_eq!(unbroken("<b> on 2026-11-30"), "&#60;b&#62; on <span class=\"d\">2026-11-30</span>");
        let long = "a-".repeat(20);
        assert_eq!(unbroken(&long), long);
    }

    #[test]
    fn a_missing_value_reads_no_data_and_months_follow_the_calendar_across_the_year() {
        assert_eq!([level(None, Some(1e-6)), micrometres_or(None)], ["no data"; 2]);
        let t: Timestamp = "2026-11-30T23:59:00Z".parse().unwrap();
        assert_eq!([0, 2].map(|months| date(month(t, months).unwrap())), ["2026-11-01", "2027-01-01"]);
    }
}
