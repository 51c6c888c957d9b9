//! Classes of flights: what each breaks, and the flights drawn from it.
//!
//! A case is drawn from a class and an index; equal pairs give bitwise identical flights.

use std::ops::Range;

use rand::seq::IndexedRandom as _;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use simulator::{
    ContactLaw, Flight, FrictionLaw, GustForm, Line, NoiseColour, PeriodicError, Plant, Profile, Sensors,
    Vibration, simulate,
};

/// A flight to be simulated, and the assumptions of its estimator.
#[derive(Debug, Clone)]
pub(crate) struct Case {
    pub(crate) plant: Plant,
    pub(crate) profile: Profile,
    pub(crate) sensors: Sensors,
    /// Stiffness assumed over the true one.
    pub(crate) assumed_factor: f64,
    /// What a wrong mapping makes of the channels.
    pub(crate) mapping_fault: Option<fn(&mut Flight)>,
    /// Seed of the flight whose load is mapped by mistake.
    pub(crate) other_load_seed: Option<u64>,
    pub(crate) seed: u64,
}

/// Which flights a class is judged with.
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
    /// Gap and flight drawn, one assumption broken, errors in µm.
    Drawn,
    /// Flights that cannot show a gap: to be refused with this code.
    Blind(&'static str),
}

#[derive(Debug)]
pub(crate) struct Class {
    pub(crate) name: &'static str,
    pub(crate) kind: Kind,
    gap_m: f64,
    /// Draws what the flights of many classes have in common, before `change`.
    base: Draw,
    change: Draw,
}

/// Changes a case by chance.
type Draw = fn(&mut Case, &mut ChaCha8Rng);

const UM: f64 = 1e-6;

/// A flight of 100 µm with nothing but the change.
const fn single(name: &'static str, change: Draw) -> Class {
    Class { name, kind: Kind::Single, gap_m: 100.0 * UM, base: nothing, change }
}

/// A flight of a gap with the small faults of service.
const fn mixed(name: &'static str, gap_um: f64, change: Draw) -> Class {
    Class { gap_m: gap_um * UM, base: mixture, ..single(name, change) }
}

const fn blind(name: &'static str, code: &'static str, change: Draw) -> Class {
    Class { kind: Kind::Blind(code), ..mixed(name, 100.0, change) }
}

const fn foreign(name: &'static str, change: Draw) -> Class {
    Class { name, kind: Kind::Foreign, gap_m: 0.0, base: wide, change }
}

const fn drawn(name: &'static str, change: Draw) -> Class {
    Class { name, kind: Kind::Drawn, gap_m: 0.0, base: service, change }
}

fn nothing(_: &mut Case, _: &mut ChaCha8Rng) {}

