//! The paper's claims, and that its page and figures are those of the code.

use crate::paper::{Claims, page, pictures};

/// The whole of docs/pictures that this command writes, bytes.
const MOST_BYTES: usize = 600_000;

#[test]
fn the_claims_hold_and_the_page_is_that_of_the_code() {
    if !crate::gate::is_gate() {
        println!("skipped: 7 s of simulation; set FREEPLAY_TESTS=gate");
        return;
    }
    let claims = Claims::measure().unwrap();
    // Flights of 100 µm: the paper's statistic is within 2 % with everything known.
    assert!(claims.known.largest() < 2.0, "{:?}", claims.known);
    for change in claims.damping.iter().chain(&claims.mass) {
        assert!(change.largest() < 0.6, "{change:?}");
    }
    // S is δX − F/K low-passed: 10 % of the stiffness leaks a tenth of the difference of the mean loads over K.
    for change in &claims.stiffness {
        let leak = 100.0 * mean_load_apart_n(&claims) / 5e7 * (1.0 - change.factor.recip()) / 100e-6;
        assert!((change.percent[1] - leak).abs() < 0.35 * leak.abs() + 1e-9, "{change:?} against {leak}");
    }
    for one in claims.starts.iter().chain(&claims.spreads) {
        assert!(one.time_s < 0.2, "{} takes {} s", one.name, one.time_s);
    }
    for window in &claims.varying {
        assert!((window.gap_m / window.true_m - 1.0).abs() < 0.06, "{window:?}");
    }
    let drawn = pictures(&claims);
    let bytes: usize = drawn.iter().map(|(_, svg)| svg.len()).sum();
    assert!(bytes < MOST_BYTES, "{bytes} bytes of figures");
    let docs = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs");
    let kept = std::fs::read_to_string(docs.join("paper.md")).unwrap();
    let hint = "run: cargo run -p validation -- --paper docs";
    assert_eq!(kept, page(&claims), "{hint}");
    for (name, _) in drawn {
        assert!(docs.join("pictures").join(name).exists(), "{name} is missing; {hint}");
    }
}

/// Mean load of the samples of the upper set less that of the lower, N.
fn mean_load_apart_n(claims: &Claims) -> f64 {
    let mean = |is_upper: bool| {
        let level_m = claims.gap.mid_range_m;
        let loads = claims.states.iter().zip(&claims.flight.load_n);
        let loads: Vec<f64> =
            loads.filter(|(s, _)| (s.x[2] >= level_m) == is_upper).map(|(_, load)| *load).collect();
        loads.iter().sum::<f64>() / loads.len() as f64
    };
    mean(true) - mean(false)
}
