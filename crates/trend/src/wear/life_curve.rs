//! Whole-life wear curves: wear whose rate changes at a share of the life, known before the change.
//!
//! A power or an exponential has no change of rate to come, and a bend only one that was observed. Life curves separate
//! a fleet whose units all wear out late from one whose units do not: the share of each curve is learned, and a unit
//! that still wears evenly is forecast from the other units. Wear in three stages is the textbook's
//! (running in, steady wear, wearing out). The curves were drawn by hand; which of them stay was decided by the
//! forecast errors on simulated fleets (docs/prognostics.md).

/// Heights at every tenth of a life, as shares of the growth in it; further on in a line.
const LIFE_CURVES: [[f64; TENTHS + 1]; COUNT] = [
    // Runs in, wears steadily, wears out.
    [0.0, 0.14, 0.21, 0.27, 0.33, 0.39, 0.46, 0.54, 0.65, 0.80, 1.0],
    [0.0, 0.09, 0.13, 0.16, 0.19, 0.22, 0.27, 0.35, 0.48, 0.70, 1.0],
    // Slow, fast, slow.
    [0.0, 0.045, 0.11, 0.21, 0.34, 0.50, 0.66, 0.79, 0.89, 0.955, 1.0],
    [0.0, 0.015, 0.05, 0.13, 0.29, 0.50, 0.71, 0.87, 0.95, 0.985, 1.0],
    // Steady, then away.
    [0.0, 0.03, 0.063, 0.103, 0.15, 0.208, 0.28, 0.37, 0.50, 0.685, 1.0],
    [0.0, 0.013, 0.03, 0.05, 0.076, 0.11, 0.155, 0.225, 0.335, 0.53, 1.0],
    // Steady, then twice as fast.
    [0.0, 0.055, 0.11, 0.165, 0.22, 0.28, 0.40, 0.55, 0.70, 0.85, 1.0],
];

const TENTHS: usize = 10;

/// Number of life curves.
pub(crate) const COUNT: usize = 7;

/// Grid of lives, hours, and its cell width in ln life.
pub(crate) const LIVES: [f64; 10] =
    [600.0, 810.0, 1094.0, 1476.0, 1993.0, 2690.0, 3632.0, 4903.0, 6619.0, 8936.0];
pub(crate) const LN_LIFE_CELL: f64 = 0.3;

/// One life curve over one life.
#[derive(Debug, Clone, Copy)]
pub(crate) struct LifeCurve {
    basis_values: &'static [f64; TENTHS + 1],
    life: f64,
}

impl LifeCurve {
    /// The curve of an index into the shapes and one into the lives.
    pub(crate) fn new(shape: usize, life: usize) -> Self {
        Self { basis_values: &LIFE_CURVES[shape], life: LIVES[life] }
    }

    /// The height at an age.
    pub(crate) fn value(self, age: f64) -> f64 {
        let (tenth, past) = self.tenth(age);
        self.basis_values[tenth] + self.rise(tenth) * past
    }

    /// Its rise at an age, per hour.
    pub(crate) fn derivative(self, age: f64) -> f64 {
        self.rise(self.tenth(age).0) * TENTHS as f64 / self.life
    }

    /// The age at which a height is reached.
    pub(crate) fn inverse(self, value: f64) -> f64 {
        let tenth = self.basis_values[1..TENTHS].partition_point(|reached| *reached < value);
        let past = (value - self.basis_values[tenth]) / self.rise(tenth);
        (tenth as f64 + past) * self.life / TENTHS as f64
    }

    /// The rise a tenth of a life after an age, over that at it.
    pub(crate) fn rate_ratio(self, age: f64) -> f64 {
        self.derivative(age + self.life / TENTHS as f64) / self.derivative(age)
    }

    /// The tenth of the life that contains an age, and how far it is past its begin, in tenths.
    fn tenth(self, age: f64) -> (usize, f64) {
        let tenths = (age / self.life * TENTHS as f64).max(0.0);
        let tenth = (tenths as usize).min(TENTHS - 1);
        (tenth, tenths - tenth as f64)
    }

    fn rise(self, tenth: usize) -> f64 {
        self.basis_values[tenth + 1] - self.basis_values[tenth]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn all() -> impl Iterator<Item = LifeCurve> {
        (0..COUNT).flat_map(|shape| (0..LIVES.len()).map(move |life| LifeCurve::new(shape, life)))
    }

    #[test]
    fn a_course_grows_by_one_in_its_life_and_never_stands_still() {
        for shape in all() {
            assert!((shape.value(shape.life) - 1.0).abs() < 1e-12 && shape.value(0.0) == 0.0);
            assert!((0..20).all(|tenth| shape.derivative(0.1 * shape.life * f64::from(tenth)) > 0.0));
        }
    }

    #[test]
    fn the_age_of_a_height_is_the_height_of_an_age_turned_round_beyond_the_life_too() {
        for shape in all() {
            for share in [0.0, 0.05, 0.34, 0.61, 0.999, 1.0, 1.7] {
                let age = share * shape.life;
                assert!((shape.inverse(shape.value(age)) - age).abs() < 1e-9 * shape.life, "{shape:?} {age}");
            }
        }
    }

    /// By hand: of the first shape at a life of 600 h, 0.06 + 0.08/2 more after 345 h; a tenth is 60 h.
    #[test]
    fn heights_between_tenths_lie_on_lines() {
        let shape = LifeCurve::new(0, 0);
        assert!((shape.value(450.0) - 0.595).abs() < 1e-12);
        assert!((shape.derivative(450.0) - 0.11 / 60.0).abs() < 1e-15);
        assert!((shape.rate_ratio(450.0) - 0.15 / 0.11).abs() < 1e-12);
    }
}