pub(crate) static CLASSES: &[Class] = &[
    single("nominal", nothing),
    single("stiffness assumed 30 % high", |c, _| c.assumed_factor = 1.3),
    single("stiffness assumed 30 % low", |c, _| c.assumed_factor = 0.7),
    single("load cell reads 5 % high", |c, _| c.sensors.load.gain_error = 0.05),
    single("friction × 8", |c, _| c.plant = c.plant.with_friction_factor(8.0)),
    single("screw channel 5 ms late", |c, _| c.sensors.screw.delay_s = 5e-3),
    single("load channel 5 ms late", |c, _| c.sensors.load.delay_s = 5e-3),
    single("spikes of 2 mm", |c, _| (c.sensors.screw.spikes_per_minute, c.sensors.screw.spike) = (1.0, 2e-3)),
    single("5 % of samples missing", |c, _| c.sensors.screw.dropout_share = 0.05),
    single("screw channel freezes for 2 s", |c, _| {
        (c.sensors.screw.freezes_per_minute, c.sensors.screw.freeze_s) = (1.0, 2.0);
    }),
    single("drift of 50 µm", |c, _| c.sensors.screw.drift = 50.0 * UM),
    single("transducer bent by 15 µm", |c, _| c.sensors.screw.nonlinearity = 15.0 * UM),
    mixed("airload of 800 N", 100.0, |c, _| c.profile.load_n = 800.0),
    mixed("mixture, 100 µm", 100.0, nothing),
    mixed("mixture, 30 µm", 30.0, nothing),
    Class { kind: Kind::Zero, ..mixed("mixture, no gap", 0.0, nothing) },
    Class { kind: Kind::Wide, ..foreign("wide", nothing) },
    foreign("wide, Stribeck friction", |c, rng| {
        let ratio = rng.random_range(1.1..1.6);
        c.plant.friction_law = FrictionLaw::Stribeck { ratio, speed_m_per_s: rng.random_range(1e-3..1e-2) };
    }),
    foreign("wide, pre-sliding friction", |c, rng| {
        c.plant.friction_law = FrictionLaw::Presliding { travel_m: rng.random_range(2e-6..20e-6) };
    }),
    mixed("soft flanks, 20 µm deep", 100.0, |c, _| {
        c.plant.contact.law = ContactLaw::Soft { share: 0.4, depth_m: 20.0 * UM };
    }),
    mixed("soft flanks, 100 µm deep", 100.0, |c, _| {
        c.plant.contact.law = ContactLaw::Soft { share: 0.4, depth_m: 100.0 * UM };
    }),
    mixed("flanks partly Hertzian", 100.0, |c, _| {
        c.plant.contact.law = ContactLaw::Hertz { share: 0.3, reference_m: 100.0 * UM };
    }),
    mixed("Hertzian flanks", 100.0, |c, _| {
        c.plant.contact.law = ContactLaw::Hertz { share: 1.0, reference_m: 100.0 * UM };
    }),
    mixed("vibration of 0 N, 80 µm", 80.0, vibration::<0>),
    mixed("vibration of 200 N, 80 µm", 80.0, vibration::<200>),
    mixed("vibration of 500 N, 80 µm", 80.0, vibration::<500>),
    mixed("vibration of 1000 N, 80 µm", 80.0, vibration::<1000>),
    mixed("vibration of 2000 N, 80 µm", 80.0, vibration::<2000>),
    mixed("vibration of 0 N, 25 µm", 25.0, vibration::<0>),
    mixed("vibration of 200 N, 25 µm", 25.0, vibration::<200>),
    mixed("vibration of 500 N, 25 µm", 25.0, vibration::<500>),
    mixed("vibration of 1000 N, 25 µm", 25.0, vibration::<1000>),
    mixed("vibration of 2000 N, 25 µm", 25.0, vibration::<2000>),
    drawn("no fault", nothing),
    drawn("load-cell zero", |c, rng| {
        let sizes_n = [0.0, 200.0, 400.0, 800.0, 0.1 * c.profile.load_n];
        c.sensors.load.bias = either(rng) * sizes_n[rng.random_range(0..sizes_n.len())];
    }),
    drawn("load-cell zero that drifts", |c, rng| {
        c.sensors.load.drift = either(rng) * rng.random_range(0.02..0.1) * c.profile.load_n;
    }),
    drawn("load-cell lag", |c, rng| c.sensors.load.lag_s = log_uniform(rng, 1e-3..30e-3)),
    drawn("load-cell hysteresis", hysteresis),
    drawn("load-cell nonlinearity", nonlinear_load),
    drawn("buffet", buffet),
    drawn("structural lines", lines),
    drawn("turbulence", turbulence),
    drawn("motor vibration", motor_vibration),
    drawn("averaging channels", |c, _| {
        for channel in [&mut c.sensors.motor, &mut c.sensors.screw, &mut c.sensors.load] {
            channel.box_average = true;
        }
    }),
    drawn("averaging load cell", |c, _| c.sensors.load.box_average = true),
    drawn("slow load channel", |c, rng| c.sensors.load.rate_hz = log_uniform(rng, 10.0..62.5)),
    drawn("slow screw channel", |c, rng| c.sensors.screw.rate_hz = log_uniform(rng, 20.0..125.0)),
    drawn("periodic position error", periodic),
    drawn("coloured sensor noise", coloured),
    drawn("Stribeck friction", stribeck),
    drawn("pre-sliding friction", |c, rng| {
        c.plant.friction_law = FrictionLaw::Presliding { travel_m: log_uniform(rng, 1e-6..20e-6) };
    }),
    drawn("LuGre friction", lu_gre),
    drawn("power-flow friction", power_flow),
    drawn("asymmetric friction", |c, rng| {
        c.plant.motor_friction.asymmetry = rng.random_range(-0.4..0.4);
        c.plant.screw_friction.asymmetry = rng.random_range(-0.4..0.4);
    }),
    drawn("heavy friction", |c, rng| {
        c.plant = Plant { contact: c.plant.contact, ..Plant::default() }
            .with_friction_factor(rng.random_range(3.0..8.0));
    }),
    drawn("grease film", |c, rng| {
        let (factor, cold_factor) = (log_uniform(rng, 1.0..10.0), log_uniform(rng, 1.0..6.0));
        let (grease_m_per_s, warm_up_s) = (log_uniform(rng, 5e-4..1e-2), log_uniform(rng, 30.0..600.0));
        for friction in [&mut c.plant.motor_friction, &mut c.plant.screw_friction] {
            friction.viscous_n_s_per_m *= factor;
            friction.grease_n = log_uniform(rng, 30.0..400.0);
            (friction.grease_m_per_s, friction.cold_factor, friction.warm_up_s) =
                (grease_m_per_s, cold_factor, warm_up_s);
        }
    }),
    drawn("few reversals", |c, rng| c.profile.reversals = Some(rng.random_range(1..=6))),
    drawn("long rests", |c, rng| {
        (c.profile.rest_share, c.profile.rest_s) = (rng.random_range(0.4..0.85), rng.random_range(8.0..30.0));
    }),
    drawn("stiffness that moves", |c, rng| {
        c.plant.contact.stiffness_drift = rng.random_range(-0.1..0.1);
        c.plant.contact.stiffness_phase_factors = std::array::from_fn(|_| rng.random_range(0.93..1.07));
    }),
    drawn("unequal flanks", |c, rng| c.plant.contact.lower_stiffness_factor = log_uniform(rng, 0.7..1.4)),
    drawn("soft flanks, bilinear", |c, rng| soft(c, rng, bilinear)),
    drawn("soft flanks, Hertz", |c, rng| soft(c, rng, hertz)),
    drawn("soft flanks, exponential toe", |c, rng| soft(c, rng, toe)),
    drawn("all channels lag", |c, rng| {
        let lag_s = log_uniform(rng, 5e-3..80e-3);
        for channel in [&mut c.sensors.motor, &mut c.sensors.screw, &mut c.sensors.load] {
            channel.lag_s = lag_s;
        }
    }),
    drawn("screw channel lags", |c, rng| c.sensors.screw.lag_s = log_uniform(rng, 3e-3..30e-3)),
    drawn("load at 10 Hz", |c, _| c.sensors.load.rate_hz = 10.0),
    drawn("screw at 25 Hz", |c, _| c.sensors.screw.rate_hz = 25.0),
    drawn("worn in mid-stroke", |c, rng| worn(c, rng, 0.0)),
    drawn("worn off centre", |c, rng| worn(c, rng, 0.2)),
    drawn("load cell clipped", |c, rng| c.sensors.load.clip = rng.random_range(0.45..0.9) * c.profile.load_n),
    drawn("preloaded nut", |c, rng| {
        let windup_m = c.profile.load_n / c.plant.contact.stiffness_n_per_m;
        c.plant.contact.gap_m = -rng.random_range(0.1..0.6) * windup_m;
    }),
    drawn("zero gap, drawn wide", |c, rng| {
        everything(c, rng);
        c.plant.contact.gap_m = 0.0;
    }),
    drawn("everything, hard flanks", everything),
    drawn("everything, soft flanks", |c, rng| {
        everything(c, rng);
        let law = *[bilinear as LawDraw, hertz, toe].choose(rng).unwrap_or(&(toe as LawDraw));
        soft(c, rng, law);
    }),
    blind("the load never reverses", "no_load_reversal", |c, _| c.profile.no_reversal = true),
    blind("load on one side, its zero off", "no_load_reversal", |c, rng| {
        c.profile.no_reversal = true;
        c.profile.load_n = rng.random_range(2.5e3..4e3);
        c.sensors.load.bias = rng.random_range(0.25..0.4) * c.profile.load_n;
    }),
    blind("load sign flipped", "load_sign_flipped", |c, _| {
        c.mapping_fault = Some(|flight| flight.load_n.iter_mut().for_each(|f| *f = -*f));
    }),
    blind("positions swapped", "positions_swapped", |c, _| {
        c.mapping_fault = Some(|flight| std::mem::swap(&mut flight.motor_m, &mut flight.screw_m));
    }),
    blind("screw position 2 % off its lead", "position_ratio", |c, _| {
        c.mapping_fault = Some(|flight| flight.screw_m.iter_mut().for_each(|x| *x *= 1.02));
    }),
    blind("10 samples a second", "rate_too_low", |c, _| c.profile.sample_rate_hz = 10.0),
    blind("eight seconds", "too_short", |c, _| c.profile.duration_s = 8.0),
    blind("airload below friction", "load_too_small", |c, _| c.profile.load_n = 100.0),
    blind("another actuator's load", "motion_unexplained", |c, _| c.other_load_seed = Some(c.seed + 899_000)),
    blind("the motor hardly moves", "travel_too_small", |c, _| {
        (c.profile.stroke_m, c.profile.stick_share, c.profile.trim_share) = (2e-5, 0.01, 0.003);
    }),
    blind("load cell dead", "channel_constant", |c, _| c.mapping_fault = Some(|f| repeat(&mut f.load_n))),
    blind("screw channel dead", "channel_constant", |c, _| {
        c.mapping_fault = Some(|f| repeat(&mut f.screw_m));
    }),
    blind("motor channel dead", "channel_constant", |c, _| {
        c.mapping_fault = Some(|f| repeat(&mut f.motor_m));
    }),
];

