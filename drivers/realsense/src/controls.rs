//! Settings of the depth camera: selectors of its extension unit, and the bytes behind them.
//!
//! In: what is wanted. Out: payloads to set, in the control's own size. Elsewhere: the colour
//! camera's settings, which are the system's ordinary video controls (`device`).

/// Number of the extension unit on the depth interface.
pub const UNIT: u8 = 3;

/// A control of the extension unit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Selector {
    /// Commands to the firmware: see [`crate::monitor`].
    Monitor,
    /// The projector.
    Emitter,
    /// Exposure of the imagers, µs.
    Exposure,
    /// Power of the projector, mW.
    LaserPower,
    /// Whether exposure is automatic.
    AutoExposure,
}

impl Selector {
    /// Its number.
    pub const fn number(self) -> u8 {
        match self {
            Self::Monitor => 1,
            Self::Emitter => 2,
            Self::Exposure => 3,
            Self::LaserPower => 4,
            Self::AutoExposure => 0x0B,
        }
    }

    /// Bytes of its value.
    pub const fn size(self) -> usize {
        match self {
            Self::Monitor => crate::monitor::MONITOR_LEN,
            Self::Emitter | Self::AutoExposure => 1,
            Self::Exposure => 4,
            Self::LaserPower => 2,
        }
    }

    /// The name that a person would use.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Monitor => "hardware monitor",
            Self::Emitter => "emitter",
            Self::Exposure => "exposure",
            Self::LaserPower => "laser power",
            Self::AutoExposure => "automatic exposure",
        }
    }
}

/// What is asked of a control.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Query {
    /// The value in force.
    Current,
    /// The smallest.
    Minimum,
    /// The largest.
    Maximum,
    /// The step between two.
    Resolution,
    /// The value after plugging in.
    Default,
}

impl Query {
    /// Its number (UVC 1.5, table A-8).
    pub const fn number(self) -> u8 {
        match self {
            Self::Current => 0x81,
            Self::Minimum => 0x82,
            Self::Maximum => 0x83,
            Self::Resolution => 0x84,
            Self::Default => 0x87,
        }
    }
}

/// What the projector does.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Emitter {
    /// Dark: for two cameras that would blind each other.
    Off,
    /// A pattern on every frame, which plain walls need.
    #[default]
    Laser,
    /// As the camera thinks best.
    Automatic,
}

impl Emitter {
    /// Its number.
    pub const fn number(self) -> u32 {
        match self {
            Self::Off => 0,
            Self::Laser => 1,
            Self::Automatic => 2,
        }
    }
}

/// How long a picture is exposed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Exposure {
    /// As the camera thinks best.
    #[default]
    Automatic,
    /// So many µs.
    Fixed(u32),
}

/// How the depth camera is set.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub struct DepthSettings {
    /// How long it exposes.
    pub exposure: Exposure,
    /// What the projector does.
    pub emitter: Emitter,
    /// Power of the projector, mW; `None` leaves it as it is.
    pub laser_power_mw: Option<u32>,
}

impl DepthSettings {
    /// The controls to set, in this order, each with its value.
    pub fn controls(&self) -> impl Iterator<Item = (Selector, u32)> {
        let (automatic, exposure) = match self.exposure {
            Exposure::Automatic => (1, None),
            Exposure::Fixed(us) => (0, Some((Selector::Exposure, us))),
        };
        [
            // A fixed exposure is refused while the automatic one is on.
            Some((Selector::AutoExposure, automatic)),
            exposure,
            Some((Selector::Emitter, self.emitter.number())),
            self.laser_power_mw.map(|mw| (Selector::LaserPower, mw)),
        ]
        .into_iter()
        .flatten()
    }
}

/// A value as a control's bytes, little-endian, in `buffer`; `None` if it does not fit in the
/// control, or the control holds no number.
pub fn encode(selector: Selector, value: u32, buffer: &mut [u8; 4]) -> Option<&[u8]> {
    *buffer = value.to_le_bytes();
    let (bytes, rest) = buffer.split_at_checked(selector.size())?;
    rest.iter().all(|&byte| byte == 0).then_some(bytes)
}

/// A control's value from its bytes, little-endian; `None` if they are too many for a number.
pub fn decode(bytes: &[u8]) -> Option<u32> {
    let fits = (1..=4).contains(&bytes.len());
    fits.then(|| {
        let fold = |value, byte: &u8| value << 8 | u32::from(*byte);
        bytes.iter().rev().fold(0, fold)
    })
}
