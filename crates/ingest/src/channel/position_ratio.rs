//! Ratio of the two positions of an actuator: how far the screw moves for a metre of the motor at the screw axis.

use crate::channel::stats::quantile;

/// Samples that are compared at most.
const MAX_SAMPLES: usize = 20_000;
/// Rounds of reweighting, and residuals that count for nothing, in robust standard deviations (Tukey's bisquare).
const ROUNDS: usize = 20;
const TUNING: f64 = 4.685;
/// Share of the motion that the load must leave unexplained, or the ratio cannot be told from the wind-up.
const OWN_SHARE: f64 = 0.02;

/// Ratio of the screw to the motor position, m per m: 1 when both are mapped correctly, −1 when a sign is wrong, another
/// number when a lead, gear or unit is.
///
/// δX is fitted by the motor position and the load, which winds the actuator up, by least squares with Tukey's bisquare
/// weights (Beaton and Tukey 1974, <https://doi.org/10.1080/00401706.1974.10489171>): spikes of a sensor count for nothing.
/// Input: motor position and δX in m, load in N, of one length; NaN where missing. `None` when the motor does not move, or
/// only with the load.
pub fn position_ratio(motor_m: &[f64], dx_m: &[f64], load_n: &[f64]) -> Option<f64> {
    let rows = motor_m.iter().zip(dx_m).zip(load_n).map(|((m, d), f)| [*m, *d, *f]);
    let known = |row: &[f64; 3]| row.iter().all(|v| !v.is_nan());
    let stride = motor_m.len().div_ceil(MAX_SAMPLES).max(1);
    let samples: Vec<[f64; 3]> = rows.step_by(stride).filter(known).collect();
    let mut weights: Vec<f64> = vec![1.0; samples.len()];
    for channel in 0..2 {
        let (low, high) = usual_range(samples.iter().map(|row| row[channel]).collect())?;
        let is_usual = |row: &[f64; 3]| (low..=high).contains(&row[channel]);
        samples.iter().zip(&mut weights).filter(|(row, _)| !is_usual(row)).for_each(|(_, w)| *w = 0.0);
    }
    let mut slope = None;
    for _ in 0..ROUNDS {
        let plane = Plane::fit(&samples, &weights)?;
        slope = Some(1.0 + plane.of_motor);
        let residuals: Vec<f64> = samples.iter().map(|row| plane.residual(row).abs()).collect();
        let far = TUNING * 1.4826 * quantile(&mut residuals.clone(), 0.5)?;
        let share = |r: f64| if far > 0.0 { r / far } else { 0.0 };
        weights = residuals.iter().map(|r| (1.0 - share(*r).powi(2)).max(0.0).powi(2)).collect();
    }
    slope
}

/// The values from the 1 % to the 99 % quantile, and as much again on either side.
fn usual_range(mut values: Vec<f64>) -> Option<(f64, f64)> {
    let (low, high) = (quantile(&mut values, 0.01)?, quantile(&mut values, 0.99)?);
    Some((2.0 * low - high, 2.0 * high - low))
}

/// δX = offset + of_motor · motor + of_load · load.
struct Plane {
    means: [f64; 3],
    of_motor: f64,
    of_load: f64,
}

impl Plane {
    /// By weighted least squares; `None` where the motor does not move by itself.
    fn fit(samples: &[[f64; 3]], weights: &[f64]) -> Option<Self> {
        let weighted = || samples.iter().zip(weights);
        let sum: f64 = weights.iter().sum();
        let means: [f64; 3] =
            std::array::from_fn(|k| weighted().map(|(row, w)| w * row[k]).sum::<f64>() / sum);
        let product = |a: usize, b: usize| -> f64 {
            weighted().map(|(row, w)| w * (row[a] - means[a]) * (row[b] - means[b])).sum()
        };
        let (mm, md, mf, ff, fd) =
            (product(0, 0), product(0, 1), product(0, 2), product(2, 2), product(2, 1));
        let by_load = if ff > 0.0 { mf / ff } else { 0.0 };
        let own = mm - by_load * mf;
        if own.is_nan() || own <= OWN_SHARE * mm {
            return None;
        }
        let of_motor = (md - by_load * fd) / own;
        let of_load = if ff > 0.0 { (fd - of_motor * mf) / ff } else { 0.0 };
        Some(Self { means, of_motor, of_load })
    }

    fn residual(&self, row: &[f64; 3]) -> f64 {
        let [motor, dx, load] = std::array::from_fn(|k| row[k] - self.means[k]);
        dx - self.of_motor * motor - self.of_load * load
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The plane is exact: the ratio is the one that was put in, whatever the wind-up (here 10 % of the motion).
    #[test]
    fn a_flipped_sign_and_a_wrong_ratio_show_beside_wind_up_and_spikes() {
        let motor: Vec<f64> = (0..1000).map(|i| 0.03 * (f64::from(i) * 0.1).sin()).collect();
        let load: Vec<f64> = (0..1000).map(|i| 8e3 * (f64::from(i) * 0.1 + 0.5).sin()).collect();
        for ratio in [1.0, -1.0, 25.4] {
            let of = |(m, f): (&f64, &f64)| (ratio - 1.0) * m + f / 2.6e6 + 0.01;
            let mut dx: Vec<f64> = motor.iter().zip(&load).map(of).collect();
            let mut spiked = motor.clone();
            for at in [100, 500, 700] {
                spiked[at] += 1.0;
                dx[at] -= 1.0;
            }
            assert!((position_ratio(&spiked, &dx, &load).unwrap() - ratio).abs() < 1e-9, "{ratio}");
        }
        assert_eq!(position_ratio(&[0.0; 5], &[1.0; 5], &[2.0; 5]), None);
        assert_eq!(position_ratio(&motor, &motor, &motor), None);
    }
}
