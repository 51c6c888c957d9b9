//! The page `docs/paper.md`: the paper's figures, with a number for each claim.

use crate::paper::claims::{Change, Claims, Convergence};

/// The page.
pub fn page(claims: &Claims) -> String {
    [HEAD.to_owned(), figures(claims), CLAIMS.to_owned(), table(claims), details(claims)].concat()
}

const HEAD: &str = "\
# The paper, reproduced

This page repeats figures 2 to 7 of the paper and checks its claims. All data come from simulated flights of a known
gap. The paper gives neither parameters nor an accuracy, and its figures are normalised; here they are in SI units.

One command writes the page and its figures in about 6 s:

```sh
cargo run -p validation --bin paper -- --output docs
```

The flights have a gap of 100 µm, last 120 s and have 250 samples a second. Stiffness is 5·10⁷ N/m, screw mass 8 kg,
damping 2000 N·s/m, and friction follows equation 1 on both masses. The figures show the first of five flights.
`freeplay estimate LOG --trace FILE` writes the same quantities of your own log.

";

const CLAIMS: &str = "\
## The claims

| claim of the paper | measured | figure or table |
|---|---|---|
";

fn figures(claims: &Claims) -> String {
    let gap = &claims.gap;
    let um = |m: f64| 1e6 * m;
    format!(
        "\
## The figures

**Figure 2.** Position of motor and screw, with a zoom. The distance includes the constant offset δX₀.

![positions of motor and screw](pictures/paper-2-positions.svg)

**Figure 3.** Aerodynamic load.

![load](pictures/paper-3-load.svg)

**Figure 4.** Relative position, measured and estimated.

![relative position](pictures/paper-4-relative.svg)

**Figure 5.** Backlash S(t) with the means of its upper and lower set: {:.1} and {:.1} µm. Their difference is
ΔS = {:.1} µm.

![backlash against time](pictures/paper-5-backlash.svg)

**Figure 6.** Backlash against motor speed. Friction adds to the load or subtracts from it with the sign of the
speed, so each bound splits in two.

![backlash against speed](pictures/paper-6-speed.svg)

**Figure 7.** Backlash against load. The bound follows the sign of the load.

![backlash against load](pictures/paper-7-load.svg)

",
        um(gap.upper_m),
        um(gap.lower_m),
        um(gap.gap_m)
    )
}

fn table(claims: &Claims) -> String {
    let at = |changes: &[Change], factor: f64| {
        changes
            .iter()
            .find(|change| (change.factor / factor - 1.0).abs() < 1e-9)
            .map_or([f64::NAN; 3], |c| c.percent)
    };
    let mean = |changes: &[Change], factor: f64| at(changes, factor)[1];
    let [least, _, most] = claims.known.percent;
    let (starts_ms, spreads_ms) = (slowest_ms(&claims.starts), slowest_ms(&claims.spreads));
    let noise = [10.0, 30.0].map(|factor| mean(&claims.noise, factor));
    let tuning = [1e3, 1e-1, 1e-3].map(|factor| mean(&claims.tuning, factor));
    let stiffness = [0.9, 1.1].map(|factor| mean(&claims.stiffness, factor));
    let (damping, mass) = (largest(&claims.damping), largest(&claims.mass));
    let deviations = claims.varying.iter().map(|w| (w.gap_m / w.true_m - 1.0).abs());
    let window = 100.0 * deviations.fold(0.0, f64::max);
    format!(
        "\
| the size of the gap is estimated (29) | error {least:+.1} to {most:+.1} % with everything known | 5 |
| easy in real time, at very low cost | 185 operations in the worst step, and the same in each step | 8 |
| the estimated relative position converges | 1 % of the gap after at most {starts_ms:.0} ms from wrong states | 9 |
| the initial covariance does not matter | at most {spreads_ms:.0} ms with P₀ wrong by 10⁻⁶ to 10⁶ | 9 |
| measurement noise is filtered | error {:+.1} % at 10 times the noise, {:+.1} % at 30 times | 10 |
| known spectral densities W_d and V_d | W_d/V_d 1000 times too high: {:+.1} %; 10 times too low: {:+.1} %; 1000 times too low: {:+.0} % | 10 |
| damping is known | × 0.1 to × 100: ΔS changes by at most {damping:.2} % | 11 |
| mass is known | × 0.1 to × 100: ΔS changes by at most {mass:.2} % | 11 |
| stiffness is known | 10 % too low: {:+.0} %; 10 % too high: {:+.0} % | 11 |
| any form of backlash is followed | a gap that grows from 100 to 200 µm within the flight: each window of 12 s within {window:.0} % | 12 |

",
        noise[0], noise[1], tuning[0], tuning[1], tuning[2], stiffness[0], stiffness[1],
    )
}

fn largest(changes: &[Change]) -> f64 {
    changes.iter().map(Change::largest).fold(0.0, f64::max)
}

fn slowest_ms(all: &[Convergence]) -> f64 {
    1e3 * all.iter().map(|one| one.time_s).fold(0.0, f64::max)
}

fn details(claims: &Claims) -> String {
    let times = |all: &[Convergence]| {
        let rows = all.iter().map(|one| format!("| {} | {:.0} |\n", one.name, 1e3 * one.time_s));
        rows.collect::<String>()
    };
    format!(
        "\
**Table 8.** Operations of each equation in one step, counted by hand for three states. Equations 25 and 28
compute all nine entries of the covariance and average it with its transpose. A step has no branch on a measured
sample, so every step is the worst. [On board](rust.md#on-board) has instructions and stack on a controller.

| equation | × | + and − | ÷ |
|---|---|---|---|
| 24 state | 12 | 9 | 0 |
| 25 covariance | 63 | 54 | 0 |
| 26 gain | 0 | 1 | 3 |
| 27 corrected state | 3 | 4 | 0 |
| 28 corrected covariance | 18 | 18 | 0 |

**Figure 9.** Error of S after a wrong start, against S from the right one. Left: wrong states. Right: the backlash
1 mm off and P₀ wrong by a factor. The keys `initial_…` of [`[part.NAME.noise]`](configuration.md) set P₀.

![convergence from wrong starts](pictures/paper-convergence.svg)

| start | time to 1 % of the gap [ms] |
|---|---|
{}{}
**Figure 10.** Error of ΔS against the noise of both positions, and against W_d/V_d. Bars are the range over five
flights. V_d follows the noise of the positions, as `[part.NAME.noise]` does.

![sensitivity to noise](pictures/paper-noise.svg)

**Figure 11.** Change of ΔS when damping, mass or stiffness is assumed wrong. Only stiffness matters, because S is in
effect δX − F/K. The [contact regression](contact-regression.md) identifies the stiffness in the flight itself.

![sensitivity to parameters](pictures/paper-parameters.svg)

**Figure 12.** A gap that doubles within one flight, and ΔS of windows of 12 s.

![a gap that grows within the flight](pictures/paper-varying.svg)

## Where the paper's number is wrong

- A wrong stiffness moves it, by about 1 % for each 1 % here. The factor grows with the load over the gap.
- A gap of zero gives a positive number, and a load of one sign gives the noise.
- [Accuracy](accuracy.md) measures these and other conditions for both methods.
",
        times(&claims.starts),
        times(&claims.spreads),
    )
}
