//! What a surface does to a laser pulse: how much it scatters back, lets through and mirrors.
//!
//! In: nothing. Out: [`Material`], a plain value that every object of a scene carries.
//! Elsewhere: following a pulse through the scene (`optics`). Reflectivities are round figures for
//! the near infrared (about 905 nm), where most paints are brighter than to the eye.

/// How a surface answers a laser pulse.
///
/// All figures are shares of the light that arrives, 0 to 1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Material {
    /// Share scattered back by a surface hit head-on, on the scale of a white Lambertian target.
    pub reflectivity: f32,
    /// Exponent of the cosine of the angle of incidence: 1 is Lambert's law (smooth, matt), less
    /// is a rough surface, which stays bright at grazing angles.
    pub incidence_exponent: f32,
    /// What else the surface does.
    pub finish: Finish,
}

/// What a surface does besides scattering.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Finish {
    /// Nothing.
    Matte,
    /// Sends the light back to where it came from: signs, safety clothing.
    Retroreflective,
    /// Mirrors a share of the light, more at grazing angles: polished or wet floors, lifts.
    Polished {
        /// Share mirrored head-on.
        mirrored: f32,
    },
    /// A thin transparent pane.
    Glass {
        /// Share mirrored head-on: 0.08 for plain glass, more for solar coatings.
        mirrored: f32,
        /// Share swallowed by one passage.
        absorbed: f32,
    },
}

/// Schlick's approximation: the share mirrored grows from `head_on` to 1 at grazing incidence.
pub(crate) fn mirrored_share(head_on: f32, cosine: f32) -> f32 {
    let grazing = (1.0 - cosine).clamp(0.0, 1.0);
    let square = grazing * grazing;
    head_on + (1.0 - head_on) * square * square * grazing
}

impl Material {
    /// A matt, rough surface.
    pub const fn rough(reflectivity: f32) -> Self {
        Self {
            reflectivity,
            incidence_exponent: 0.4,
            finish: Finish::Matte,
        }
    }

    /// A smooth, matt surface, which darkens with the cosine.
    pub const fn smooth(reflectivity: f32) -> Self {
        Self {
            reflectivity,
            incidence_exponent: 1.0,
            finish: Finish::Matte,
        }
    }

    /// Painted plaster.
    pub const WALL: Self = Self::rough(0.62);
    /// Acoustic ceiling tiles.
    pub const CEILING: Self = Self::rough(0.75);
    /// Vinyl or linoleum: at the angles a walking robot sees it under, 2 to 9 counts of 255.
    pub const FLOOR: Self = Self::smooth(0.30);
    /// The same, wet or freshly polished: it mirrors what stands on it.
    pub const POLISHED_FLOOR: Self = Self {
        reflectivity: 0.12,
        incidence_exponent: 1.0,
        finish: Finish::Polished { mirrored: 0.18 },
    };
    /// Wood, light.
    pub const WOOD: Self = Self::rough(0.50);
    /// Painted metal.
    pub const METAL: Self = Self::rough(0.35);
    /// Dark cloth and plastic.
    pub const CLOTH: Self = Self::rough(0.22);
    /// A facade or curtain that swallows nearly all.
    pub const DARK: Self = Self::rough(0.03);
    /// Rough concrete.
    pub const CONCRETE: Self = Self::rough(0.45);
    /// An escape-route sign.
    pub const SIGN: Self = Self {
        reflectivity: 0.9,
        incidence_exponent: 0.3,
        finish: Finish::Retroreflective,
    };
    /// A clear window pane.
    pub const CLEAR_GLASS: Self = Self {
        reflectivity: 0.06,
        incidence_exponent: 1.0,
        finish: Finish::Glass {
            mirrored: 0.08,
            absorbed: 0.04,
        },
    };
    /// A pane with a solar coating, which mirrors the near infrared.
    pub const COATED_GLASS: Self = Self {
        reflectivity: 0.10,
        incidence_exponent: 1.0,
        finish: Finish::Glass {
            mirrored: 0.28,
            absorbed: 0.22,
        },
    };

    /// Whether this is a pane of glass.
    pub const fn is_glass(&self) -> bool {
        matches!(self.finish, Finish::Glass { .. })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn glass_mirrors_its_head_on_share_and_everything_at_grazing_incidence() {
        assert_eq!(mirrored_share(0.08, 1.0), 0.08);
        assert!((mirrored_share(0.08, 0.0) - 1.0).abs() < 1e-6);
        // 60 degrees: 0.08 + 0.92 / 32.
        assert!((mirrored_share(0.08, 0.5) - 0.10875).abs() < 1e-6);
    }
}
