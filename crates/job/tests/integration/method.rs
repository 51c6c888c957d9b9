//! What each method of `[estimate]` puts into a record, on the flights of another engine.

use job::Config;
use job::config::Method;
use records::{GapEstimate, Status};

use crate::fixtures::{flights, open};

fn estimate(config: &Config, log: &str) -> GapEstimate {
    let opened = open(log, config).unwrap();
    let at = opened.actuators().next().unwrap();
    let (_, part) = opened.unit(at).unwrap();
    opened.estimate(at, part).unwrap().0
}

/// Only the published statistic is there; a load that never reverses is refused without the regression, too.
#[test]
fn midrange_has_no_column_of_the_regression() {
    let contact = Config::read(&flights().join("pipeline.toml")).unwrap();
    let mut midrange = contact.clone();
    midrange.document.estimate.method = Method::Midrange;

    let (by_contact, found) = (estimate(&contact, "A_nominal"), estimate(&midrange, "A_nominal"));
    assert!(by_contact.stiffness_n_per_m.is_some() && by_contact.gap_se_m.is_some());
    assert_eq!(found.gap_m, by_contact.gap_midrange_m);
    let wanted = GapEstimate {
        status: Status::Estimated,
        gap_m: by_contact.gap_midrange_m,
        gap_midrange_m: by_contact.gap_midrange_m,
        load_reversals: by_contact.load_reversals,
        samples: by_contact.samples,
        samples_upper: by_contact.samples_upper,
        samples_lower: by_contact.samples_lower,
        load_p05_n: by_contact.load_p05_n,
        load_p95_n: by_contact.load_p95_n,
        nis: by_contact.nis,
        nis_se: by_contact.nis_se,
        ..GapEstimate::default()
    };
    assert_eq!(found, wanted);

    let refused = estimate(&midrange, "D_no_reversal");
    assert_eq!((refused.status, refused.reason.as_deref()), (Status::Refused, Some("no_load_reversal")));
    assert!(refused.gap_m.is_none() && refused.gap_midrange_m.is_some());
}
