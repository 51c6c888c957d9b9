//! Flights to be flown, and what their estimator is told: the scenarios of the study.

use std::ops::Range;

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use simulator::contact::Law as ContactLaw;
use simulator::friction::Law as FrictionLaw;
use simulator::{Flight, Plant, Profile, Sensors, simulate};

/// A flight to be flown, and what its estimator is told.
pub(crate) struct Case {
    pub(crate) plant: Plant,
    pub(crate) profile: Profile,
    pub(crate) sensors: Sensors,
    /// Stiffness assumed over the true one.
    pub(crate) assumed: f64,
    /// What a mapping made of the channels before the estimator saw them.
    pub(crate) mapping: Mapping,
}

/// Channels as they are, or as somebody mapped them by mistake.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Mapping {
    Right,
    LoadFlipped,
    Swapped,
    /// The screw's lead is two per cent off.
    Ratio,
    /// The load of another actuator, in another flight.
    OtherLoad,
    /// A channel that repeats its first value.
    DeadLoad,
    /// See [`Mapping::DeadLoad`].
    DeadScrew,
    /// See [`Mapping::DeadLoad`].
    DeadMotor,
}

/// Which flights a scenario is judged with.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Kind {
    /// One gap, errors in per cent of it.
    Single,
    /// One gap of zero, errors in µm.
    Zero,
    /// Gaps of 0 to 300 µm and all else drawn wide, errors in µm; the interval is counted here.
    Wide,
    /// The same, under laws that the estimator does not contain.
    Foreign,
    /// Flights that cannot show a gap: to be refused with this code.
    Blind(&'static str),
}

pub(crate) struct Scenario {
    pub(crate) name: &'static str,
    pub(crate) kind: Kind,
    gap_m: f64,
    change: fn(&mut Case, &mut ChaCha8Rng),
}

const UM: f64 = 1e-6;

const fn single(name: &'static str, change: fn(&mut Case, &mut ChaCha8Rng)) -> Scenario {
    Scenario { name, kind: Kind::Single, gap_m: 100.0 * UM, change }
}

const fn blind(name: &'static str, code: &'static str, change: fn(&mut Case, &mut ChaCha8Rng)) -> Scenario {
    Scenario { name, kind: Kind::Blind(code), gap_m: 100.0 * UM, change }
}

const fn foreign(name: &'static str, change: fn(&mut Case, &mut ChaCha8Rng)) -> Scenario {
    Scenario { name, kind: Kind::Foreign, gap_m: 0.0, change }
}

