//! Keys that a spec leaves out change nothing: flights of old specs keep their bits.

use simulator::{Plan, SimulatedFlight, Spec};

/// FNV-1a over the bits of every channel.
fn digest(flight: &SimulatedFlight) -> u64 {
    let channels = flight.actuators.iter().flat_map(|a| [&a.motor, &a.screw, &a.load]);
    let numbers = channels.flatten().chain(&flight.time_s);
    let bytes = numbers.flat_map(|x| x.to_bits().to_le_bytes());
    bytes.fold(0xcbf2_9ce4_8422_2325, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3))
}

fn first_flight(spec: &str, duration_s: f64) -> u64 {
    let mut spec: Spec = toml::from_str(spec).unwrap();
    spec.profile.duration_s = duration_s;
    let plan = Plan::new(&spec).unwrap();
    digest(&plan.simulate_flight(&plan.flights[0]).unwrap())
}

/// Digests of the simulator before it had load spectra, lag, hysteresis and further laws.
#[test]
fn flights_of_specs_without_new_keys_keep_their_bits() {
    let specs = [
        include_str!("../../specs/three_aircraft.toml"),
        include_str!("../../specs/service.toml"),
        include_str!("../../specs/rough.toml"),
    ];
    assert_eq!(
        specs.map(|spec| first_flight(spec, 20.0)),
        [18_300_182_548_049_083_202, 13_874_963_508_701_740_792, 15_269_884_242_281_932_624]
    );
}
