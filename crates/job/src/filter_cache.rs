//! Gain schedules of a part: found once for each step of its logs, shared by all its flights.

use std::sync::{Arc, Mutex, PoisonError};

use estimator::{Filter, GainSchedule};

/// Maximum number of schedules kept: logs whose steps differ in the last digits would fill memory.
const CAPACITY: usize = 16;

/// What has been found so far. Clones share it.
#[derive(Debug, Clone, Default)]
pub struct FilterCache(Arc<Mutex<Vec<Arc<GainSchedule>>>>);

impl FilterCache {
    /// The schedule of a filter, made now unless it is there.
    pub(crate) fn of(&self, filter: &Filter) -> Arc<GainSchedule> {
        let known = || self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let find = |known: &[Arc<GainSchedule>]| known.iter().find(|s| s.filter() == filter).cloned();
        if let Some(schedule) = find(&known()) {
            return schedule;
        }
        // Made without the lock: a filter that takes long delays no other log. Two workers may both make it.
        let made = Arc::new(GainSchedule::new(filter));
        let mut known = known();
        if let Some(schedule) = find(&known) {
            return schedule;
        }
        if known.len() == CAPACITY {
            known.remove(0);
        }
        known.push(Arc::clone(&made));
        made
    }
}

/// What has been found already is no setting of a part.
impl PartialEq for FilterCache {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]
mod tests {
    use super::*;

    fn filter(step_s: f64) -> Filter {
        let actuator = estimator::ActuatorModel::linear(5e7, 2000.0, 8.0).unwrap();
        let (w_d, v_d_m2) = (nalgebra::Matrix3::identity() * 1e-12, 1e-11);
        Filter::new(&actuator, step_s, &estimator::NoiseModel::PerStep { w_d, v_d_m2 }).unwrap()
    }

    #[test]
    fn flights_of_one_step_share_a_schedule_and_others_do_not() {
        let schedules = FilterCache::default();
        let first = schedules.of(&filter(0.004));
        assert!(Arc::ptr_eq(&first, &schedules.clone().of(&filter(0.004))));
        assert!(!Arc::ptr_eq(&first, &schedules.of(&filter(0.005))));
        (0..40).for_each(|k| drop(schedules.of(&filter(0.01 + 1e-6 * f64::from(k)))));
        assert_eq!(schedules.0.lock().unwrap().len(), CAPACITY);
        assert_eq!(schedules.of(&filter(0.004)).filter(), first.filter());
    }
}
