//! One quantity of one unit while its changes are attributed.

use jiff::Timestamp;
use rayon::prelude::*;
use records::{ChangeScope, Quantity};
use trend::Series;
use trend::quantity::QuantityValue;
use trend::quantity::changes::{self, QuantityChanges, QuantityStep};

use crate::assess::limits::Limits;
use crate::assess::quantities::limits::{Scale, Treatment};
use crate::assess::quantities::values::{Covariates, FollowedFlights, QuantityColumn};
use crate::findings::monitoring::median;
use crate::fleet::flight_row::FlightRow;
use crate::fleet::histories::{TailPosition, UnitKey};

/// One quantity of one unit.
pub(crate) struct Subject<'a> {
    pub(crate) name: &'a UnitKey,
    unit: &'a FollowedFlights<'a>,
    pub(crate) quantity: Quantity,
    /// What limits are a share of, in the quantity's unit.
    pub(crate) scale: f64,
    /// How the quantity is followed, with the limits of the unit's part.
    pub(crate) treatment: Treatment,
    /// Values at the part's usual temperature and load.
    pub(crate) values: Vec<QuantityValue>,
    /// Changes of the values as they are: at the end, those of the unit alone.
    pub(crate) fit: Option<QuantityChanges>,
    /// Whether the values are those that were fitted.
    pub(crate) is_fitted: bool,
    /// Steps of tail or part, with their scope.
    pub(crate) common: Vec<(QuantityStep, ChangeScope)>,
}

impl<'a> Subject<'a> {
    /// The series of one quantity of one unit; none without a value.
    pub(crate) fn new(
        name: &'a UnitKey,
        unit: &'a FollowedFlights<'a>,
        series: &Series,
        limits: Limits<'_>,
        columns: &QuantityColumns<'_>,
    ) -> Option<Self> {
        let quantity = columns.quantity;
        let treatment = Treatment::of(quantity, &limits.quantities(name.0.as_deref()));
        let last = unit.flights.last()?;
        // The channels of a position have no hours and no maintenance of their own.
        let series = Some(series).filter(|_| !treatment.is_of_channel);
        let maintained = series.and_then(|s| s.maintenance_until(last.departure_us()).last());
        let moved = unit.flights.iter().rposition(|flown| flown.place != last.place);
        let begin = moved.filter(|_| treatment.is_of_position).map_or(0, |k| k + 1);
        let followed = unit.flights[begin..]
            .iter()
            .filter(|flown| maintained.is_none_or(|done| flown.departure_us() >= done.utc_us));
        let mut by_usage = series.map_or(&[][..], Series::flights).iter().peekable();
        let mut usage_hours = None;
        let known = |number: f32, beyond: f32| {
            if number.is_finite() && number > beyond { f64::from(number) } else { f64::NAN }
        };
        let value = |(k, flown): (usize, &FlightRow)| {
            let departure_us = flown.departure_us();
            while let Some(flight) = by_usage.next_if(|flight| flight.departure_us <= departure_us) {
                usage_hours = Some(flight.hours);
            }
            let (value, se) = columns.at(flown, unit.usual_load_n)?;
            let Covariates { temperature_c, load_p95_n, .. } = columns.covariates[flown.row as usize];
            Some(QuantityValue {
                departure_us,
                usage_hours: usage_hours.unwrap_or(k as f64),
                value,
                se,
                temperature_c: known(temperature_c, f32::MIN),
                ln_load: known(load_p95_n, 0.0).ln(),
            })
        };
        let values: Vec<QuantityValue> = followed.enumerate().filter_map(value).collect();
        let scale = match treatment.scale {
            Scale::One => 1.0,
            Scale::UsualLoad => unit.usual_load_n?,
            Scale::Median => median(values.iter().map(|v| v.value.abs()).collect()),
        };
        let (fit, is_fitted, common) = (None, false, Vec::new());
        let is_followed = !values.is_empty() && scale > 0.0;
        is_followed.then_some(Self { name, unit, quantity, scale, treatment, values, fit, is_fitted, common })
    }

    /// Fits steps and drift to some values of the subject.
    pub(crate) fn fitted(&self, values: &[QuantityValue]) -> Option<QuantityChanges> {
        changes::fit(values, self.treatment.least_scatter * self.scale)
    }

    /// Change from which the unit has a state, in the quantity's unit.
    pub(crate) fn limit(&self) -> Option<f64> {
        Some(self.treatment.limit? * self.scale)
    }

    pub(crate) fn flight_id(&self, departure_us: i64) -> Option<String> {
        let history = self.unit.history;
        history.flight_id(history.at(Timestamp::from_microsecond(departure_us).ok()?)?).map(str::to_owned)
    }

    pub(crate) fn tail_at(&self, departure_us: i64) -> Option<&'a str> {
        let at = self.unit.flights.partition_point(|flown| flown.departure_us() < departure_us);
        self.unit.place(self.unit.flights.get(at)?).tail_number.as_deref()
    }

    /// Where the last flight was flown.
    pub(crate) fn last_place(&self) -> Option<&'a TailPosition> {
        Some(self.unit.place(self.unit.flights.last()?))
    }

    pub(crate) fn tail(&self) -> Option<&'a str> {
        self.last_place()?.tail_number.as_deref()
    }

    /// Takes a step of tail or part off the values.
    pub(crate) fn take_off(&mut self, step: QuantityStep, scope: ChangeScope) {
        if self.common.iter().any(|(known, _)| known.departure_us == step.departure_us) {
            return;
        }
        let after = self.values.iter_mut().filter(|v| v.departure_us >= step.departure_us);
        after.for_each(|v| v.value -= step.size);
        self.is_fitted = false;
        self.common.push((step, scope));
    }
}

/// What the values of one quantity are made from.
pub(crate) struct QuantityColumns<'a> {
    pub(crate) quantity: Quantity,
    pub(crate) values: QuantityColumn,
    /// Of the friction, its dry part and its share of the load.
    pub(crate) parts: Option<[QuantityColumn; 2]>,
    pub(crate) covariates: &'a [Covariates],
}

impl QuantityColumns<'_> {
    /// Value and standard error of a flight. Friction is taken at the unit's usual load, so that a flight under less load
    /// has not less friction.
    fn at(&self, flown: &FlightRow, usual_load_n: Option<f64>) -> Option<(f64, f64)> {
        let of_flight = |column: &QuantityColumn| {
            let (value, se) = column[flown.row as usize];
            (f64::from(value), if se.is_finite() { f64::from(se.max(0.0)) } else { 0.0 })
        };
        let (value, se) = of_flight(&self.values);
        let parts = self.parts.as_ref().map(|parts| parts.each_ref().map(|part| of_flight(part).0));
        let at_usual_load = parts.zip(usual_load_n).map(|([dry_n, share], load_n)| dry_n + share * load_n);
        let value = at_usual_load.filter(|value| value.is_finite()).unwrap_or(value);
        value.is_finite().then_some((value, se))
    }
}

/// Fits steps and drift of all subjects to their present values.
pub(crate) fn fit_all(subjects: &mut [Subject<'_>]) {
    subjects.par_iter_mut().filter(|subject| !subject.is_fitted).for_each(|subject| {
        (subject.fit, subject.is_fitted) = (subject.fitted(&subject.values), true);
    });
}
