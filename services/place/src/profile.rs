//! The polar grid of a database's descriptors, and which one fits a place.
//!
//! In: a levelled cloud, or numbers. Out: a [`Profile`]: rings, sectors, reach, the height of the
//! ground's bins and the sideways steps of the virtual views. Descriptors compare only within one
//! profile, so a database has one: given, or that of its first descriptor.

/// Most rings a grid may have.
pub const MAX_RINGS: usize = 256;
/// Most sectors a grid may have.
pub const MAX_SECTORS: usize = 720;
/// Most bins a grid may have: a bin's index fits 16 bits with room for "outside".
pub const MAX_BINS: usize = 1 << 15;
/// Most sideways steps to each side.
pub const MAX_LATERAL_STEPS: usize = 4;

/// What stands around the robot is nearer than this indoors. Offices and corridors measured 3 to
/// 6 m (11 m with every twelfth return astray), streets 10 to 31 m, KITTI's 32 m.
const INDOOR_REACH_M: f32 = 11.0;
/// Share of the sectors that decides: a corridor is open at two ends.
const DECIDING_SHARE: f32 = 0.75;
/// Returns nearer than this are the robot's own body.
const NEAREST_M: f32 = 0.5;
/// Returns lower than this are the ground, which says nothing of how far one sees.
const ABOVE_GROUND_M: f32 = 0.3;
/// Sectors of the choice.
const CHOICE_SECTORS: usize = 60;
/// Returns looked at, at most.
const CHOICE_POINTS: usize = 30_000;

/// A polar grid, seen from above, and where to look at it from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Profile {
    rings: u16,
    sectors: u16,
    max_range_m: f32,
    ground_offset_m: f32,
    lateral_step_m: f32,
    lateral_steps: u8,
}

/// Why a grid is refused.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ProfileError {
    /// No ring, no sector, or more bins than an index can name.
    #[error(
        "{rings} rings and {sectors} sectors: 1 to {MAX_RINGS} and 4 to {MAX_SECTORS} are possible, \
         {MAX_BINS} bins in all"
    )]
    Bins {
        /// Rings asked for.
        rings: usize,
        /// Sectors asked for.
        sectors: usize,
    },
    /// A length that is none.
    #[error("{name} is {value} m: expected {expected}")]
    Length {
        /// Which.
        name: &'static str,
        /// Its value.
        value: f32,
        /// What it may be.
        expected: &'static str,
    },
    /// More virtual views than make sense.
    #[error("{0} sideways steps to each side, at most {MAX_LATERAL_STEPS} are possible")]
    LateralSteps(usize),
}

impl Profile {
    /// Streets, yards, halls: 20 rings of 4 m, 60 sectors of 6 degrees (Kim and Kim, "Scan
    /// Context", IROS 2018), and a view from the lane to each side, 3 m away.
    pub const OUTDOOR: Self = Self {
        rings: 20,
        sectors: 60,
        max_range_m: 80.0,
        ground_offset_m: 1.0,
        lateral_step_m: 3.0,
        lateral_steps: 1,
    };

    /// Rooms and corridors: 20 rings of 1 m, and views from half a metre and a metre to each side.
    pub const INDOOR: Self = Self {
        rings: 20,
        sectors: 60,
        max_range_m: 20.0,
        ground_offset_m: 1.0,
        lateral_step_m: 0.5,
        lateral_steps: 2,
    };

    /// A grid of another shape, with the outdoor profile's other values in proportion.
    ///
    /// # Errors
    /// [`ProfileError`] if there is no such grid.
    pub fn new(rings: usize, sectors: usize, max_range_m: f32) -> Result<Self, ProfileError> {
        if !(1..=MAX_RINGS).contains(&rings)
            || !(4..=MAX_SECTORS).contains(&sectors)
            || rings * sectors > MAX_BINS
        {
            return Err(ProfileError::Bins { rings, sectors });
        }
        if !(0.01..=1e5).contains(&max_range_m) {
            return Err(ProfileError::Length {
                name: "the reach",
                value: max_range_m,
                expected: "0.01 to 100,000 m",
            });
        }
        Ok(Self {
            rings: rings as u16,
            sectors: sectors as u16,
            max_range_m,
            ..Self::OUTDOOR
        })
    }

    /// The same grid with `steps` virtual views to each side, `step_m` metres apart.
    ///
    /// # Errors
    /// [`ProfileError`] for more than [`MAX_LATERAL_STEPS`], or a step that is no length.
    pub fn with_lateral(mut self, step_m: f32, steps: usize) -> Result<Self, ProfileError> {
        if steps > MAX_LATERAL_STEPS {
            return Err(ProfileError::LateralSteps(steps));
        }
        if !(step_m > 0.0 && step_m <= 1e3) {
            return Err(ProfileError::Length {
                name: "the sideways step",
                value: step_m,
                expected: "more than 0, at most 1,000 m",
            });
        }
        (self.lateral_step_m, self.lateral_steps) = (step_m, steps as u8);
        Ok(self)
    }

