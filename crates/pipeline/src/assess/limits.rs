//! Limits, usage axes and trend settings of each part number.

use job::Config;
use job::config::QuantityLimits;
use job::config::part::{AtLimit, LimitedGap, WearAxis};
use records::{Action, PartNumber};
use trend::{Series, UsageAxis};

/// Gaps of the fleet, by departure, that give its scale where no limit does.
const FIRST_GAPS: usize = 11;

/// A limit over the gap of a new unit, as the prior assumes it.
const LIMIT_OVER_NEW_GAP: f64 = 5.0;

/// Limits, axes and settings of part numbers, as they are configured.
#[derive(Clone, Copy)]
pub(crate) struct Limits<'a> {
    pub(crate) config: &'a Config,
    /// Scale of the gaps of parts without a limit, m.
    scale_m: f64,
}

impl<'a> Limits<'a> {
    /// The limits of a configuration; the fleet's first gaps replace those that are not configured.
    pub(crate) fn new<'s>(config: &'a Config, fleet: impl Iterator<Item = &'s Series>) -> Self {
        let first = |series: &'s Series| {
            let gaps = series.flights().iter().filter_map(|f| Some((f.departure_us, f.gap?.gap_m.abs())));
            gaps.take(FIRST_GAPS)
        };
        let mut gaps: Vec<(i64, f64)> = fleet.flat_map(first).collect();
        gaps.sort_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
        let first_m = gaps.into_iter().take(FIRST_GAPS).map(|(_, m)| m).collect();
        let median_m = trend::quantity::median(first_m).filter(|m| *m > 0.0);
        // Without a gap above zero nothing depends on the scale: any number does.
        Self { config, scale_m: LIMIT_OVER_NEW_GAP * median_m.unwrap_or(1e-5) }
    }

    /// Configured stiffness of a part, N/m.
    pub(crate) fn stiffness_n_per_m(self, part: &str) -> Option<f64> {
        Some(self.part(Some(part))?.actuator.stiffness_n_per_m())
    }

    /// Configured usage axis of a part's wear; nothing where its histories decide.
    pub(crate) fn axis(self, part: Option<&str>) -> Option<UsageAxis> {
        let configured =
            self.part(part).and_then(|part| part.settings.axis).or(self.config.document.trend.axis)?;
        Some(match configured {
            WearAxis::Hours => UsageAxis::Hours,
            WearAxis::Flights => UsageAxis::Flights,
            WearAxis::Reversals => UsageAxis::Reversals,
        })
    }

    /// The act limit, m; none where neither the part nor the configuration states one.
    pub(crate) fn stated_m(self, part: Option<&str>) -> Option<f64> {
        let part = part.and_then(|part| PartNumber::new(part).ok());
        self.config.limit_m(part.as_ref())
    }

    /// The act limit, m, or its stand-in.
    pub(crate) fn limit_m(self, part: Option<&str>) -> f64 {
        self.settings(part).limit_m
    }

    /// The gap that the limit of a part applies to: `largest` along the stroke, or its `mean`; none without a limit.
    pub(crate) fn applies_to(self, part: Option<&str>) -> Option<&'static str> {
        self.stated_m(part)?;
        let applies_to = self.part(part).and_then(|part| part.settings.limit_applies_to);
        Some(if applies_to == Some(LimitedGap::Largest) { "largest" } else { "mean" })
    }

    /// What a unit of a part whose gap is at its limit asks for: a replacement where the part says nothing.
    pub(crate) fn at_limit(self, part: Option<&str>) -> Action {
        match self.part(part).and_then(|part| part.settings.at_limit) {
            Some(AtLimit::Inspect) => Action::Inspect,
            _ => Action::Replace,
        }
    }

    /// Changes from which other quantities than the gap have a state.
    pub(crate) fn quantities(self, part: Option<&str>) -> QuantityLimits {
        let of_part = self.part(part).and_then(|part| part.settings.quantity_limits).unwrap_or_default();
        of_part.or(self.config.document.trend.quantity_limits)
    }

    fn part(self, number: Option<&str>) -> Option<&'a job::Part> {
        let number = PartNumber::new(number?).ok()?;
        self.config.parts.get(&number)
    }

    /// Trend settings of a part's units. Without a limit there is a level and a rate, but no crossing and no state.
    pub(crate) fn settings(self, part: Option<&str>) -> trend::Settings {
        let of = &self.config.document.trend;
        let base = trend::Settings::for_limit(self.stated_m(part).unwrap_or(self.scale_m));
        let watch_m = self.part(part).and_then(|part| part.settings.watch_m).unwrap_or(base.watch_m);
        trend::Settings {
            // The part's own watch limit may lie above the common act limit.
            watch_m: watch_m.min(base.limit_m),
            planning_horizon_hours: of.planning_horizon_hours,
            horizon_hours: of.horizon_hours,
            stale_after_days: of.stale_after_days,
            check_interval_hours: of.next_check_hours,
            ..base
        }
    }
}