/// Several small faults at once, as in service.
fn mixture(case: &mut Case, rng: &mut ChaCha8Rng) {
    case.assumed_factor = rng.random_range(0.85..1.15);
    let sensors = &mut case.sensors;
    sensors.load.gain_error = rng.random_range(-0.02..0.02);
    sensors.screw.delay_s = rng.random_range(-1e-3..1e-3);
    sensors.screw.drift = rng.random_range(-20e-6..20e-6);
    sensors.screw.nonlinearity = rng.random_range(-15e-6..15e-6);
    case.plant = case.plant.with_friction_factor(rng.random_range(0.7..2.7));
}

/// Draws plant, sensors, flight and assumed stiffness over wide ranges.
fn wide(case: &mut Case, rng: &mut ChaCha8Rng) {
    mixture(case, rng);
    case.plant.contact.gap_m = rng.random_range(0.0..300e-6);
    case.plant.contact.stiffness_n_per_m = log_uniform(rng, 3e7..1e8);
    case.assumed_factor = rng.random_range(0.7..1.3);
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
        ..case.profile.clone()
    };
}

fn log_uniform(rng: &mut ChaCha8Rng, range: Range<f64>) -> f64 {
    range.start * (range.end / range.start).powf(rng.random())
}

fn either(rng: &mut ChaCha8Rng) -> f64 {
    if rng.random() { 1.0 } else { -1.0 }
}

