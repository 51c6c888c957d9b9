//! Values of one channel: conversion to SI, statistics, quality flags, noise floor.

pub(crate) mod buffer_pool;
pub(crate) mod column_builder;
pub(crate) mod missing_code;
pub mod noise_floor;
pub mod position_ratio;
pub(crate) mod quality;
pub(crate) mod si_conversion;
pub(crate) mod stats;
pub(crate) mod turns;
