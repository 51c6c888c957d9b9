//! A robust line through the estimates: level and rate now, and when that line meets the limit.

use crate::classic::{self, median};
use crate::prior::FleetPrior;
use crate::series::Flight;
use crate::settings::Settings;
use crate::trend::{Crossing, FEWEST_ESTIMATES, Level, Rate, Wear};

/// A gap at the unit's hours.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Point {
    pub(crate) hours: f64,
    pub(crate) gap_m: f64,
}

/// The flights with a gap.
pub(crate) fn points(flights: &[Flight]) -> Vec<Point> {
    flights.iter().filter_map(|f| f.gap.map(|gap| Point { hours: f.hours, gap_m: gap.gap_m })).collect()
}

/// A line at the unit's last hour.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Fit {
    pub(crate) level: Level,
    pub(crate) rate: Rate,
    span_hours: f64,
}

/// Growth that counts as wear, metres.
const VISIBLE_M: f64 = 2e-6;

/// Theil–Sen through all estimates with its 90 % limits; the level's error is the scatter about the
/// line (1.4826 MAD) at the end of a line, twice what it is in the middle.
pub(crate) fn fit(points: &[Point], prior: Option<&FleetPrior>) -> Option<Fit> {
    if points.len() < FEWEST_ESTIMATES {
        return None;
    }
    let (hours, gaps): (Vec<f64>, Vec<f64>) = points.iter().map(|p| (p.hours, p.gap_m)).unzip();
    let line = classic::theil_sen(&hours, &gaps, 0.9).ok()?;
    let mut residuals: Vec<f64> = points.iter().map(|p| p.gap_m - line.slope * p.hours).collect();
    let offset_m = median(&mut residuals);
    let mut spread: Vec<f64> = residuals.iter().map(|r| (r - offset_m).abs()).collect();
    let scatter_m = 1.4826 * median(&mut spread);
    let own =
        Rate { p05_m_per_hour: line.slope_low, m_per_hour: line.slope, p95_m_per_hour: line.slope_high };
    let last = hours.last()?;
    Some(Fit {
        level: Level {
            gap_m: offset_m + line.slope * last,
            se_m: 2.0 * scatter_m / (points.len() as f64).sqrt(),
        },
        rate: prior.map_or(own, |prior| prior.shrink(own)),
        span_hours: last - hours.first()?,
    })
}

impl Fit {
    /// Wear is believed when even the slow end of the interval has grown visibly.
    pub(crate) fn wear(&self) -> Wear {
        if self.rate.p05_m_per_hour * self.span_hours > VISIBLE_M { Wear::Wearing } else { Wear::Steady }
    }

    /// When the line meets the limit.
    pub(crate) fn crossing(&self, settings: &Settings) -> Crossing {
        let left_m = settings.limit_m - self.level.gap_m;
        let hours = |rate: f64| match left_m {
            left if left <= 0.0 => Some(0.0),
            _ if rate <= 0.0 => None,
            left => Some(left / rate).filter(|h| *h <= settings.horizon_hours),
        };
        Crossing {
            p05_hours: hours(self.rate.p95_m_per_hour),
            p50_hours: hours(self.rate.m_per_hour),
            p95_hours: hours(self.rate.p05_m_per_hour),
        }
    }
}