/// Small faults of service, gap, load and sample rate drawn: what every drawn class starts from.
fn service(case: &mut Case, rng: &mut ChaCha8Rng) {
    mixture(case, rng);
    case.plant.contact.gap_m = log_uniform(rng, 5e-6..250e-6);
    case.plant.contact.stiffness_n_per_m = log_uniform(rng, 3e7..1e8);
    case.profile.load_n = rng.random_range(5e3..10e3);
    case.profile.sample_rate_hz = log_uniform(rng, 50.0..1000.0);
}

/// ± 7 kN and vibration of 5 to 60 Hz.
fn vibration<const RMS_N: u32>(case: &mut Case, _: &mut ChaCha8Rng) {
    case.profile.load_n = 7e3;
    case.profile.buffet = Vibration::band(5.0, 60.0, f64::from(RMS_N) / 7e3);
}

fn hysteresis(case: &mut Case, rng: &mut ChaCha8Rng) {
    let load = &mut case.sensors.load;
    load.hysteresis = log_uniform(rng, 1e-3..2e-2) * case.profile.load_n;
    load.hysteresis_length = rng.random_range(0.05..0.3) * case.profile.load_n;
}

fn nonlinear_load(case: &mut Case, rng: &mut ChaCha8Rng) {
    case.sensors.load.nonlinearity = rng.random_range(-0.02..0.02) * case.profile.load_n;
}

