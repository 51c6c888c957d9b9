//! The accuracy study on few flights, and the claims of the paper.

mod coverage;
#[path = "../../../../tests/gate.rs"]
mod gate;
mod paper;
