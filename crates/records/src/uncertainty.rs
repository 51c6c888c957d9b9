//! Factors between standard error, interval and median absolute deviation of a normal distribution.

/// 95 % quantile of the standard normal distribution: half the width of a 90 % interval, in standard errors.
pub const NORMAL_95: f64 = 1.644_853_626_951_472_2;

/// Standard deviation over median absolute deviation of a normal distribution (Hampel 1974).
pub const SD_OVER_MAD: f64 = 1.4826;
