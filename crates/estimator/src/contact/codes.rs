//! Codes of rejected flights and of quality flags.

use strum::{EnumMessage, EnumString, IntoStaticStr};

/// Why a flight cannot show its gap. Each has a stable code and a remedy.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, EnumString, IntoStaticStr, EnumMessage)]
#[strum(serialize_all = "snake_case")]
pub enum Rejection {
    /// The load presses on one flank only.
    #[strum(message = "use a flight, or a ground check, in which the load changes sides")]
    NoLoadReversal,
    /// One flank is touched for less than a second.
    #[strum(message = "use a longer flight, or one with more manoeuvres, so that both flanks are pressed")]
    OneSideBrief,
    /// The load has one size, or is clipped to one: gap and wind-up are not distinguishable.
    #[strum(
        message = "use a flight, or a ground check, in which the load changes its size as well as its side, within the \
        range of the load cell"
    )]
    LoadHeld,
    /// The load stays below the expected friction, or is zero.
    #[strum(message = "check the load channel and its unit; a surface without airload shows no gap")]
    LoadTooSmall,
    /// The motor travels less than three wind-ups at the 95 % load.
    #[strum(
        message = "use a flight in which the actuator moves; at rest, friction and play are not distinguishable"
    )]
    TravelTooSmall,
    /// Fewer than 20 samples a second, or a load that vibrates faster than it is sampled.
    #[strum(
        message = "record at 20 samples a second or more, 50 or more for a small gap, and at twice the frequency \
        of any strong vibration of the load"
    )]
    RateTooLow,
    /// δX travels further than gap and wind-up account for: friction may hold the screw within the gap. Or gap or stiffness
    /// would be negative.
    #[strum(
        message = "check that the load is this actuator's, and not late (`latency_s`), and that an output declared as \
        `output = \"locked\"` is fixed; else use a flight with more \
        load, or more travel, so that friction does not hold the screw within its gap; inspect a unit whose flights \
        were estimated before"
    )]
    MotionUnexplained,
    /// Under nine seconds of sound samples, or too few in contact.
    #[strum(message = "record at least 9 s of valid samples in which the load presses on both flanks")]
    TooShort,
    /// A channel never changes.
    #[strum(message = "check wiring and mapping: a channel that never changes is not measured")]
    ChannelConstant,
    /// δX falls with the load, and friction agrees with the positions.
    #[strum(
        message = "reverse the sign of the load in the mapping (set `sign = -1` in `[channel.load]`, or remove it \
        where it is set): the load must be positive along +X"
    )]
    LoadSignFlipped,
    /// δX falls with the load, and the sign of friction shows that motor and screw are exchanged.
    #[strum(
        message = "exchange `column` of `[channel.motor_position]` and `[channel.screw_position]`, or reverse both \
        signs; where `relative_position` is mapped, reverse its `sign`"
    )]
    PositionsSwapped,
    /// The ratio of the two positions is not 1.
    #[strum(
        message = "check `lead_m_per_rev` of the part (of a rotary one `gear_ratio` of the channel), and unit and \
        sign of the positions, and `wraps_at` of one that starts again with each turn: screw against motor must \
        have slope 1 (`freeplay check` shows it)"
    )]
    PositionRatio,
}

impl Rejection {
    /// The code that records keep.
    pub fn code(self) -> &'static str {
        self.into()
    }

    /// Remedy for the user.
    pub fn remedy(self) -> &'static str {
        self.get_message().unwrap_or_default()
    }
}

/// A quality flag: a finding that does not prevent the estimate.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, IntoStaticStr)]
#[strum(serialize_all = "snake_case")]
pub enum QualityFlag {
    /// The gap is under two standard errors, or under a hundredth of the wind-up: read the upper bound.
    BelowDetection,
    /// The published statistic at the fitted stiffness differs by more than both methods explain.
    EstimatorsDisagree,
    /// The fitted stiffness differs from the part's by a factor of more than 1.45: three spreads of 15 %.
    StiffnessImplausible,
    /// δX scatters about the fit by more than three tenths of the wind-up and a quarter of the gap.
    FitPoor,
    /// The reading of the load cell jumps at zero load.
    LoadJumps,
    /// The 95 % load is under three times the friction.
    FrictionHeavy,
    /// A fit of higher loads alone reads a narrower gap: at high load the logged load is less than the true one.
    LoadBends,
    /// Flanks are soft at low load: a fit of higher loads alone reads a wider gap.
    SoftContact,
    /// The gap depends on the place of the stroke: `gap_m` is its mean over time.
    GapVaries,
    /// The gap is negative by more than two standard errors, which no gap can be.
    GapNegative,
    /// The standard error exceeds a tenth of the wind-up, or a twentieth of it and three twentieths of the gap.
    Imprecise,
    /// Both flanks press at low load, so that there is no gap.
    Preloaded,
}

impl QualityFlag {
    /// The code that records keep.
    pub fn code(self) -> &'static str {
        self.into()
    }
}
