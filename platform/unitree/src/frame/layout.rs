//! What differs between the robots' frames. Everything else is the same for both.

/// A robot of this maker whose frames are known.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Model {
    /// Unitree Go1.
    Go1,
    /// Unitree B1.
    B1,
}

impl Model {
    /// Its name.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Go1 => "Go1",
            Self::B1 => "B1",
        }
    }

    /// The first byte of a serial number, as community decoders read it.
    pub const fn product_code(self) -> u8 {
        match self {
            Self::Go1 => 4,
            Self::B1 => 5,
        }
    }
}

/// The four frames that travel.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum FrameKind {
    /// Host to robot: walk, stand, lie.
    HighCmd,
    /// Robot to host: everything it knows.
    HighState,
    /// Host to robot: motor by motor.
    LowCmd,
    /// Robot to host: motors, inertial sensor, feet.
    LowState,
}

impl FrameKind {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::HighCmd, Self::HighState, Self::LowCmd, Self::LowState];

    /// Its name.
    pub const fn name(self) -> &'static str {
        match self {
            Self::HighCmd => "HighCmd",
            Self::HighState => "HighState",
            Self::LowCmd => "LowCmd",
            Self::LowState => "LowState",
        }
    }

    /// Whether a host sends it.
    pub const fn is_command(self) -> bool {
        matches!(self, Self::HighCmd | Self::LowCmd)
    }
}

/// Longest frame of any robot, bytes.
pub const LONGEST_FRAME: usize = 1139;
/// Motors in every frame; the first twelve are legs, the rest unused.
pub const MOTORS: usize = 20;
/// Most cells of a battery.
pub const MOST_CELLS: usize = 30;
/// Most thermistors of one kind in a battery.
pub const MOST_THERMISTORS: usize = 8;

/// How one robot lays out its frames.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Layout {
    /// Whose it is.
    pub model: Model,
    /// Whether a HighCmd holds shifts of the centre of mass and of the feet (16 bytes).
    pub has_stance_shifts: bool,
    /// Thermistors of the battery's own monitor, and as many of its controller.
    pub thermistors: usize,
    /// Cells of the battery.
    pub cells: usize,
    /// Counts of torque in low-level frames, per Nm.
    pub torque_counts_per_nm: f32,
}

impl Layout {
    /// The Go1's.
    pub const GO1: Self = Self {
        model: Model::Go1,
        has_stance_shifts: false,
        thermistors: 2,
        cells: 10,
        torque_counts_per_nm: 256.0,
    };

    /// The B1's.
    pub const B1: Self = Self {
        model: Model::B1,
        has_stance_shifts: true,
        thermistors: 8,
        cells: 30,
        torque_counts_per_nm: 128.0,
    };

    /// Every layout that is known.
    pub const KNOWN: [&'static Self; 2] = [&Self::GO1, &Self::B1];

    /// Bytes of a frame.
    pub const fn frame_len(&self, kind: FrameKind) -> usize {
        let battery_front = 10 + 2 * self.thermistors;
        match kind {
            FrameKind::HighCmd => 129 + if self.has_stance_shifts { 16 } else { 0 },
            FrameKind::HighState => 835 + battery_front + 2 * self.cells + 218,
            FrameKind::LowCmd => 614,
            FrameKind::LowState => 715 + battery_front + self.cells + 68,
        }
    }

    /// Which known frame has this length, if it is not one that several have.
    pub fn frame_of_len(len: usize) -> Option<(Model, FrameKind)> {
        let mut found = None;
        for layout in Self::KNOWN {
            for kind in FrameKind::ALL {
                if layout.frame_len(kind) == len {
                    if found.is_some() {
                        return None;
                    }
                    found = Some((layout.model, kind));
                }
            }
        }
        found
    }
}
