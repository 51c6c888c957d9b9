//! Why a unit has its state, and how sure that is: one wording for the report, the terminal and messages.

use crate::assessment::trend_row::{ChangePoint, TrendRow};

impl TrendRow {
    /// Why the unit has its state, in a few words: `152.7 of 150.0 µm, over since 6 Nov`,
    /// `159.1 of 180.0 µm, +49.0 µm/1000 FH`, `61.0 of 180.0 µm, fell by 37.0 µm on 7 Oct, not on record`. `reason` has
    /// the whole reason with its evidence, [`TrendRow::caveats`] what limits the trust in it.
    pub fn why_text(&self) -> String {
        let whole = || self.reason.clone().unwrap_or_default();
        if let Some(removed) = self.removed_utc {
            let last = self.gap_m.map_or_else(String::new, |gap_m| format!("; last {:.1} µm", 1e6 * gap_m));
            return format!("removed {}{last}", self.day(removed));
        }
        match self.reason_code {
            Some("above_limit") => self.of_limit(self.over_since_text()),
            Some("crosses_soon" | "rises_to_limit" | "at_watch") => self.of_limit(self.growth_text()),
            Some("onset" | "changed") => self.change_text().unwrap_or_else(whole),
            Some("clear") if self.conditions.is_empty() => self.of_limit(self.growth_text()),
            Some("clear") => {
                let all = self.conditions.join(", ").replace('_', " ");
                self.of_limit(Some(all))
            }
            _ => whole(),
        }
    }

    /// How sure it is: `87 % over now`, `5 % by 14 Dec, 50 % by 9 Jan, 95 % by 27 Mar`; `None` where no probability is
    /// known.
    pub fn chance_text(&self) -> Option<String> {
        let state = self.state?;
        // A hangar check made the state, or records that contradict each other: no forecast says how sure it is.
        if self.reason_code.is_some_and(|code| matches!(code, "inspected" | "unconfirmed" | "repeated")) {
            return None;
        }
        if state == "act" {
            return self.over_limit_probability.map(|share| format!("{} over now", percent(share)));
        }
        let change = self
            .unexplained_change()
            .filter(|_| self.reason_code.is_some_and(|code| matches!(code, "jumped" | "changed")));
        if let Some(change) = change {
            return Some(match change.certainty {
                0.995.. => "certain".to_owned(),
                share => percent(share),
            });
        }
        let dates = [
            ("5 %", self.not_before_utc, self.crossing_hours_p05),
            ("50 %", self.likely_utc, self.crossing_hours_p50),
            ("95 %", self.not_after_utc, self.crossing_hours_p95),
        ];
        let text = |(share, at, hours): (&str, Option<_>, Option<f64>)| match (at, hours) {
            (Some(at), _) => Some(format!("{share} by {}", self.day(at))),
            (None, Some(hours)) => Some(format!("{share} within {hours:.0} FH")),
            (None, None) => None,
        };
        let dates: Vec<String> = dates.into_iter().filter_map(text).collect();
        (!dates.is_empty()).then(|| dates.join(", "))
    }

    /// Why, how sure, and everything that limits the trust in it, as one text: `152.7 of 150.0 µm, over since 6 Nov; 87 %
    /// over now; 2 of the latest 12 gaps are flagged`.
    pub fn statement_text(&self) -> String {
        let why = self.why_text();
        let conditions = self.conditions.iter().map(|condition| condition.replace('_', " "));
        let others = conditions.chain(self.caveats.0.iter().cloned()).filter(|other| !why.contains(other));
        let others: Vec<String> = self.chance_text().into_iter().chain(others).collect();
        std::iter::once(why.clone()).chain(others).collect::<Vec<_>>().join("; ")
    }

    /// Probability that the limit is reached within `hours` flight hours of the last flight: linear interpolation through
    /// 0 at that flight and the 5 %, 50 % and 95 % points of the time to limit.
    ///
    /// If a later quantile is beyond the horizon, the probability stays at the last known one and is a lower bound.
    /// `None` without the 5 % point.
    pub fn crossing_probability(&self, hours: f64) -> Option<f64> {
        let known = [
            (self.crossing_hours_p05, 0.05),
            (self.crossing_hours_p50, 0.50),
            (self.crossing_hours_p95, 0.95),
        ];
        let mut before = (0.0, 0.0);
        known[0].0?;
        for (at, chance) in known {
            let Some(at) = at else { return Some(before.1) };
            if hours < at {
                let share = (hours - before.0) / (at - before.0);
                return Some(before.1 + share.clamp(0.0, 1.0) * (chance - before.1));
            }
            before = (at, chance);
        }
        // The limit is reached already: the probability is 1, not that of the last quantile.
        Some(if before.0 == 0.0 { 1.0 } else { 0.95 })
    }

