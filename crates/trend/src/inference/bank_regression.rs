//! Regressions of all candidates of a bank, from few passes of the filter.
//!
//! A pass is linear in the basis values, and the remaining squares of a curve are quadratic. So the regression
//! of a curve that is a multiple of a basis sequence, plus a line and a constant, follows from theirs.

use crate::inference::level_filter::{Pass, Regression};
use crate::inference::segment_fit::SegmentFit;
use crate::wear::bank::{BASES, BasisCoefficients, BasisMatrix, Candidate, CandidateBank};

/// Sequences that go through the filter together.
const LANES: usize = 4;

/// Every curve's regression on the gaps and the season's wave, in the bank's order.
pub(crate) fn regressions(fit: &SegmentFit<'_>, bank: &CandidateBank) -> Vec<Regression> {
    let basis_values = BasisMatrix::new(bank, fit.bins.iter().map(|b| b.usage - fit.segment.begin).collect());
    let mut passes = FilterPasses { fit, basis_values, lanes: vec![[0.0; LANES]; fit.bins.len()] };
    let mut regressions = vec![Regression::default(); bank.candidates.len()];
    let own: Vec<usize> =
        (0..bank.candidates.len()).filter(|&i| bank.candidates[i].basis.is_none()).collect();
    for group in own.chunks(LANES) {
        for (&index, pass) in group.iter().zip(passes.of_candidates(group, &bank.candidates)) {
            regressions[index] = pass;
        }
    }
    let basis_cache = passes.basis_cache(bank);
    for (regression, candidate) in regressions.iter_mut().zip(&bank.candidates) {
        if let Some((basis, coefficients)) = &candidate.basis {
            *regression = basis_cache.combined(*basis, coefficients);
        }
    }
    regressions
}

/// What is needed to pass sequences through the filter.
struct FilterPasses<'a> {
    fit: &'a SegmentFit<'a>,
    basis_values: BasisMatrix,
    lanes: Vec<[f64; LANES]>,
}

impl FilterPasses<'_> {
    /// Of some curves that have no part.
    fn of_candidates(&mut self, group: &[usize], candidates: &[Candidate]) -> [Regression; LANES] {
        for (lane, &index) in group.iter().enumerate() {
            self.basis_values.fill(&candidates[index], lane, &mut self.lanes);
        }
        self.fit.filter.regress_lanes(&self.fit.gaps, &self.fit.wave, &self.lanes)
    }

    /// Of the line, of one, and of the parts that a bank's curves have.
    fn basis_cache(&mut self, bank: &CandidateBank) -> BasisCache {
        let SegmentFit { filter, gaps, wave, .. } = self.fit;
        let bins = self.fit.bins.len();
        let (one, line) =
            (filter.pass(std::iter::repeat_n(1.0, bins)), filter.pass(self.basis_values.line()));
        let straight = |values: Vec<f64>| filter.regress(gaps, wave, &values);
        let ones = straight(vec![1.0; bins]);
        let one_by_line = filter.regress(&line, &one, &vec![1.0; bins]).sfy;
        let mut basis_cache = BasisCache {
            one: ones,
            line: straight(self.basis_values.line().collect()),
            one_by_line,
            basis_cache: [BasisRegression::default(); BASES],
        };
        let mut used = [false; BASES];
        bank.candidates
            .iter()
            .filter_map(|candidate| candidate.basis)
            .for_each(|(basis, _)| used[basis] = true);
        let used: Vec<usize> = (0..BASES).filter(|&basis| used[basis]).collect();
        for group in used.chunks(LANES) {
            for (&basis, found) in group.iter().zip(self.of_bases(group, &line, &one)) {
                basis_cache.basis_cache[basis] = found;
            }
        }
        basis_cache
    }

    fn of_bases(&mut self, group: &[usize], line: &Pass, one: &Pass) -> [BasisRegression; LANES] {
        for (lane, &basis) in group.iter().enumerate() {
            self.basis_values.fill_basis(basis, lane, &mut self.lanes);
        }
        let filter = &self.fit.filter;
        let own = filter.regress_lanes(&self.fit.gaps, &self.fit.wave, &self.lanes);
        let crossed = filter.regress_lanes(line, one, &self.lanes);
        std::array::from_fn(|i| BasisRegression {
            own: own[i],
            by_line: crossed[i].sfy,
            by_one: crossed[i].sfs,
        })
    }
}

/// A part's regression, and its products with the line and with one.
#[derive(Debug, Clone, Copy, Default)]
struct BasisRegression {
    own: Regression,
    by_line: f64,
    by_one: f64,
}

struct BasisCache {
    one: Regression,
    line: Regression,
    one_by_line: f64,
    basis_cache: [BasisRegression; BASES],
}

impl BasisCache {
    /// The regression of a part, the line and one, each times its factor.
    fn combined(&self, basis: usize, coefficients: &BasisCoefficients) -> Regression {
        let BasisRegression { own, by_line, by_one } = &self.basis_cache[basis];
        let BasisCoefficients { basis, line, one } = *coefficients;
        let sum = |of: fn(&Regression) -> f64| basis * of(own) + line * of(&self.line) + one * of(&self.one);
        let squares = basis * basis * own.sff + line * line * self.line.sff + one * one * self.one.sff;
        let products = basis * (line * by_line + one * by_one) + line * one * self.one_by_line;
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
    use crate::data::bins::Bin;
    use crate::data::segment::Segment;
    use crate::prior::fleet_prior::FleetPrior;

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
        let prior = FleetPrior::uninformative(1e-4);
        let fit = SegmentFit::new(&segment, &prior, bins, |usage| 1e-8 * usage);
        let bank = CandidateBank::new(false, None, 1700.0, 25, |_| true);
        for (candidate, found) in bank.candidates.iter().zip(regressions(&fit, &bank)) {
            let basis_values: Vec<f64> =
                fit.bins.iter().map(|b| candidate.law.value(candidate.age + b.usage)).collect();
            let direct = fit.filter.regress(&fit.gaps, &fit.wave, &basis_values);
            // What the largest height could make of each, to the ninth digit.
            let value = basis_values.iter().copied().fold(0.0, f64::max) + 1e-3;
            let alike = |a: f64, b: f64, scale: f64| (a - b).abs() < 1e-9 * scale;
            let (gaps, wave) = (fit.gaps.square.sqrt(), fit.wave.square.sqrt());
            let root = value * 1e7;
            assert!(
                alike(found.sff, direct.sff, root * root)
                    && alike(found.sfy, direct.sfy, root * gaps)
                    && alike(found.sfs, direct.sfs, root * wave)
                    && alike(found.end, direct.end, value)
                    && alike(found.start, direct.start, value),
                "{candidate:?}: {found:?}, {direct:?}"
            );
        }
    }
}