pub(crate) const SCENARIOS: [Scenario; 35] = [
    single("nominal", |_, _| ()),
    single("stiffness assumed 30 % high", |c, _| c.assumed = 1.3),
    single("stiffness assumed 30 % low", |c, _| c.assumed = 0.7),
    single("load cell reads 5 % high", |c, _| c.sensors.load.gain_error = 0.05),
    single("friction × 8", |c, _| c.plant = c.plant.with_friction_factor(8.0)),
    single("screw channel 5 ms late", |c, _| c.sensors.screw.delay_s = 5e-3),
    single("load channel 5 ms late", |c, _| c.sensors.load.delay_s = 5e-3),
    single("spikes of 2 mm", |c, _| {
        (c.sensors.screw.spikes_per_minute, c.sensors.screw.spike) = (1.0, 2e-3);
    }),
    single("5 % of samples missing", |c, _| c.sensors.screw.dropout_share = 0.05),
    single("screw channel freezes for 2 s", |c, _| {
        (c.sensors.screw.freezes_per_minute, c.sensors.screw.freeze_s) = (1.0, 2.0);
    }),
    single("drift of 50 µm", |c, _| c.sensors.screw.drift = 50.0 * UM),
    single("transducer bent by 15 µm", |c, _| c.sensors.screw.nonlinearity = 15.0 * UM),
    single("airload of 800 N", |c, rng| {
        mixture(c, rng);
        c.profile.load_n = 800.0;
    }),
    single("mixture, 100 µm", mixture),
    Scenario { name: "mixture, 30 µm", kind: Kind::Single, gap_m: 30.0 * UM, change: mixture },
    Scenario { name: "mixture, no gap", kind: Kind::Zero, gap_m: 0.0, change: mixture },
    Scenario { name: "wide", kind: Kind::Wide, gap_m: 0.0, change: wide },
    foreign("wide, Stribeck friction", |c, rng| {
        wide(c, rng);
        let ratio = rng.random_range(1.1..1.6);
        c.plant.friction_law = FrictionLaw::Stribeck { ratio, speed_m_per_s: rng.random_range(1e-3..1e-2) };
    }),
    foreign("wide, pre-sliding friction", |c, rng| {
        wide(c, rng);
        c.plant.friction_law = FrictionLaw::Presliding { travel_m: rng.random_range(2e-6..20e-6) };
    }),
    single("soft flanks, 20 µm deep", |c, rng| {
        mixture(c, rng);
        c.plant.contact.law = ContactLaw::Soft { share: 0.4, depth_m: 20.0 * UM };
    }),
    single("soft flanks, 100 µm deep", |c, rng| {
        mixture(c, rng);
        c.plant.contact.law = ContactLaw::Soft { share: 0.4, depth_m: 100.0 * UM };
    }),
    single("flanks partly Hertzian", |c, rng| {
        mixture(c, rng);
        c.plant.contact.law = ContactLaw::Hertz { share: 0.3, reference_m: 100.0 * UM };
    }),
    single("Hertzian flanks", |c, rng| {
        mixture(c, rng);
        c.plant.contact.law = ContactLaw::Hertz { share: 1.0, reference_m: 100.0 * UM };
    }),
    blind("the load never reverses", "no_load_reversal", |c, rng| {
        mixture(c, rng);
        c.profile.no_reversal = true;
    }),
    blind("load sign flipped", "load_sign_flipped", |c, rng| {
        mixture(c, rng);
        c.mapping = Mapping::LoadFlipped;
    }),
    blind("positions swapped", "positions_swapped", |c, rng| {
        mixture(c, rng);
        c.mapping = Mapping::Swapped;
    }),
    blind("screw position 2 % off its lead", "position_ratio", |c, rng| {
        mixture(c, rng);
        c.mapping = Mapping::Ratio;
    }),
    blind("10 samples a second", "rate_too_low", |c, rng| {
        mixture(c, rng);
        c.profile.sample_rate_hz = 10.0;
    }),
    blind("eight seconds", "too_short", |c, rng| {
        mixture(c, rng);
        c.profile.duration_s = 8.0;
    }),
    blind("airload below friction", "load_too_small", |c, rng| {
        mixture(c, rng);
        c.profile.load_n = 100.0;
    }),
    blind("another actuator's load", "motion_unexplained", |c, rng| {
        mixture(c, rng);
        c.mapping = Mapping::OtherLoad;
    }),
    blind("the motor hardly moves", "travel_too_small", |c, rng| {
        mixture(c, rng);
        (c.profile.stroke_m, c.profile.stick_share, c.profile.trim_share) = (2e-5, 0.01, 0.003);
    }),
    blind("load cell dead", "channel_constant", |c, rng| {
        mixture(c, rng);
        c.mapping = Mapping::DeadLoad;
    }),
    blind("screw channel dead", "channel_constant", |c, rng| {
        mixture(c, rng);
        c.mapping = Mapping::DeadScrew;
    }),
    blind("motor channel dead", "channel_constant", |c, rng| {
        mixture(c, rng);
        c.mapping = Mapping::DeadMotor;
    }),
];