    /// The last change of the gap that neither wear nor a table explains.
    pub(crate) fn unexplained_change(&self) -> Option<&ChangePoint> {
        self.change_points.iter().rev().find(|change| matches!(change.kind, "step" | "reset" | "onset"))
    }

    fn of_limit(&self, more: Option<String>) -> String {
        let gap = match (self.gap_m, self.limit_m) {
            (Some(gap_m), Some(limit_m)) => format!("{:.1} of {:.1} µm", 1e6 * gap_m, 1e6 * limit_m),
            (Some(gap_m), None) => format!("{:.1} µm", 1e6 * gap_m),
            _ => "no gap".to_owned(),
        };
        let largest = self.is_by_largest().then(|| "largest along the stroke".to_owned());
        std::iter::once(gap).chain(largest).chain(more).collect::<Vec<_>>().join(", ")
    }

    fn over_since_text(&self) -> Option<String> {
        let first = self.change_points.iter().rev().find(|change| change.kind == "exceedance")?;
        Some(format!("over since {}", self.day(first.departure_utc)))
    }

    fn growth_text(&self) -> Option<String> {
        self.rate_m_per_hour.map(|rate| match 1e9 * rate {
            -0.05..0.05 => "steady".to_owned(),
            per_1000_hours => format!("{per_1000_hours:+.1} µm/1000 FH"),
        })
    }

    fn change_text(&self) -> Option<String> {
        let change = self.unexplained_change()?;
        let day = self.day(change.departure_utc);
        let cause =
            if change.tail_wide { ", with the other actuators of its tail" } else { ", not on record" };
        if change.kind == "onset" {
            return Some(format!("{} since {day}", self.of_limit(self.growth_text())));
        }
        let verb = if change.step_m < 0.0 { "fell" } else { "rose" };
        let moved = format!("{verb} by {:.1} µm on {day}{cause}", 1e6 * change.step_m.abs());
        Some(self.of_limit(Some(moved)))
    }
}

/// A probability for readers: `87 %`, `< 1 %`, `> 99 %`.
fn percent(share: f64) -> String {
    match 100.0 * share {
        ..1.0 => "< 1 %".to_owned(),
        percent if percent > 99.0 => "> 99 %".to_owned(),
        percent => format!("{percent:.0} %"),
    }
}

#[cfg(test)]
mod tests {
    use jiff::Timestamp;

    use super::percent;
    use crate::assessment::action::{Action, counts_text};
    use crate::row_schema::NoColumn;
    use crate::{ChangePoint, TrendRow};

    fn at(day: &str) -> Timestamp {
        format!("{day}T06:00:00Z").parse().unwrap()
    }

    fn change(kind: &'static str, day: &str, step_m: f64) -> ChangePoint {
        ChangePoint { departure_utc: at(day), kind, step_m, certainty: 1.0, ..ChangePoint::default() }
    }

    /// A unit at 159.13 µm of 180, on 24 November 2026.
    fn row(state: &'static str, reason_code: &'static str) -> TrendRow {
        TrendRow {
            state: Some(state),
            reason_code: Some(reason_code),
            reason: Some("the whole reason".to_owned()),
            gap_m: Some(159.13e-6),
            limit_m: Some(180e-6),
            rate_m_per_hour: Some(49e-9),
            as_of_utc: at("2026-11-24"),
            ..TrendRow::default()
        }
    }

