//! The other units of a part: their wear rates, and their gaps for the chart.

use std::collections::BTreeMap;

use crate::charts::frame::thinned;
use crate::model::{Report, UnitView};

/// Fewest peers whose median a rate is compared with.
const MIN_PEERS: usize = 3;
/// Rate over the peers' median from which a unit wears faster than its peers.
const FASTER: f64 = 3.0;
/// Most peers that a chart shows, and points of each.
const SHOWN: (usize, usize) = (6, 16);

/// Units of all part numbers, gathered once for all pages. A unit is never its own peer.
#[derive(Debug)]
pub struct Peers<'a>(BTreeMap<Option<&'a str>, PartUnits<'a>>);

#[derive(Debug, Default)]
struct PartUnits<'a> {
    /// Ascending wear rates of installed units, m/h.
    rates: Vec<f64>,
    curves: Vec<(&'a str, Vec<[f64; 2]>)>,
}

impl<'a> Peers<'a> {
    /// Gathers the units of a report.
    pub fn of(report: &'a Report) -> Self {
        let parts = report.by_part().into_values().map(|units| {
            let installed = units.iter().filter(|unit| unit.row.removed_utc.is_none());
            let mut rates: Vec<f64> = installed.filter_map(|unit| unit.row.rate_m_per_hour).collect();
            rates.sort_by(f64::total_cmp);
            let some = units.iter().step_by(units.len().div_ceil(SHOWN.0 + 1).max(1));
            let curve =
                |unit: &&'a UnitView| (unit.row.serial_number.as_str(), thinned(&unit.gaps(), SHOWN.1));
            (units[0].row.part_number.as_deref(), PartUnits { rates, curves: some.map(curve).collect() })
        });
        Self(parts.collect())
    }

    /// Median wear rate of the unit's peers, m/h; `None` for fewer than three.
    pub(crate) fn median_rate(&self, unit: &UnitView) -> Option<f64> {
        let rates = &self.0.get(&unit.row.part_number.as_deref())?.rates;
        let own = unit.row.rate_m_per_hour.filter(|_| unit.row.removed_utc.is_none());
        let own = own.map_or(rates.len(), |rate| rates.partition_point(|other| *other < rate));
        let peers = rates.len() - usize::from(own < rates.len());
        let without_own = |k: usize| rates[k + usize::from(k >= own)];
        let middle = |k: usize| f64::midpoint(without_own((k - 1) / 2), without_own(k / 2));
        (peers >= MIN_PEERS).then(|| middle(peers))
    }

    /// How many times faster than its peers the unit wears: `9 × the median of its part`.
    pub(crate) fn faster_text(&self, unit: &UnitView) -> Option<String> {
        let ratio = unit.row.rate_m_per_hour? / self.median_rate(unit).filter(|median| *median > 0.0)?;
        (ratio >= FASTER).then(|| format!("{ratio:.0} × the median of its part"))
    }

    pub(crate) fn curves<'s>(&'s self, unit: &'s UnitView) -> impl Iterator<Item = &'s [[f64; 2]]> {
        let part = self.0.get(&unit.row.part_number.as_deref());
        let others = part.into_iter().flat_map(|part| &part.curves);
        let others = others.filter(|(serial, _)| *serial != unit.row.serial_number);
        others.take(SHOWN.0).map(|(_, curve)| curve.as_slice())
    }
}

#[cfg(test)]
mod tests {
    use records::TrendRow;

    use super::*;

    /// Peers of the fastest: 2, 4, 6 and 8 µm per 1,000 h, median 5, by hand.
    #[test]
    fn a_unit_is_compared_with_the_others_of_its_part() {
        let unit = |um: f64| UnitView {
            row: TrendRow { rate_m_per_hour: Some(um * 1e-9), ..TrendRow::default() },
            ..UnitView::default()
        };
        let report = Report { units: [8.0, 45.0, 2.0, 6.0, 4.0].map(unit).into(), ..Report::default() };
        let peers = Peers::of(&report);
        let text = |k: usize| peers.faster_text(&report.units[k]);
        assert_eq!((text(1).as_deref(), text(0)), (Some("9 × the median of its part"), None));
        let few = Report { units: [1.0, 2.0, 45.0].map(unit).into(), ..Report::default() };
        assert_eq!(Peers::of(&few).faster_text(&few.units[2]), None);
    }
}
