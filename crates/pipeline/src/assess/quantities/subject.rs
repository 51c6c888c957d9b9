//! One quantity of one unit while its changes are attributed.

use records::ChangeScope;
use trend::quantity::QuantityValue;
use trend::quantity::changes::{self, QuantityChanges};
use trend::quantity::common_curve::CommonCurve;

use crate::assess::quantities::limits::Treatment;
use crate::assess::quantities::values::UnitValues;
use crate::fleet::histories::{TailPosition, UnitKey};

/// One quantity of one unit.
#[derive(Clone)]
pub(crate) struct Subject<'a> {
    /// The unit.
    pub(crate) name: &'a UnitKey,
    /// Its values.
    pub(crate) unit: &'a UnitValues,
    /// What limits are a share of, in the quantity's unit.
    pub(crate) scale: f64,
    /// How the quantity is followed, with the limits of the unit's part.
    pub(crate) treatment: Treatment,
    /// Values at the part's usual temperature and load.
    pub(crate) values: Vec<QuantityValue>,
    /// Changes of the values as they are: at the end, those of the unit alone.
    pub(crate) fit: Option<QuantityChanges>,
    /// Steps of tail or part, with their scope.
    pub(crate) common: Vec<(changes::QuantityStep, ChangeScope)>,
}

impl Subject<'_> {
    /// The tail at a departure.
    pub(crate) fn tail_at(&self, departure_us: i64) -> Option<&str> {
        let at = self.unit.flights.partition_point(|f| f.departure_us < departure_us);
        self.unit.place(self.unit.flights.get(at)?).tail_number.as_deref()
    }

    /// Where the last flight was flown.
    pub(crate) fn last_place(&self) -> Option<&TailPosition> {
        Some(self.unit.place(self.unit.flights.last()?))
    }

    /// Tail of the last flight.
    pub(crate) fn tail(&self) -> Option<&str> {
        self.last_place()?.tail_number.as_deref()
    }

    /// Position of the last flight.
    pub(crate) fn position(&self) -> Option<&str> {
        self.last_place()?.position.as_deref()
    }

    /// The same without the curve of its part.
    pub(crate) fn without(&self, curve: Option<&CommonCurve>) -> Self {
        let mut left = self.clone();
        if let Some(curve) = curve {
            left.values.iter_mut().for_each(|v| v.value -= curve.at(v.departure_us));
        }
        left
    }

    /// Takes a step of tail or part off the values.
    pub(crate) fn take_off(&mut self, step: changes::QuantityStep, scope: ChangeScope) {
        if self.common.iter().any(|(known, _)| known.departure_us == step.departure_us) {
            return;
        }
        let after = self.values.iter_mut().filter(|v| v.departure_us >= step.departure_us);
        after.for_each(|v| v.value -= step.size);
        self.common.push((step, scope));
    }
}
