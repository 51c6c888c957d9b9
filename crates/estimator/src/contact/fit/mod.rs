//! The regression: design matrix, robust fit, parameter search and the fit of both flanks.

pub(super) mod design_matrix;
pub(super) mod flank_fit;
pub(super) mod gauss_newton;
mod parameter_search;
mod robust_regression;
pub(super) mod scaling;
pub(super) mod sign_check;
pub(super) mod stroke_profile;
