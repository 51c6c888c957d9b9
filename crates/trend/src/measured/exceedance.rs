//! Records above the limit: unconfirmed, confirmed, ended.

use crate::measured::level::Level;
use crate::measured::record::{HYSTERESIS, RECALLED, Record};
use crate::statement::types::{ChangePoint, ChangePointKind};

#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Exceedance {
    /// One record alone, or flagged records only: later sound records confirm or clear it.
    Unconfirmed { gap_m: f64, before_m: Option<f64>, records: usize },
    /// Several of the last records, with records below the limit in between.
    Repeated { records: usize, among: usize },
    /// Two records or more in a row, one of them sound; or the level of the last records.
    Confirmed { records: usize },
    /// Confirmed before, and not ended by two records below the limit or by maintenance; or ended by two records, but the
    /// level is still at 97 % of the limit or more.
    Held,
}

/// Least number of records at or above the limit that count as a repeated exceedance, and the number of last records
/// among which they are counted.
const REPEATED: [(usize, usize); 2] = [(3, 6), (4, 12)];

/// Successive records at or above the limit, and the records below it that follow.
#[derive(Debug, Clone, Copy, Default)]
struct Run {
    first: usize,
    above: usize,
    /// Whether one of the records above is sound.
    has_sound: bool,
    /// Number of records below the limit since the last one above it.
    below: usize,
    is_confirmed: bool,
    before_m: Option<f64>,
}

/// The exceedance at the last record, and the events of all records.
pub(crate) fn exceedance(
    all: &[Record],
    level: Option<Level>,
    limit_m: f64,
) -> (Option<Exceedance>, Vec<ChangePoint>) {
    let is_above = |record: &Record| record.gap_m >= limit_m;
    // A flagged record below the limit clears nothing.
    let records: Vec<Record> = all.iter().copied().filter(|r| r.is_sound || is_above(r)).collect();
    let mut events = Vec::new();
    let mut run: Option<Run> = None;
    let mut ended_at = None;
    for (k, record) in records.iter().enumerate() {
        if k > 0 && record.renewals != records[k - 1].renewals {
            (run, ended_at) = (None, None);
        }
        let begin = || Run { first: k, before_m: before(&records, k), ..Run::default() };
        let Some(mut current) = run.take().or_else(|| is_above(record).then(begin)) else { continue };
        if is_above(record) {
            // A record below in between: the first one above stays alone, and this one is the first of its row.
            if current.below > 0 && !current.is_confirmed {
                current = Run { first: k, before_m: current.before_m, ..Run::default() };
            }
            (current.above, current.below) = (current.above + 1, 0);
            current.has_sound |= record.is_sound;
            if !current.is_confirmed && current.above > 1 && current.has_sound {
                current.is_confirmed = true;
                events.push(event(&records[current.first], &current, ChangePointKind::Exceedance));
            }
            run = Some(current);
            continue;
        }
        current.below += 1;
        if current.below == 1 {
            run = Some(current);
        } else if current.is_confirmed {
            ended_at = Some(k);
            // No recorded maintenance made the gap smaller. A smaller fall may be scatter of records near the limit.
            if records[k - 1].gap_m < HYSTERESIS * limit_m {
                let [before, Record { departure_us, gap_m, error_m, .. }] = [records[k - 2], records[k - 1]];
                let (kind, step_m) = (ChangePointKind::Reset, gap_m - before.gap_m);
                events.push(ChangePoint { departure_us, kind, step_m, se_m: error_m, certainty: 1.0 });
            }
        } else {
            events.push(event(&records[current.first], &current, ChangePointKind::UnconfirmedExceedance));
        }
    }
    let is_held = |level: Level| {
        level.gap_m >= HYSTERESIS * limit_m && ended_at.is_some_and(|k| k + RECALLED >= records.len())
    };
    let by_level = level.filter(|level| level.records > 1 && level.gap_m >= limit_m);
    let last_renewals = |records: &[Record]| records.last().map(|record| record.renewals);
    let repeated = repeated(&records, is_above);
    let found = match (run, by_level) {
        // After a renewal, records before it count no more.
        _ if last_renewals(&records) != last_renewals(all) => None,
        (Some(run), _) if run.is_confirmed && run.below == 0 => {
            Some(Exceedance::Confirmed { records: run.above })
        }
        (Some(run), _) if run.is_confirmed => Some(Exceedance::Held),
        (_, Some(level)) => Some(Exceedance::Confirmed { records: level.records }),
        _ if repeated.is_some() => repeated,
        (Some(run), None) => {
            let gap_m = records[run.first..].iter().map(|record| record.gap_m).fold(0.0, f64::max);
            Some(Exceedance::Unconfirmed { gap_m, before_m: run.before_m, records: run.above })
        }
        (None, None) => level.is_some_and(is_held).then_some(Exceedance::Held),
    };
    (found, events)
}

/// Records since the last renewal that exceed the limit again after records below it; one of them must be sound.
fn repeated(records: &[Record], is_above: impl Fn(&Record) -> bool) -> Option<Exceedance> {
    let of_life = records.chunk_by(|before, here| before.renewals == here.renewals).last()?;
    REPEATED.into_iter().find_map(|(least, among)| {
        let near = &of_life[of_life.len().saturating_sub(among)..];
        let above: Vec<&Record> = near.iter().filter(|record| is_above(record)).collect();
        let rises = near.array_windows().filter(|[before, here]| !is_above(before) && is_above(here)).count();
        let is_repeated = rises > 1 && above.len() >= least && above.iter().any(|record| record.is_sound);
        is_repeated.then_some(Exceedance::Repeated { records: above.len(), among: near.len() })
    })
}

/// Median of the last three sound records before a record, in its period, m.
fn before(records: &[Record], at: usize) -> Option<f64> {
    let period = records[at].period;
    let near = records[..at].iter().rev().take_while(|r| r.period == period).filter(|r| r.is_sound).take(3);
    crate::math::median(near.map(|r| r.gap_m).collect())
}

fn event(first: &Record, run: &Run, kind: ChangePointKind) -> ChangePoint {
    let step_m = run.before_m.map_or(0.0, |before_m| first.gap_m - before_m);
    ChangePoint { departure_us: first.departure_us, kind, step_m, se_m: first.error_m, certainty: 1.0 }
}