/// Several small faults at once, as in service.
fn mixture(case: &mut Case, rng: &mut ChaCha8Rng) {
    case.assumed = rng.random_range(0.85..1.15);
    let sensors = &mut case.sensors;
    sensors.load.gain_error = rng.random_range(-0.02..0.02);
    sensors.screw.delay_s = rng.random_range(-1e-3..1e-3);
    sensors.screw.drift = rng.random_range(-20e-6..20e-6);
    sensors.screw.nonlinearity = rng.random_range(-15e-6..15e-6);
    case.plant = case.plant.with_friction_factor(rng.random_range(0.7..2.7));
}

/// Everything over wide ranges: plant, sensors, flight and what is assumed.
fn wide(case: &mut Case, rng: &mut ChaCha8Rng) {
    mixture(case, rng);
    let log_uniform =
        |rng: &mut ChaCha8Rng, range: Range<f64>| range.start * (range.end / range.start).powf(rng.random());
    case.plant.contact.gap_m = rng.random_range(0.0..300e-6);
    case.plant.contact.stiffness_n_per_m = log_uniform(rng, 3e7..1e8);
    case.assumed = rng.random_range(0.7..1.3);
    case.plant = Plant { contact: case.plant.contact, ..Plant::default() }
        .with_friction_factor(log_uniform(rng, 0.3..8.0));
    let sensors = &mut case.sensors;
    sensors.load.gain_error = rng.random_range(-0.05..0.05);
    sensors.load.delay_s = rng.random_range(-2e-3..2e-3);
    sensors.screw.noise_rms = log_uniform(rng, 1e-6..20e-6);
    sensors.screw.delay_s = rng.random_range(-5e-3..5e-3);
    sensors.screw.drift = rng.random_range(-50e-6..50e-6);
    case.profile = Profile {
        duration_s: log_uniform(rng, 30.0..7200.0),
        sample_rate_hz: log_uniform(rng, 50.0..1000.0),
        load_n: log_uniform(rng, 4e3..15e3),
        gust_share: rng.random_range(0.15..0.4),
        gust_hz: log_uniform(rng, 0.3..2.0),
        trim_share: rng.random_range(0.003..0.03),
        stick_share: rng.random_range(0.05..0.2),
        hinge_share: rng.random_range(0.1..0.4),
        no_reversal: false,
        ..case.profile
    };
}

fn repeat(channel: &mut [f64]) {
    let first = channel.first().copied().unwrap_or(0.0);
    channel.fill(first);
}

impl Scenario {
    /// The case of one flight; the same index gives the same case.
    fn case(&self, index: u64) -> Case {
        let mut rng = ChaCha8Rng::seed_from_u64(0x5eed ^ (index << 8));
        let mut case = Case {
            plant: Plant::default().with_gap_m(self.gap_m),
            profile: Profile { duration_s: 120.0, ..Profile::default() },
            sensors: Sensors::default(),
            assumed: 1.0,
            mapping: Mapping::Right,
        };
        case.plant.contact.offset_m = rng.random_range(-3e-4..3e-4);
        (self.change)(&mut case, &mut rng);
        case
    }

    /// Flies one flight.
    pub(crate) fn fly(&self, index: u64) -> Result<(Case, Flight), simulator::Error> {
        let case = self.case(index);
        let mut flight = simulate(&case.plant, &case.profile, &case.sensors, 1000 + index)?;
        match case.mapping {
            Mapping::Right => (),
            Mapping::LoadFlipped => flight.load_n.iter_mut().for_each(|f| *f = -*f),
            Mapping::Swapped => std::mem::swap(&mut flight.motor_m, &mut flight.screw_m),
            Mapping::Ratio => flight.screw_m.iter_mut().for_each(|x| *x *= 1.02),
            Mapping::OtherLoad => {
                flight.load_n = simulate(&case.plant, &case.profile, &case.sensors, 900_000 + index)?.load_n;
            }
            Mapping::DeadLoad => repeat(&mut flight.load_n),
            Mapping::DeadScrew => repeat(&mut flight.screw_m),
            Mapping::DeadMotor => repeat(&mut flight.motor_m),
        }
        Ok((case, flight))
    }
}
