//! What follows from a run: alerts and work requests.

mod alerts;
mod same_story;