    #[test]
    fn each_reason_has_its_few_words_and_its_chance() {
        let over = TrendRow {
            over_limit_probability: Some(0.873),
            change_points: vec![change("exceedance", "2026-11-06", 0.0)],
            ..row("act", "above_limit")
        };
        let soon = TrendRow {
            not_before_utc: Some(at("2026-12-14")),
            likely_utc: Some(at("2027-01-09")),
            not_after_utc: Some(at("2027-11-27")),
            ..row("plan", "crosses_soon")
        };
        let hours = TrendRow { crossing_hours_p05: Some(237.4), ..row("plan", "rises_to_limit") };
        let fell = TrendRow {
            change_points: vec![change("reset", "2026-10-07", -37.0e-6)],
            ..row("watch", "changed")
        };
        let still = TrendRow { rate_m_per_hour: Some(-1e-12), ..row("normal", "clear") };
        let measured = TrendRow { over_limit_probability: Some(1e-9), ..row("act", "inspected") };
        let gone = TrendRow { removed_utc: Some(at("2026-09-29")), state: None, ..still.clone() };
        let cases = [
            (&gone, "removed 29 Sep; last 159.1 µm", None),
            (&over, "159.1 of 180.0 µm, over since 6 Nov", Some("87 % over now")),
            (
                &soon,
                "159.1 of 180.0 µm, +49.0 µm/1000 FH",
                Some("5 % by 14 Dec, 50 % by 9 Jan, 95 % by 27 Nov 2027"),
            ),
            (&hours, "159.1 of 180.0 µm, +49.0 µm/1000 FH", Some("5 % within 237 FH")),
            (&fell, "159.1 of 180.0 µm, fell by 37.0 µm on 7 Oct, not on record", Some("certain")),
            (&still, "159.1 of 180.0 µm, steady", None),
            (&row("unassessed", "no_record"), "the whole reason", None),
            (&measured, "the whole reason", None),
        ];
        for (row, why, chance) in cases {
            assert_eq!((row.why_text().as_str(), row.chance_text().as_deref()), (why, chance));
        }
    }

    /// A unit that was removed is never counted.
    #[test]
    fn the_installed_units_are_counted_by_what_they_ask_for() {
        let fell = TrendRow {
            change_points: vec![change("reset", "2026-10-07", -37.0e-6)],
            ..row("watch", "changed")
        };
        let due = |day: &str| TrendRow { not_before_utc: Some(at(day)), ..row("plan", "crosses_soon") };
        let removed = TrendRow { state: None, removed_utc: Some(at("2026-09-29")), ..TrendRow::default() };
        let rows = [due("2026-12-28"), row("normal", "clear"), fell, due("2026-12-14"), removed];
        let rows = rows.map(|row| row.with_action(Action::Replace));
        assert_eq!(counts_text(&rows), "2 inspect, the first before 14 Dec · 1 record missing · 1 fine");
        assert_eq!(rows[2].action_text().as_deref(), Some("confirm and record the repair"));
        let over = row("act", "above_limit").with_action(Action::Replace);
        assert_eq!(counts_text([&over, &rows[3]]), "1 replace now · 1 inspect before 14 Dec");
    }

    #[test]
    fn the_quantiles_are_reproduced_and_nothing_beyond_them_is_claimed() {
        let all = [Some(100.0), Some(200.0), Some(400.0)];
        let cases = [
            (all, 0.0, Some(0.0)),
            (all, 100.0, Some(0.05)),
            (all, 200.0, Some(0.50)),
            (all, 400.0, Some(0.95)),
            // At the limit already; and beyond the horizon, where there is only a lower bound.
            ([Some(0.0); 3], 10.0, Some(1.0)),
            ([None; 3], 1e6, None),
            ([Some(100.0), None, None], 1e6, Some(0.05)),
        ];
        for ([p05, p50, p95], hours, expected) in cases {
            let row = TrendRow {
                crossing_hours_p05: p05,
                crossing_hours_p50: p50,
                crossing_hours_p95: p95,
                ..TrendRow::default()
            };
            assert_eq!(row.crossing_probability(hours), expected);
        }
    }

    #[test]
    fn no_probability_is_rounded_to_certainty() {
        let words = [0.0, 0.009, 0.011, 0.5, 0.98, 0.996, 1.0].map(percent);
        assert_eq!(words, ["< 1 %", "< 1 %", "1 %", "50 %", "98 %", "> 99 %", "> 99 %"]);
    }

    #[test]
    fn caveats_stay_apart_from_the_words() {
        let mut row = row("act", "above_limit");
        row.caveats = NoColumn(vec!["2 of 12 gaps are flagged".to_owned()]);
        row.conditions = vec!["friction_rising".to_owned()];
        assert!(!row.why_text().contains("flagged"));
        let all = "159.1 of 180.0 µm; friction rising; 2 of 12 gaps are flagged";
        assert_eq!(row.statement_text(), all);
    }
}
