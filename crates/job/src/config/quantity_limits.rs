//! Changes of the followed quantities other than the gap from which there is a state.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_with::skip_serializing_none;

/// `[trend.quantity_limits]`, and `[part."…".quantity_limits]` for one part: changes since a unit's first flights from
/// which a followed quantity has a state.
#[skip_serializing_none]
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct QuantityLimits {
    /// Stiffness, as a share of the unit's own. Default 0.05.
    pub stiffness_share: Option<f64>,
    /// Friction at the unit's usual load, as a share of its own. Default 0.1.
    pub friction_share: Option<f64>,
    /// Lost motion at the reference load, as a share of the unit's own. Default 0.25.
    pub lost_motion_share: Option<f64>,
    /// Delay between the positions, s. Default 0.0005.
    pub delay_s: Option<f64>,
    /// Load zero, as a share of the unit's usual 95 % load. Default 0.02.
    pub load_zero_share: Option<f64>,
    /// Delay of the load, s. Default 0.001.
    pub load_delay_s: Option<f64>,
    /// Mean NIS, as a share of the unit's own. Default 1.
    pub nis_share: Option<f64>,
}

impl QuantityLimits {
    /// These limits, and others where a key is not given.
    #[must_use]
    pub fn or(self, other: Self) -> Self {
        Self {
            stiffness_share: self.stiffness_share.or(other.stiffness_share),
            friction_share: self.friction_share.or(other.friction_share),
            lost_motion_share: self.lost_motion_share.or(other.lost_motion_share),
            delay_s: self.delay_s.or(other.delay_s),
            load_zero_share: self.load_zero_share.or(other.load_zero_share),
            load_delay_s: self.load_delay_s.or(other.load_delay_s),
            nis_share: self.nis_share.or(other.nis_share),
        }
    }
}
