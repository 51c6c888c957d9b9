//! How long answers take: `cargo test -p store --release -- --ignored --nocapture measured`.

use std::path::PathBuf;
use std::time::Instant;

use store::{Format, LogResult, Query, Store};

use crate::fixtures::{departure, result, run, writer};

const TAILS: usize = 100;
const FLIGHTS: i64 = 1_000;
const PER_COMMIT: i64 = 50;

fn timed<T>(what: &str, work: impl FnOnce() -> T) -> T {
    let clock = Instant::now();
    let made = work();
    println!("{what:<44} {:>9.1} ms", clock.elapsed().as_secs_f64() * 1e3);
    made
}

/// Set `FREEPLAY_TEST_STORE` to a folder to keep the store, e.g. to open it with another engine.
#[test]
#[ignore = "fills a store with 300,000 records and 100,000 accounts"]
fn measured() {
    let made = tempfile::tempdir().unwrap();
    let dir =
        std::env::var_os("FREEPLAY_TEST_STORE").map_or_else(|| made.path().join("results"), PathBuf::from);
    let mut writer = writer(&dir);
    timed("20 commits of 5,000 flights", || {
        for first in (0..FLIGHTS).step_by(PER_COMMIT as usize) {
            let flights =
                (first..first + PER_COMMIT).flat_map(|f| (0..TAILS).map(move |tail| result(tail, f, 4e-5)));
            writer.commit(&flights.collect::<Vec<LogResult>>()).unwrap();
        }
    });
    writer.end_run(&run("a", "2026-11-20T02:00:00Z", Some(0))).unwrap();
    for pass in ["as committed", "compacted"] {
        println!("{pass}: {} files", writer.store().files().unwrap().len());
        let store = timed("open", || Store::open(&dir).unwrap());
        assert_eq!(timed("100,000 accounts", || store.accounts().unwrap()).len(), 100_000);
        let year = departure(FLIGHTS - 365);
        let tail = Query { tail_number: Some("N7".into()), since_utc: Some(year), ..Query::default() };
        assert_eq!(timed("a tail's last year, first", || store.records(&tail).unwrap()).len(), 1_095);
        assert_eq!(timed("a tail's last year, again", || store.records(&tail).unwrap()).len(), 1_095);
        let serial = Query { serial_number: Some("S-7-elevator".into()), ..Query::default() };
        assert_eq!(timed("a unit's whole life", || store.records(&serial).unwrap()).len(), 1_000);
        assert_eq!(timed("serials", || store.distinct("serial_number").unwrap()).len(), 3 * TAILS);
        timed("info", || store.info().unwrap());
        assert_eq!(timed("verify", || store.verify()), []);
        let rows =
            timed("export of all as CSV", || store.export(&Query::default(), Format::Csv, std::io::sink()));
        assert_eq!(rows.unwrap(), 300_000);
        timed("a flight estimated again", || writer.commit(&[result(7, 500, 5e-5)]).unwrap());
        if pass == "as committed" {
            timed("compact", || writer.compact().unwrap());
        }
    }
}
