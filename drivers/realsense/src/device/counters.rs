//! What happened to frames, and why some were left out.

/// Counts of one stream.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct StreamCounters {
    /// Whole pictures.
    pub frames: u64,
    /// Pictures that the kernel dropped, by the gaps of its numbers.
    pub lost: u64,
    /// Pictures that end too early.
    pub cut: u64,
    /// Pictures that kernel or camera mark as damaged.
    pub damaged: u64,
    /// Whole pictures for which the other stream has none of the same time.
    pub unpaired: u64,
    /// Whole pictures whose metadata did not come: they carry the kernel's time.
    pub without_metadata: u64,
    /// Metadata that could not be read.
    pub bad_metadata: u64,
    /// Metadata whose picture did not come.
    pub stray_metadata: u64,
}

impl StreamCounters {
    fn add(&mut self, other: &Self) {
        self.frames += other.frames;
        self.lost += other.lost;
        self.cut += other.cut;
        self.damaged += other.damaged;
        self.unpaired += other.unpaired;
        self.without_metadata += other.without_metadata;
        self.bad_metadata += other.bad_metadata;
        self.stray_metadata += other.stray_metadata;
    }
}

/// Counts of what came and of what was left out, by reason.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct RealSenseCounters {
    /// Frames handed out: a depth image with its colour image.
    pub pairs: u64,
    /// How often the camera was opened.
    pub opened: u64,
    /// How often it went away.
    pub unplugged: u64,
    /// How often it was there and sent nothing, and was opened anew.
    pub stalled: u64,
    /// How often the camera's clock jumped.
    pub clock_jumps: u64,
    /// How often the receiver's clock was set back.
    pub receiver_clock_set_back: u64,
    /// Frames whose stamp was moved so that time does not go backwards.
    pub stamp_moved: u64,
    /// The depth stream.
    pub depth: StreamCounters,
    /// The colour stream.
    pub color: StreamCounters,
}

impl RealSenseCounters {
    /// Reasons for which something was left out or is in doubt, and how often.
    pub fn dropped(&self) -> impl Iterator<Item = (&'static str, u64)> {
        let (depth, color) = (&self.depth, &self.color);
        [
            ("unplugged", self.unplugged),
            ("stalled", self.stalled),
            ("clock_jumps", self.clock_jumps),
            ("receiver_clock_set_back", self.receiver_clock_set_back),
            ("stamp_moved", self.stamp_moved),
            ("depth_lost", depth.lost),
            ("depth_cut", depth.cut),
            ("depth_damaged", depth.damaged),
            ("depth_unpaired", depth.unpaired),
            ("depth_without_metadata", depth.without_metadata),
            ("depth_bad_metadata", depth.bad_metadata),
            ("depth_stray_metadata", depth.stray_metadata),
            ("color_lost", color.lost),
            ("color_cut", color.cut),
            ("color_damaged", color.damaged),
            ("color_unpaired", color.unpaired),
            ("color_without_metadata", color.without_metadata),
            ("color_bad_metadata", color.bad_metadata),
            ("color_stray_metadata", color.stray_metadata),
        ]
        .into_iter()
    }

    /// With the counts of a session on top.
    pub(super) fn with(mut self, session: &super::session::Tally) -> Self {
        self.clock_jumps += session.clock_jumps;
        self.receiver_clock_set_back += session.receiver_clock_set_back;
        self.depth.add(&session.depth);
        self.color.add(&session.color);
        self
    }
}
