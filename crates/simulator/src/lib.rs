//! Two masses, a compliant dead zone and friction: flights whose backlash gap is known.
//!
//! The physics is written in absolute coordinates, motor and screw each with its own position, and
//! shares no equation with the estimator: a model cannot be its own witness. The way through the
//! rooms is [`Plant`] (what moves) and [`Profile`] (what it is asked to do), integrated by
//! [`two_mass`], read through [`Sensors`] into a [`Flight`]; a [`Spec`] makes a whole [`Plan`] of
//! tails, serial numbers and flights out of these.
//!
//! Nothing here reads a file, a clock or the environment: the same seed gives the same bits, in any
//! order of asking.

pub mod contact;
pub mod drive;
pub mod error;
pub mod flight;
pub mod friction;
pub mod plan;
pub mod plant;
pub mod profile;
pub mod sensor;
pub mod spec;
pub mod turbulence;
pub mod two_mass;
pub mod vibration;
pub mod wear;

mod calendar;
mod channel_sampler;
mod course;
mod planner;
mod random;
mod roster;
mod shaping_filter;

pub use error::Error;
pub use flight::{Expected, Flight, simulate};
pub use plan::{ActuatorLog, ActuatorTruth, Installation, Plan, PlannedFlight, SimulatedFlight, Unit};
pub use plant::Plant;
pub use profile::Profile;
pub use sensor::Sensors;
pub use spec::{SAMPLE_SPEC, Spec};
