//! Logs: layouts that are made row by row, and logs with known gaps.

mod ground_truth;
mod layouts;
