//! The regressions of all curves of a bank, from few passes of the filter.
//!
//! A pass is linear in the heights, and what is left of a curve's squares is quadratic, so the regression
//! of a curve that is a multiple of a part, beside a line and a constant, follows from theirs.

use crate::curve::{Bank, Curve, Factors, Heights, PARTS};
use crate::filter::{Pass, Regression};
use crate::look::Look;

/// Sequences that go through the filter together.
const LANES: usize = 4;

/// Every curve's regression on the gaps and the season's wave, in the bank's order.
pub(crate) fn regressions(look: &Look<'_>, bank: &Bank) -> Vec<Regression> {
    let heights = Heights::new(bank, look.bins.iter().map(|b| b.usage - look.segment.begin).collect());
    let mut passes = Passes { look, heights, lanes: vec![[0.0; LANES]; look.bins.len()] };
    let mut regressions = vec![Regression::default(); bank.curves.len()];
    let own: Vec<usize> = (0..bank.curves.len()).filter(|&i| bank.curves[i].part.is_none()).collect();
    for group in own.chunks(LANES) {
        for (&index, pass) in group.iter().zip(passes.of_curves(group, &bank.curves)) {
            regressions[index] = pass;
        }
    }
    let parts = passes.parts(bank);
    for (regression, curve) in regressions.iter_mut().zip(&bank.curves) {
        if let Some((part, factors)) = &curve.part {
            *regression = parts.combined(*part, factors);
        }
    }
    regressions
}

/// What is needed to pass sequences through the filter.
struct Passes<'a> {
    look: &'a Look<'a>,
    heights: Heights,
    lanes: Vec<[f64; LANES]>,
}

impl Passes<'_> {
    /// Of some curves that have no part.
    fn of_curves(&mut self, group: &[usize], curves: &[Curve]) -> [Regression; LANES] {
        for (lane, &index) in group.iter().enumerate() {
            self.heights.fill(&curves[index], lane, &mut self.lanes);
        }
        self.look.filter.curves(&self.look.gaps, &self.look.wave, &self.lanes)
    }

    /// Of the line, of one, and of the parts that a bank's curves have.
    fn parts(&mut self, bank: &Bank) -> Parts {
        let Look { filter, gaps, wave, .. } = self.look;
        let bins = self.look.bins.len();
        let (one, line) = (filter.pass(std::iter::repeat_n(1.0, bins)), filter.pass(self.heights.line()));
        let straight = |values: Vec<f64>| filter.curve(gaps, wave, &values);
        let ones = straight(vec![1.0; bins]);
        let one_by_line = filter.curve(&line, &one, &vec![1.0; bins]).sfy;
        let mut parts = Parts {
            one: ones,
            line: straight(self.heights.line().collect()),
            one_by_line,
            parts: [Part::default(); PARTS],
        };
        let mut used = [false; PARTS];
        bank.curves.iter().filter_map(|curve| curve.part).for_each(|(part, _)| used[part] = true);
        let used: Vec<usize> = (0..PARTS).filter(|&part| used[part]).collect();
        for group in used.chunks(LANES) {
            for (&part, found) in group.iter().zip(self.of_parts(group, &line, &one)) {
                parts.parts[part] = found;
            }
        }
        parts
    }

    fn of_parts(&mut self, group: &[usize], line: &Pass, one: &Pass) -> [Part; LANES] {
        for (lane, &part) in group.iter().enumerate() {
            self.heights.fill_part(part, lane, &mut self.lanes);
        }
        let filter = &self.look.filter;
        let own = filter.curves(&self.look.gaps, &self.look.wave, &self.lanes);
        let crossed = filter.curves(line, one, &self.lanes);
        std::array::from_fn(|i| Part { own: own[i], by_line: crossed[i].sfy, by_one: crossed[i].sfs })
    }
}

/// A part's regression, and its products with the line and with one.
#[derive(Debug, Clone, Copy, Default)]
struct Part {
    own: Regression,
    by_line: f64,
    by_one: f64,
}

struct Parts {
    one: Regression,
    line: Regression,
    one_by_line: f64,
    parts: [Part; PARTS],
}

impl Parts {
    /// The regression of a part, the line and one, each times its factor.
    fn combined(&self, part: usize, factors: &Factors) -> Regression {
        let Part { own, by_line, by_one } = &self.parts[part];
        let Factors { part, line, one } = *factors;
        let sum = |of: fn(&Regression) -> f64| part * of(own) + line * of(&self.line) + one * of(&self.one);
        let squares = part * part * own.sff + line * line * self.line.sff + one * one * self.one.sff;
        let products = part * (line * by_line + one * by_one) + line * one * self.one_by_line;
        Regression {
            sff: squares + 2.0 * products,
            sfy: sum(|r| r.sfy),
            sfs: sum(|r| r.sfs),
            end: sum(|r| r.end),
            start: sum(|r| r.start),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bins::Bin;
    use crate::posterior::Segment;
    use crate::prior::FleetPrior;

    /// Against the filter's own pass over each curve's heights, for a unit of unknown age.
    #[test]
    fn a_curve_of_a_part_is_regressed_as_by_its_own_heights() {
        let bins: Vec<Bin> = (0..48)
            .map(|k| {
                let k = f64::from(k);
                Bin {
                    usage: 20.0 + 35.0 * k,
                    departure_us: 6e11 * k,
                    installation: 0,
                    gap_m: 30e-6 + 0.4e-6 * k + 1e-6 * (5.0 * k).sin(),
                    variance_m2: 0.3e-12,
                }
            })
            .collect();
        let segment = Segment { estimates: &[], begin: 0.0, now: 1700.0, fresh: false, known_age: None };
        let prior = FleetPrior::vague(1e-4);
        let look = Look::new(&segment, &prior, bins, |usage| 1e-8 * usage);
        let bank = Bank::new(false, None, 1700.0, 25, |_| true);
        for (curve, found) in bank.curves.iter().zip(regressions(&look, &bank)) {
            let heights: Vec<f64> = look.bins.iter().map(|b| curve.law.height(curve.age + b.usage)).collect();
            let direct = look.filter.curve(&look.gaps, &look.wave, &heights);
            // What the largest height could make of each, to the ninth digit.
            let height = heights.iter().copied().fold(0.0, f64::max) + 1e-3;
            let alike = |a: f64, b: f64, scale: f64| (a - b).abs() < 1e-9 * scale;
            let (gaps, wave) = (look.gaps.square.sqrt(), look.wave.square.sqrt());
            let root = height * 1e7;
            assert!(
                alike(found.sff, direct.sff, root * root)
                    && alike(found.sfy, direct.sfy, root * gaps)
                    && alike(found.sfs, direct.sfs, root * wave)
                    && alike(found.end, direct.end, height)
                    && alike(found.start, direct.start, height),
                "{curve:?}: {found:?}, {direct:?}"
            );
        }
    }
}
