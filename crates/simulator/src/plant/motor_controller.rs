//! The motor's position loop: a proportional position loop around a proportional-integral speed loop.

use std::f64::consts::TAU;

use serde::{Deserialize, Serialize};
use smart_default::SmartDefault;

/// The loop's bandwidths and limits, all at the screw.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, SmartDefault)]
#[serde(deny_unknown_fields, default)]
pub struct Drive {
    #[default(6.0)]
    pub position_hz: f64,
    #[default(40.0)]
    pub speed_hz: f64,
    #[default(40e3)]
    pub force_limit_n: f64,
    #[default(0.15)]
    pub speed_limit_m_per_s: f64,
}

/// The state of a drive: its gains for one moved mass, and its integrator.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PositionLoop {
    drive: Drive,
    gain_n_s_per_m: f64,
    integral_n: f64,
}

impl PositionLoop {
    /// A loop tuned for the mass it moves.
    pub(crate) fn new(drive: Drive, moved_kg: f64) -> Self {
        Self { drive, gain_n_s_per_m: TAU * drive.speed_hz * moved_kg, integral_n: 0.0 }
    }

    /// The commanded motor force over the next step, N.
    ///
    /// The integrator has a fifth of the speed loop's bandwidth and holds its value while the force
    /// saturates, so it does not wind up.
    pub(crate) fn force_n(&mut self, command_m: f64, motor_m: f64, motor_m_per_s: f64, step_s: f64) -> f64 {
        let limit = self.drive.speed_limit_m_per_s;
        let wanted = (TAU * self.drive.position_hz * (command_m - motor_m)).clamp(-limit, limit);
        let push_n = self.gain_n_s_per_m * (wanted - motor_m_per_s);
        let asked_n = push_n + self.integral_n;
        let force_n = asked_n.clamp(-self.drive.force_limit_n, self.drive.force_limit_n);
        if asked_n.abs() < self.drive.force_limit_n {
            self.integral_n += TAU * 0.2 * self.drive.speed_hz * push_n * step_s;
        }
        force_n
    }
}

#[cfg(test)]
#[expect(clippy::float_cmp, reason = "these values are exact")]
mod tests {
    use super::*;

    #[test]
    fn a_loop_pushes_towards_its_command_and_never_harder_than_its_limit() {
        let drive = Drive::default();
        let mut slow = PositionLoop::new(drive, 88.0);
        assert_eq!(slow.force_n(1.0, 0.0, -10.0, 1e-4), drive.force_limit_n);
        assert_eq!(slow.integral_n, 0.0);
        let mut calm = PositionLoop::new(drive, 88.0);
        assert!(calm.force_n(0.0, 1e-6, 0.0, 1e-4) < 0.0);
    }
}
