//! What the units of one part number teach about the next.

use crate::classic::median;
use crate::rate;
use crate::series::Series;
use crate::trend::Rate;

/// Standard normal quantile of 95 %.
const Z95: f64 = 1.644_853_626_951_472_2;

/// The rates of a part number's units, learned from nothing later than a day.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FleetPrior {
    rate_m_per_hour: f64,
    rate_sd_m_per_hour: f64,
}

impl FleetPrior {
    /// Median and robust spread of the units' rates; nothing from fewer than five units with a rate.
    pub fn learn<'a>(fleet: impl IntoIterator<Item = &'a Series>, as_of_us: i64) -> Option<Self> {
        let mut rates: Vec<f64> = fleet
            .into_iter()
            .filter_map(|series| rate::fit(&rate::points(series.until(as_of_us)), None))
            .map(|fit| fit.rate.m_per_hour)
            .collect();
        if rates.len() < 5 {
            return None;
        }
        let rate_m_per_hour = median(&mut rates);
        let mut spread: Vec<f64> = rates.iter().map(|r| (r - rate_m_per_hour).abs()).collect();
        let rate_sd_m_per_hour = 1.4826 * median(&mut spread);
        (rate_sd_m_per_hour > 0.0).then_some(Self { rate_m_per_hour, rate_sd_m_per_hour })
    }

    /// A unit's rate, drawn to the fleet's as far as it is uncertain (both taken as normal).
    pub(crate) fn shrink(&self, own: Rate) -> Rate {
        let own_precision = ((own.p95_m_per_hour - own.p05_m_per_hour) / (2.0 * Z95)).powi(-2).min(1e30);
        let fleet_precision = self.rate_sd_m_per_hour.powi(-2);
        let precision = own_precision + fleet_precision;
        let m_per_hour =
            (own.m_per_hour * own_precision + self.rate_m_per_hour * fleet_precision) / precision;
        let reach = Z95 / precision.sqrt();
        Rate { p05_m_per_hour: m_per_hour - reach, m_per_hour, p95_m_per_hour: m_per_hour + reach }
    }
}
