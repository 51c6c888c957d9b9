//! Commits: whole flights, each once.

use std::collections::BTreeMap;

use proptest::prelude::*;
use records::GapRecord;
use store::{LogResult, Query, RecordKey, Store};

use crate::fixtures::{POSITIONS, account, fresh, record, result, time};

#[test]
fn files_that_hold_no_superseded_record_are_not_touched() {
    let (_dir, mut writer) = fresh();
    for flight in 0..4 {
        writer.commit(&[result(1, flight, 30e-6)]).unwrap();
    }
    let before = writer.store().table_files("gaps").unwrap();
    writer.commit(&[result(1, 2, 31e-6)]).unwrap();
    let after = writer.store().table_files("gaps").unwrap();
    assert_eq!(before.iter().filter(|file| after.contains(file)).count(), 4);
    assert_eq!(after.len(), 5);
}

#[test]
fn the_newest_account_of_a_log_counts_even_when_clocks_go_back() {
    let (_dir, mut writer) = fresh();
    writer.commit(&[result(1, 1, 30e-6), result(1, 0, 30e-6)]).unwrap();
    let mut second = result(1, 1, 30e-6);
    second.account.processed_utc = time("1999-01-01T00:00:00Z");
    second.account.error_detail = Some("a\n\"b\"".into());
    writer.commit(std::slice::from_ref(&second)).unwrap();
    // A table lists its files from the newest; a compacted file has its rows from the oldest.
    let expected = [account(1, 0), second.account];
    assert_eq!(writer.store().accounts().unwrap(), expected);
    writer.compact().unwrap();
    assert_eq!(writer.store().accounts().unwrap(), expected);
}

/// One log's result: a tail, a flight, which positions have a record, which are retired, a gap.
fn results() -> impl Strategy<Value = LogResult> {
    let some = || prop::sample::subsequence(POSITIONS.to_vec(), 0..=3);
    (0_usize..2, 0_i64..3, some(), some(), 1e-6..1e-4).prop_map(|(tail, flight, there, gone, gap_m)| {
        LogResult {
            account: account(tail, flight),
            records: there.iter().map(|position| record(tail, flight, position, gap_m)).collect(),
            moved_from: gone
                .iter()
                .map(|position| record(tail, flight, position, 0.0))
                .map(|gone| (RecordKey::of(&gone), gone.provenance.log_digest))
                .collect(),
        }
    })
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(10) })]

    #[test]
    fn a_store_is_a_map_from_actuators_flights_to_their_newest_records(
        commits in prop::collection::vec(prop::collection::vec(results(), 1..4), 1..7),
        compact_after in 0_usize..7,
    ) {
        let (_dir, mut writer) = fresh();
        let mut map: BTreeMap<RecordKey, GapRecord> = BTreeMap::new();
        for (i, commit) in commits.iter().enumerate() {
            for result in commit {
                map.retain(|key, _| result.moved_from.iter().all(|(gone, _)| gone != key));
                map.extend(result.records.iter().map(|record| (RecordKey::of(record), record.clone())));
            }
            writer.commit(commit).unwrap();
            if i == compact_after {
                writer.compact().unwrap();
            }
            let expected: Vec<GapRecord> = map.values().cloned().collect();
            prop_assert_eq!(writer.store().records(&Query::default()).unwrap(), expected);
        }
        // Results that retire records of other logs leave those logs with fewer records than they report.
        let findings = writer.store().verify();
        prop_assert!(findings.iter().all(|found| found.code == "store_records_missing"), "{:?}", findings);
    }
}

/// Every flight has each of its positions once, all of one estimate.
fn assert_whole(records: &[GapRecord]) {
    let mut flights: BTreeMap<_, Vec<&GapRecord>> = BTreeMap::new();
    for record in records {
        let flight = (record.flight.tail_number.clone(), record.flight.flight_id.clone());
        flights.entry(flight).or_default().push(record);
    }
    for (flight, records) in flights {
        let positions: Vec<&str> = records.iter().map(|r| r.position.as_str()).collect();
        assert_eq!(positions, POSITIONS, "{flight:?}");
        assert!(records.windows(2).all(|r| r[0].estimate.gap_m == r[1].estimate.gap_m), "{flight:?}");
    }
}

#[test]
fn a_reader_beside_a_writer_sees_whole_commits_only() {
    let (dir, mut writer) = fresh();
    let reader = Store::open(dir.path()).unwrap();
    std::thread::scope(|scope| {
        let writing = scope.spawn(move || {
            for step in 0..24 {
                let gap_m = 1e-6 * f64::from(step);
                let flight = i64::from(step % 5);
                writer.commit(&[result(1, flight, gap_m), result(2, flight, gap_m)]).unwrap();
                if step % 10 == 9 {
                    writer.compact().unwrap();
                }
            }
        });
        while !writing.is_finished() {
            assert_whole(&reader.records(&Query::default()).unwrap());
        }
        writing.join().unwrap();
    });
    assert_eq!(reader.records(&Query::default()).unwrap().len(), 30);
}

#[test]
fn a_record_stays_where_other_samples_leave_its_key_in_the_same_commit() {
    let (_dir, mut writer) = fresh();
    let before = result(1, 0, 30e-6);
    writer.commit(std::slice::from_ref(&before)).unwrap();
    let mut new = result(1, 0, 40e-6);
    new.records.iter_mut().for_each(|record| record.provenance.log_digest = "other".into());
    let key = |record: &GapRecord| (RecordKey::of(record), record.provenance.log_digest.clone());
    let left = LogResult { moved_from: before.records.iter().map(key).collect(), ..result(0, 1, 30e-6) };
    writer.commit(&[new.clone(), left]).unwrap();
    let stored = writer.store().records(&Query::default()).unwrap();
    assert!(new.records.iter().all(|record| stored.contains(record)), "{stored:?}");
}
