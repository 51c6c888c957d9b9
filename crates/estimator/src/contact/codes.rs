//! Codes of rejected flights and of quality flags.

/// Why a flight cannot show its gap. Each has a stable code and a remedy.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Rejection {
    /// The load presses on one flank only.
    NoLoadReversal,
    /// One flank is touched for less than a second.
    OneSideBrief,
    /// The load does not rise above the friction that is to be expected, or above nothing.
    LoadTooSmall,
    /// The motor moves less than the wind-up.
    TravelTooSmall,
    /// Fewer than 20 samples a second, or a load that vibrates faster than it is sampled.
    RateTooLow,
    /// δX travels further than gap and wind-up account for: friction may hold the screw within the gap. Or gap or stiffness
    /// would be negative.
    MotionUnexplained,
    /// Under nine seconds of sound samples, or too few in contact.
    TooShort,
    /// A channel never changes.
    ChannelConstant,
    /// δX falls with the load, and friction agrees with the positions.
    LoadSignFlipped,
    /// δX falls with the load, and the sign of friction shows that motor and screw are exchanged.
    PositionsSwapped,
    /// One position is not a multiple of one of the other.
    PositionRatio,
}

impl Rejection {
    /// The code that records keep.
    pub fn code(self) -> &'static str {
        match self {
            Self::NoLoadReversal => "no_load_reversal",
            Self::OneSideBrief => "one_side_brief",
            Self::LoadTooSmall => "load_too_small",
            Self::TravelTooSmall => "travel_too_small",
            Self::RateTooLow => "rate_too_low",
            Self::MotionUnexplained => "motion_unexplained",
            Self::TooShort => "too_short",
            Self::ChannelConstant => "channel_constant",
            Self::LoadSignFlipped => "load_sign_flipped",
            Self::PositionsSwapped => "positions_swapped",
            Self::PositionRatio => "position_ratio",
        }
    }

    /// Remedy for the user.
    pub fn remedy(self) -> &'static str {
        match self {
            Self::NoLoadReversal => "use a flight, or a ground check, in which the load changes sides",
            Self::OneSideBrief => {
                "use a longer flight, or one with more manoeuvres, so that both flanks are pressed"
            }
            Self::LoadTooSmall => {
                "check the load channel and its unit; a surface without airload shows no gap"
            }
            Self::TravelTooSmall => {
                "use a flight in which the actuator moves; at rest, friction and play are not distinguishable"
            }
            Self::RateTooLow => {
                "record at 20 samples a second or more, 50 or more for a small gap, and at twice the frequency of \
                 any strong vibration of the load"
            }
            Self::MotionUnexplained => {
                "check that the load is this actuator's; else use a flight with more load, or more travel, so \
                 that friction does not hold the screw within its gap"
            }
            Self::TooShort => "record at least 9 s of valid samples in which the load presses on both flanks",
            Self::ChannelConstant => "check wiring and mapping: a channel that never changes is not measured",
            Self::LoadSignFlipped => {
                "reverse the sign of the load in the mapping (set `sign = -1` in `[channel.load]`, or remove it where it \
                 is set): the load must be positive along +X"
            }
            Self::PositionsSwapped => {
                "exchange `column` of `[channel.motor_position]` and `[channel.screw_position]`, or reverse both signs"
            }
            Self::PositionRatio => {
                "check `lead_m_per_rev` of the part (of a rotary one `gear_ratio` of the channel), and unit and sign of the positions: screw against motor must have \
                 slope 1 (`freeplay check` shows it)"
            }
        }
    }
}

/// A quality flag: a finding that does not prevent the estimate.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum QualityFlag {
    /// The gap is under two standard errors, or under a hundredth of the wind-up: read the upper bound.
    BelowDetection,
    /// The published statistic at the fitted stiffness differs by more than both methods explain.
    EstimatorsDisagree,
    /// 1/K lies more than three spreads from the part's.
    StiffnessImplausible,
    /// The 95 % load is under three times the friction.
    FrictionHeavy,
    /// Flanks are soft at low load: a fit of higher loads alone reads another gap.
    SoftContact,
    /// The gap depends on the place of the stroke: `gap_m` is its mean over time.
    GapVaries,
    /// The gap is negative by more than two standard errors, which no gap can be.
    GapNegative,
    /// The standard error exceeds a tenth of the wind-up.
    Imprecise,
    /// Both flanks press at low load, so that there is no gap.
    Preloaded,
}

impl QualityFlag {
    /// The code that records keep.
    pub fn code(self) -> &'static str {
        match self {
            Self::BelowDetection => "below_detection",
            Self::EstimatorsDisagree => "estimators_disagree",
            Self::StiffnessImplausible => "stiffness_implausible",
            Self::FrictionHeavy => "friction_heavy",
            Self::SoftContact => "soft_contact",
            Self::GapVaries => "gap_varies",
            Self::GapNegative => "gap_negative",
            Self::Imprecise => "imprecise",
            Self::Preloaded => "preloaded",
        }
    }
}
