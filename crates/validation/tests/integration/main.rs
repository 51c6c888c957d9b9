//! The accuracy study on few flights, and the claims of the paper.

mod coverage;
mod paper;