fn buffet(case: &mut Case, rng: &mut ChaCha8Rng) {
    let low_hz = log_uniform(rng, 5.0..50.0);
    let high_hz = log_uniform(rng, 1.3 * low_hz..101.0);
    case.profile.buffet = Vibration::band(low_hz, high_hz, rng.random_range(0.0..0.3));
}

fn lines(case: &mut Case, rng: &mut ChaCha8Rng) {
    let count = rng.random_range(1..=3);
    let lines: [Line; 3] = std::array::from_fn(|k| Line {
        frequency_hz: log_uniform(rng, 8.0..60.0),
        amplitude: if k < count { log_uniform(rng, 0.01..0.2) } else { 0.0 },
        phase_walk_rad: rng.random_range(0.0..1.0),
    });
    case.profile.buffet.lines = lines.to_vec();
}

fn turbulence(case: &mut Case, rng: &mut ChaCha8Rng) {
    let profile = &mut case.profile;
    profile.gust_form = if rng.random() { GustForm::Dryden } else { GustForm::VonKarman };
    profile.gust_share = rng.random_range(0.15..0.5);
    profile.gust_hz = log_uniform(rng, 0.05..3.0);
}

fn motor_vibration(case: &mut Case, rng: &mut ChaCha8Rng) {
    let low_hz = log_uniform(rng, 5.0..40.0);
    case.profile.motor_vibration =
        Vibration::band(low_hz, log_uniform(rng, 1.3 * low_hz..100.0), log_uniform(rng, 1e-6..30e-6));
}

fn periodic(case: &mut Case, rng: &mut ChaCha8Rng) {
    let mut error = |amplitude_m: Range<f64>, period: f64| PeriodicError {
        amplitude: log_uniform(rng, amplitude_m),
        period,
        phase_rad: rng.random_range(0.0..std::f64::consts::TAU),
    };
    // Once and four times a turn of the resolver; a rack or a second gear of the screw transducer.
    case.sensors.motor.periodic = vec![error(0.5e-6..5e-6, 5e-3), error(0.2e-6..2e-6, 1.25e-3)];
    case.sensors.screw.periodic = vec![error(0.5e-6..8e-6, 3.1e-3)];
}

fn coloured(case: &mut Case, rng: &mut ChaCha8Rng) {
    let colour = if rng.random() { NoiseColour::FirstOrder } else { NoiseColour::Flicker };
    for (channel, range) in [(&mut case.sensors.screw, 1e-6..6e-6), (&mut case.sensors.load, 20.0..150.0)] {
        channel.coloured_form = colour;
        channel.coloured_rms = log_uniform(rng, range);
        channel.coloured_hz = log_uniform(rng, 0.05..3.0);
    }
}

fn stribeck(case: &mut Case, rng: &mut ChaCha8Rng) {
    let ratio = rng.random_range(1.1..2.0);
    case.plant.friction_law = FrictionLaw::Stribeck { ratio, speed_m_per_s: log_uniform(rng, 1e-3..1e-2) };
}

fn lu_gre(case: &mut Case, rng: &mut ChaCha8Rng) {
    case.plant.friction_law = FrictionLaw::LuGre {
        travel_m: log_uniform(rng, 2e-6..20e-6),
        ratio: rng.random_range(1.0..1.6),
        speed_m_per_s: log_uniform(rng, 1e-3..1e-2),
        damping_n_s_per_m: log_uniform(rng, 300.0..1e4),
    };
}

