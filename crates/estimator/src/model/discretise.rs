//! Discretisation with the load held over a step (equations 18–23).

use nalgebra::{Matrix3, Matrix4, Matrix6, Vector3};

use crate::error::Error;
use crate::model::actuator::{ActuatorModel, positive};
use crate::model::matrix_exp::exponential;

/// x(k+1) = A_d x(k) + B_d u(k), with C_d = C = [1 0 0] (23).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DiscreteModel {
    /// A_d = e^{A Ts}, 3×3 (20).
    pub a_d: Matrix3<f64>,
    /// B_d = ∫₀^Ts e^{Aυ} B dυ, 3×1 (21).
    pub b_d: Vector3<f64>,
}

impl DiscreteModel {
    /// A_d (20) and B_d (21) at a step, s: exact for a load that is constant over each step.
    ///
    /// Both come out of one exponential: exp([A B; 0 0]·Ts) = [A_d B_d; 0 1] (van Loan 1978,
    /// <https://doi.org/10.1109/TAC.1978.1101743>).
    ///
    /// # Errors
    /// [`Error::Parameter`] for a step that is not positive and finite.
    pub(crate) fn new(actuator: &ActuatorModel, step_s: f64) -> Result<Self, Error> {
        positive("step_s", step_s)?;
        let mut whole = Matrix4::zeros();
        whole.fixed_view_mut::<3, 3>(0, 0).copy_from(&(actuator.a() * step_s));
        whole.fixed_view_mut::<3, 1>(0, 3).copy_from(&(actuator.b() * step_s));
        let exp = exponential(&whole);
        Ok(Self {
            a_d: exp.fixed_view::<3, 3>(0, 0).into_owned(),
            b_d: exp.fixed_view::<3, 1>(0, 3).into_owned(),
        })
    }
}

/// The covariance over one step of white noise of density `q_c` (3×3, per second) on the state:
/// ∫₀^Ts e^{Aυ} Q_c e^{Aᵀυ} dυ, by the exponential of [−A Q_c; 0 Aᵀ]·Ts (van Loan 1978).
pub(crate) fn white_covariance(actuator: &ActuatorModel, q_c: &Matrix3<f64>, step_s: f64) -> Matrix3<f64> {
    let a = actuator.a();
    let mut whole = Matrix6::zeros();
    whole.fixed_view_mut::<3, 3>(0, 0).copy_from(&(-a * step_s));
    whole.fixed_view_mut::<3, 3>(0, 3).copy_from(&(q_c * step_s));
    whole.fixed_view_mut::<3, 3>(3, 3).copy_from(&(a.transpose() * step_s));
    let exp = exponential(&whole);
    let a_d = exp.fixed_view::<3, 3>(3, 3).transpose();
    let q_d = a_d * exp.fixed_view::<3, 3>(0, 3);
    (q_d + q_d.transpose()) * 0.5
}
