//! The filter on board: 1000 samples a second on a Cortex-M controller, without allocator or operating system.
//!
//! The program steps through a reference vector at 1 kHz, compares S with it, and prints the instructions of a step
//! and the stack it needs. [`run`] is what a controller does; everything else is the emulator and the stopwatch.

#![no_std]
#![no_main]

mod panics;
mod print;
mod stack;
#[path = "../../freestanding/src/vector.rs"]
#[allow(dead_code, reason = "the gap is compared in the other program")]
mod vector;

use cortex_m::peripheral::SYST;
use cortex_m::peripheral::syst::SystClkSource;
use cortex_m_rt::entry;
use cortex_m_semihosting::debug;
use estimator::{ActuatorModel, Error, Filter, NoiseModel, Stream};
use nalgebra::Matrix3;

/// Ticks of a millisecond: the emulated boards count the clock of their processor, 25 MHz.
const PERIOD_TICKS: u32 = 25_000_000 / 1000;
/// Ticks of the clock for four instructions: `run` lets an instruction last 32 ns, and a tick lasts 40 ns.
const TICKS_OF_INSTRUCTIONS: (u32, u32) = (4, 5);
/// Largest difference of S, as a share of its peak.
const TOLERANCE: f64 = 1e-12;

/// The most and the sum of what a step took.
#[derive(Clone, Copy, Default)]
struct Cost {
    most: u32,
    sum: u32,
}

impl Cost {
    /// Between two readings of the clock, which counts down from a period.
    fn add(&mut self, before: u32, after: u32) {
        let ticks = (before + PERIOD_TICKS - after) % PERIOD_TICKS;
        self.most = self.most.max(ticks);
        self.sum += ticks;
    }

    fn print(&self, name: &str) {
        let instructions = |ticks: u32| ticks * TICKS_OF_INSTRUCTIONS.1 / TICKS_OF_INSTRUCTIONS.0;
        print::line(name, " instructions, mean ", instructions(self.sum) / vector::S_M.len() as u32);
        print::line(name, " instructions, most ", instructions(self.most));
    }
}

#[entry]
fn main() -> ! {
    let is_right = cortex_m::Peripherals::take().is_some_and(|board| start(board.SYST).unwrap_or(false));
    debug::exit(if is_right { debug::EXIT_SUCCESS } else { debug::EXIT_FAILURE });
    loop {
        cortex_m::asm::nop();
    }
}

/// Both ways of stepping, and what they need.
fn start(mut clock: SYST) -> Result<bool, Error> {
    clock.set_clock_source(SystClkSource::Core);
    clock.set_reload(PERIOD_TICKS - 1);
    clock.clear_current();
    clock.enable_counter();
    let before = stack::paint();
    let filter = filter()?;
    let deepest = stack::used(before);
    let (constant, settled) = (Stream::constant_time(&filter), Stream::steady_state(&filter));
    print::line("start", ", bytes of stack ", deepest);
    print::line("state", ", bytes of a stream ", size_of::<Stream>() as u32);
    let is_right = run(constant, &mut clock, "every step whole:")?;
    Ok(run(settled, &mut clock, "steady state:")? && is_right)
}

#[inline(never)]
fn filter() -> Result<Filter, Error> {
    let [stiffness_n_per_m, damping_n_s_per_m, screw_mass_kg] = vector::ACTUATOR;
    let actuator = ActuatorModel::linear(stiffness_n_per_m, damping_n_s_per_m, screw_mass_kg)?;
    let w_d = Matrix3::from(vector::W_D);
    Filter::new(&actuator, vector::STEP_S, &NoiseModel::PerStep { w_d, v_d_m2: vector::V_D_M2 })
}

/// One sample; a function of its own, so that its stack is seen.
#[inline(never)]
fn step(stream: &mut Stream, y_m: f64, load_n: f64) -> Result<f64, Error> {
    Ok(stream.push(y_m, load_n)?.s_m())
}

/// Takes a sample at each tick of 1 kHz; whether S is the reference's.
fn run(mut stream: Stream, clock: &mut SYST, name: &str) -> Result<bool, Error> {
    let mut cost = Cost::default();
    let (mut peak_m, mut worst_m, mut deepest) = (0.0_f64, 0.0_f64, 0);
    for ((y_m, load_n), wanted_m) in vector::POSITION_M.iter().zip(vector::LOAD_N).zip(vector::S_M) {
        while !clock.has_wrapped() {}
        let before = stack::paint();
        let started = SYST::get_current();
        let s_m = step(&mut stream, *y_m, load_n)?;
        let done = SYST::get_current();
        deepest = deepest.max(stack::used(before));
        cost.add(started, done);
        (peak_m, worst_m) = (peak_m.max(wanted_m.abs()), worst_m.max((s_m - wanted_m).abs()));
    }
    cost.print(name);
    print::line(name, " bytes of stack ", deepest);
    Ok(worst_m <= TOLERANCE * peak_m)
}