/// A screw loses more while it drives the load than while the load drives it, or the other way round.
fn power_flow(case: &mut Case, rng: &mut ChaCha8Rng) {
    for friction in [&mut case.plant.motor_friction, &mut case.plant.screw_friction] {
        friction.load_share = rng.random_range(0.0..0.12);
        friction.backdriven_load_share = Some(rng.random_range(0.0..0.12));
    }
}

/// A screw that is worn where it works, the middle of that place off the middle of the stroke by a share of it.
fn worn(case: &mut Case, rng: &mut ChaCha8Rng, off: f64) {
    let stroke_m = case.profile.stroke_m;
    case.plant.contact.gap_m = rng.random_range(20e-6..80e-6);
    case.plant.contact.worn_m = rng.random_range(30e-6..120e-6);
    case.plant.contact.worn_at_m = [either(rng) * off * stroke_m, rng.random_range(0.05..0.3) * stroke_m];
}

/// Draws the law of one flank.
type LawDraw = fn(&mut ChaCha8Rng) -> ContactLaw;

fn soft(case: &mut Case, rng: &mut ChaCha8Rng, law: LawDraw) {
    case.plant.contact.law = law(rng);
    case.plant.contact.lower_law = Some(law(rng));
}

fn bilinear(rng: &mut ChaCha8Rng) -> ContactLaw {
    ContactLaw::Soft { share: rng.random_range(0.2..0.8), depth_m: log_uniform(rng, 6e-6..80e-6) }
}

fn hertz(rng: &mut ChaCha8Rng) -> ContactLaw {
    ContactLaw::Hertz { share: rng.random_range(0.2..1.0), reference_m: log_uniform(rng, 50e-6..150e-6) }
}

fn toe(rng: &mut ChaCha8Rng) -> ContactLaw {
    ContactLaw::Toe { share: rng.random_range(0.1..0.7), depth_m: log_uniform(rng, 3e-6..40e-6) }
}

/// Faults of which each flight of *everything* has about two.
const FAULTS: [Draw; 10] = [
    buffet,
    lines,
    turbulence,
    motor_vibration,
    hysteresis,
    nonlinear_load,
    periodic,
    coloured,
    |case, rng| case.profile.reversals = Some(rng.random_range(2..=8)),
    |case, rng| case.profile.rest_share = rng.random_range(0.2..0.7),
];

/// Every assumption may be broken, several at a time; flanks stay hard.
fn everything(case: &mut Case, rng: &mut ChaCha8Rng) {
    wide(case, rng);
    case.plant.contact.gap_m = if rng.random_bool(0.1) { 0.0 } else { rng.random_range(2e-6..300e-6) };
    case.plant.contact.lower_stiffness_factor = log_uniform(rng, 0.9..1.1);
    case.profile.duration_s = log_uniform(rng, 60.0..300.0);
    match rng.random_range(0..4) {
        0 => stribeck(case, rng),
        1 => lu_gre(case, rng),
        2 => power_flow(case, rng),
        _ => (),
    }
    case.sensors.load.bias = rng.random_range(-800.0..800.0);
    if rng.random() {
        (case.sensors.load.delay_s, case.sensors.load.lag_s) = (0.0, log_uniform(rng, 1e-3..20e-3));
    }
    for fault in FAULTS {
        if rng.random_bool(0.2) {
            fault(case, rng);
        }
    }
}

/// A dead channel, which repeats its first value.
fn repeat(channel: &mut [f64]) {
    let first = channel.first().copied().unwrap_or(0.0);
    channel.fill(first);
}

/// A seed of its own for a class of a name (FNV-1a).
fn name_seed(name: &str) -> u64 {
    name.bytes()
        .fold(0xcbf2_9ce4_8422_2325, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3))
}

impl Class {
    /// The case of an index; the same index gives the same case.
    pub(crate) fn case(&self, index: u64) -> Case {
        let own = if self.kind == Kind::Drawn { name_seed(self.name) } else { 0 };
        let mut rng = ChaCha8Rng::seed_from_u64(0x5eed ^ own ^ (index << 8));
        let mut case = Case {
            plant: Plant::default().with_gap_m(self.gap_m),
            profile: Profile { duration_s: 120.0, ..Profile::default() },
            sensors: Sensors::default(),
            assumed_factor: 1.0,
            mapping_fault: None,
            other_load_seed: None,
            seed: (own >> 20) + 1000 + index,
        };
        case.plant.contact.offset_m = rng.random_range(-3e-4..3e-4);
        (self.base)(&mut case, &mut rng);
        (self.change)(&mut case, &mut rng);
        case
    }
}

