//! Model: actuator parameters at the screw axis, discretisation and noise covariances.

mod actuator;
mod discretise;
mod matrix_exp;
mod noise;

pub(crate) use actuator::positive;
pub use actuator::{ActuatorModel, friction_n, motor_position_m, reflected_mass_kg};
pub use discretise::DiscreteModel;
pub use noise::{NoiseCovariances, NoiseModel, SensorNoise};
