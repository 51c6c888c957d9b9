//! Model: actuator parameters at the screw axis, discretisation and noise covariances.

mod actuator;
mod discretise;
mod matrix_exp;
mod noise;

pub use actuator::ActuatorModel;
pub(crate) use actuator::positive;
pub use discretise::DiscreteModel;
pub(crate) use noise::not_negative;
pub use noise::{NoiseCovariances, NoiseModel, SensorNoise};