/// The band of loads over which flanks are extrapolated, as shares of the P95 load.
const STIFF_BAND: (f64, f64) = (0.3, 1.0);

impl Case {
    /// Whether its channels hold spikes or wrong channels.
    pub(crate) fn has_spikes(&self) -> bool {
        let channels = [&self.sensors.motor, &self.sensors.screw, &self.sensors.load];
        let is_mapped_wrong = self.mapping_fault.is_some() || self.other_load_seed.is_some();
        is_mapped_wrong || channels.iter().any(|channel| channel.spikes_per_minute > 0.0)
    }

    /// Whether a flank is soft at low load.
    pub(crate) fn has_soft_flanks(&self) -> bool {
        let contact = &self.plant.contact;
        contact.law != ContactLaw::Linear || contact.lower_law.is_some_and(|law| law != ContactLaw::Linear)
    }

    /// The stiffness of the part's configuration, N/m.
    pub(crate) fn assumed_stiffness_n_per_m(&self) -> f64 {
        self.plant.contact.stiffness_n_per_m * self.assumed_factor
    }

    /// Flies the case: the log as the estimator meets it, and the true gap.
    pub(crate) fn fly(&self) -> Result<Flight, simulator::Error> {
        let simulated = |seed| simulate(&self.plant, &self.profile, &self.sensors, seed);
        let mut flight = simulated(self.seed)?;
        if let Some(seed) = self.other_load_seed {
            flight.load_n = simulated(seed)?.load_n;
        }
        self.mapping_fault.into_iter().for_each(|fault| fault(&mut flight));
        Ok(flight)
    }

    /// The distance of the flanks of a flight of the case, extrapolated to zero load by least squares over 30 to 100 % of the
    /// flight's P95 load, m; equal to the gap for linear flanks.
    pub(crate) fn extrapolated_gap_m(&self, flight: &Flight) -> f64 {
        if !self.has_soft_flanks() {
            return flight.gap_m.max(0.0);
        }
        let sizes_n = flight.load_n.iter().map(|f| (f - self.sensors.load.bias).abs());
        let mut sizes_n: Vec<f64> = sizes_n.filter(|size_n| size_n.is_finite()).collect();
        sizes_n.sort_unstable_by(f64::total_cmp);
        let p95_n = sizes_n.get(sizes_n.len() * 95 / 100).copied().unwrap_or(0.0);
        self.plant.contact.extrapolated_gap_m(STIFF_BAND.0 * p95_n, STIFF_BAND.1 * p95_n)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn case_of(name: &str, index: u64) -> Case {
        CLASSES.iter().find(|class| class.name == name).unwrap().case(index)
    }

    #[test]
    fn every_class_has_a_name_of_its_own_and_cases_that_can_be_flown() {
        for (k, class) in CLASSES.iter().enumerate() {
            assert!(CLASSES[..k].iter().all(|other| other.name != class.name), "{}", class.name);
            for index in 0..50 {
                let case = class.case(index);
                let check = simulator::check(&case.plant, &case.profile, &case.sensors);
                assert!(check.is_ok(), "{} {index}: {check:?}", class.name);
            }
        }
    }

    #[test]
    fn a_toe_below_the_band_adds_to_the_gap_and_hard_flanks_do_not() {
        let mut case = case_of("soft flanks, 20 µm deep", 0);
        case.profile.duration_s = 60.0;
        let flight = case.fly().unwrap();
        assert!((case.extrapolated_gap_m(&flight) - flight.gap_m - 24e-6).abs() < 1e-9);
        let mut hard = case_of("nominal", 0);
        hard.profile.duration_s = 5.0;
        let flight = hard.fly().unwrap();
        assert!((hard.extrapolated_gap_m(&flight) - flight.gap_m).abs() < 1e-15);
    }
}
