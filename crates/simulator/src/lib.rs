//! Simulated flights of electromechanical actuators whose backlash gap is known.
//!
//! The model has two masses, a compliant dead zone and friction. The physics is written in absolute
//! coordinates, motor and screw each with its own position, and shares no equation with the
//! estimator: a model cannot verify itself. Every assumption of the estimator can be broken by a key
//! of a [`Spec`].
//!
//! [`Plant`] (what moves) and [`Profile`] (commands and loads) are integrated by Newton's law and read
//! through [`Sensors`] into a [`Flight`] by [`simulate`]. A [`Spec`] makes a whole [`Plan`] of tails,
//! serial numbers and flights.
//!
//! Nothing here reads a file, a clock or the environment: equal seeds give bitwise identical
//! flights, in any order of calls.

mod error;
mod fleet;
mod flight;
mod load;
mod plant;
mod ranges;
mod seeded_streams;
mod sensors;

pub use error::Error;
pub use fleet::fleet_events::FaultKind;
pub use fleet::fleet_plan::{
    ActuatorLog, ChannelUnit, Plan, PlannedActuator, PlannedFlight, SimulatedFlight,
};
pub use fleet::fleet_spec::{MotorLogFormat, Part, Position, SAMPLE_SPEC, ScrewLogUnit, Spec};
pub use flight::{Flight, check, simulate};
pub use load::flight_profile::Profile;
pub use load::turbulence::GustForm;
pub use load::vibration::{Line, Vibration};
pub use plant::actuator_plant::Plant;
pub use plant::backlash_contact::{Contact, ContactLaw};
pub use plant::friction::{Friction, FrictionLaw};
pub use sensors::sensor::{Channel, NoiseColour, PeriodicError, Sensors};
