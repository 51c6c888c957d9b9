//! Dates to microseconds since 1970, and nothing more.

use crate::error::Error;

pub(crate) const HOUR_US: f64 = 3.6e9;
pub(crate) const DAY_US: f64 = 24.0 * HOUR_US;

/// Midnight UTC that begins a day written as `2026-03-02`, microseconds since 1970.
pub(crate) fn midnight_us(text: &str) -> Result<i64, Error> {
    let fail = || Error::Date { text: text.to_owned() };
    let fields: Option<Vec<i64>> = text.split('-').map(|field| field.parse().ok()).collect();
    let [year, month, day] = fields.ok_or_else(fail)?[..] else { return Err(fail()) };
    let days = days_since_1970(year, month, day);
    // A day such as 30 February runs over into the next month.
    let sound = (1970..10_000).contains(&year) && (1..=12).contains(&month) && (1..=31).contains(&day);
    let next_month = if month == 12 { (year + 1, 1) } else { (year, month + 1) };
    if !sound || days >= days_since_1970(next_month.0, next_month.1, 1) {
        return Err(fail());
    }
    Ok(days * DAY_US as i64)
}

/// Hinnant's `days_from_civil`: the year begins in March, so the leap day comes last.
fn days_since_1970(year: i64, month: i64, day: i64) -> i64 {
    let year = if month <= 2 { year - 1 } else { year };
    let era = year.div_euclid(400);
    let year_of_era = year.rem_euclid(400);
    let day_of_year = (153 * ((month + 9) % 12) + 2) / 5 + day - 1;
    era * 146_097 + year_of_era * 365 + year_of_era / 4 - year_of_era / 100 + day_of_year - 719_468
}

#[cfg(test)]
mod tests {
    use super::*;

    /// From `date -u -d 2026-03-02 +%s` and its like.
    #[test]
    fn midnights_agree_with_the_date_command() {
        for (text, seconds) in
            [("1970-01-01", 0), ("2026-03-02", 1_772_409_600), ("2024-02-29", 1_709_164_800)]
        {
            assert_eq!(midnight_us(text), Ok(seconds * 1_000_000), "{text}");
        }
    }

    #[test]
    fn days_that_do_not_exist_are_refused() {
        for text in ["2026-02-29", "2026-13-01", "2026-04-31", "2026-03", "March", "2026-03-02-01"] {
            assert!(midnight_us(text).is_err(), "{text}");
        }
    }
}