    /// The same grid whose ground bins hold `offset_m`: what keeps them apart from empty bins.
    ///
    /// # Errors
    /// [`ProfileError`] if it is no length.
    pub fn with_ground_offset(mut self, offset_m: f32) -> Result<Self, ProfileError> {
        if !(offset_m > 0.0 && offset_m <= 100.0) {
            return Err(ProfileError::Length {
                name: "the ground's value",
                value: offset_m,
                expected: "more than 0, at most 100 m",
            });
        }
        self.ground_offset_m = offset_m;
        Ok(self)
    }

    /// [`INDOOR`](Self::INDOOR) or [`OUTDOOR`](Self::OUTDOOR), by the cloud's own extent: in each
    /// of 60 sectors the median range of what stands above the ground, and of these the upper
    /// quartile. Within 11 m it is indoors. Sectors without a return (a sensor that looks forward)
    /// do not count. `None` for a cloud with nothing above the ground.
    pub fn for_cloud(points: &[[f32; 4]]) -> Option<Self> {
        let mut ranges: [Vec<f32>; CHOICE_SECTORS] = std::array::from_fn(|_| Vec::new());
        let step = points.len().div_ceil(CHOICE_POINTS).max(1);
        for &[x, y, z, _] in points.iter().step_by(step) {
            let range = x.hypot(y);
            if range.is_finite() && range >= NEAREST_M && z > ABOVE_GROUND_M {
                let turn = y.atan2(x) / std::f32::consts::TAU + 0.5;
                let sector = ((turn * CHOICE_SECTORS as f32) as usize).min(CHOICE_SECTORS - 1);
                ranges[sector].push(range);
            }
        }
        let medians = ranges.iter_mut().filter_map(|r| quantile(r, 0.5));
        let reach = quantile(&mut medians.collect::<Vec<f32>>(), DECIDING_SHARE)?;
        Some(if reach < INDOOR_REACH_M {
            Self::INDOOR
        } else {
            Self::OUTDOOR
        })
    }

    /// The profile of a database's first clouds: the one that most of them ask for,
    /// [`OUTDOOR`](Self::OUTDOOR) if there is none.
    pub fn for_clouds<'a>(clouds: impl IntoIterator<Item = &'a [[f32; 4]]>) -> Self {
        let (mut indoor, mut outdoor) = (0, 0);
        for profile in clouds.into_iter().filter_map(Self::for_cloud) {
            match profile == Self::INDOOR {
                true => indoor += 1,
                false => outdoor += 1,
            }
        }
        match indoor > outdoor {
            true => Self::INDOOR,
            false => Self::OUTDOOR,
        }
    }

    /// Rings, from the middle outwards.
    pub const fn rings(&self) -> usize {
        self.rings as usize
    }

    /// Sectors, anticlockwise from the x axis.
    pub const fn sectors(&self) -> usize {
        self.sectors as usize
    }

    /// Rings times sectors.
    pub const fn bins(&self) -> usize {
        self.rings() * self.sectors()
    }

    /// Outer radius of the last ring, metres. Returns beyond it are left out.
    pub const fn max_range_m(&self) -> f32 {
        self.max_range_m
    }

    /// Added to every height, metres: a return on the ground has this value, an empty bin 0.
    pub const fn ground_offset_m(&self) -> f32 {
        self.ground_offset_m
    }

    /// Sideways positions of the views: 0 first, then the virtual ones, metres to the left.
    pub fn laterals(&self) -> impl Iterator<Item = f32> + use<> {
        let step = self.lateral_step_m;
        let aside = (1..=self.lateral_steps).flat_map(move |i| {
            let offset = f32::from(i) * step;
            [offset, -offset]
        });
        std::iter::once(0.0).chain(aside)
    }

    /// Angle of one sector, radians.
    pub fn sector_rad(&self) -> f32 {
        std::f32::consts::TAU / self.sectors as f32
    }

    /// Sideways step of the virtual views, metres, and how many to each side.
    pub const fn lateral(&self) -> (f32, usize) {
        (self.lateral_step_m, self.lateral_steps as usize)
    }
}

/// The value that a share of the values is below.
fn quantile(values: &mut [f32], share: f32) -> Option<f32> {
    let at = (values.len() as f32 * share) as usize;
    (at < values.len()).then(|| *values.select_nth_unstable_by(at, f32::total_cmp).1)
}
