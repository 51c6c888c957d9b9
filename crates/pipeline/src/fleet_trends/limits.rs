//! What units of each part number are judged by.

use job::Config;
use job::config::part::WearAxis;
use records::PartNumber;
use trend::UsageAxis;

/// Limits, axes and settings of part numbers, as they are configured.
#[derive(Clone, Copy)]
pub(crate) struct Limits<'a>(pub(crate) &'a Config);

impl<'a> Limits<'a> {
    /// Configured usage axis of a part's wear; nothing where its histories decide.
    pub(crate) fn axis(self, part: Option<&str>) -> Option<UsageAxis> {
        let configured = self.part(part).and_then(|p| p.axis).or(self.0.document.trend.axis)?;
        Some(match configured {
            WearAxis::Hours => UsageAxis::Hours,
            WearAxis::Flights => UsageAxis::Flights,
            WearAxis::Reversals => UsageAxis::Reversals,
        })
    }

    /// The act limit, m; none where neither the part nor the configuration states one.
    pub(crate) fn stated_m(self, part: Option<&str>) -> Option<f64> {
        self.part(part).and_then(|p| p.limit_m).or(self.0.document.trend.limit_m)
    }

    /// The act limit, m, or its stand-in.
    pub(crate) fn limit_m(self, part: Option<&str>) -> f64 {
        self.settings(part).limit_m
    }

    /// What is configured of a part.
    fn part(self, number: Option<&str>) -> Option<&'a job::Part> {
        number.and_then(|number| PartNumber::new(number).ok()).and_then(|number| self.0.parts.get(&number))
    }

    /// What a unit of a part is judged by. Without a limit there is still a level and a rate; only crossings and
    /// states need one.
    pub(crate) fn settings(self, part: Option<&str>) -> trend::Settings {
        /// A gap no actuator has: a stand-in that is never met and never shown.
        const NEVER_M: f64 = 1.0;
        let of = &self.0.document.trend;
        let base = trend::Settings::for_limit(self.stated_m(part).unwrap_or(NEVER_M));
        let watch_m = self.part(part).and_then(|p| p.watch_m).unwrap_or(base.watch_m);
        trend::Settings {
            // A part's own may lie above a limit that is everybody's.
            watch_m: watch_m.min(base.limit_m),
            planning_horizon_hours: of.planning_horizon_hours,
            horizon_hours: of.horizon_hours,
            stale_after_days: of.stale_after_days,
            check_interval_hours: of.next_check_hours,
            ..base
        }
    }
}
