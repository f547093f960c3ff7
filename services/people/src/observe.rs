//! From an image to people with features: what the tracker and re-identification are fed.
//!
//! In: an image. Out: detections of people and a feature for each sure one. [`Observer::observe`]
//! is the pipeline.

use hachi_inference::ImageView;

use crate::appearance::{Appearance, AppearanceError, Person};
use crate::detect::{DetectError, Detector, Found};
use crate::track::{Detection, Features};

/// Why an image was not looked at.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ObserveError {
    /// Nobody could be found.
    #[error("the detector failed: {0}")]
    Detect(#[from] DetectError),
    /// Whoever was found has no features.
    #[error("re-identification failed: {0}")]
    Appearance(#[from] AppearanceError),
}

/// A detector and, if there is one, a network that tells people apart.
pub struct Observer {
    detector: Detector,
    appearance: Option<Appearance>,
    detections: Vec<Detection>,
    features: Vec<f32>,
}

/// The people in an image.
#[derive(Debug, Clone, Copy)]
pub struct Observation<'a> {
    /// Where they are, surest first.
    pub detections: &'a [Detection],
    /// What they look like, in the same order; zeros for those who are not sure.
    pub features: Option<Features<'a>>,
    /// Columns of the image; `None` where there is none (another detector's boxes).
    pub columns: Option<usize>,
}

impl Observer {
    /// An observer. The detector should look for people alone.
    pub fn new(detector: Detector, appearance: Option<Appearance>) -> Self {
        Self {
            detector,
            appearance,
            detections: Vec::new(),
            features: Vec::new(),
        }
    }

    /// The score at which a detection is as likely a person as not.
    pub fn even_score(&self) -> f64 {
        self.detector.even_score()
    }

    /// What the detector found in the last image; with a detector that looks for people alone, the
    /// detections of the last observation, in their order, with their masks.
    pub fn found(&self) -> &[Found] {
        self.detector.found()
    }

    /// The network that tells people apart.
    pub fn appearance(&mut self) -> Option<&mut Appearance> {
        self.appearance.as_mut()
    }

    /// Who is in the image.
    ///
    /// # Errors
    /// [`ObserveError`]; the observer goes on with the next image.
    pub fn observe(&mut self, image: &ImageView<'_>) -> Result<Observation<'_>, ObserveError> {
        let person = self.detector.person();
        let even_score = self.detector.even_score();
        let found = self.detector.detect(image)?;
        let people = found.iter().filter(|found| found.class == person);
        let people: Vec<&Found> = people.collect();
        self.detections.clear();
        self.detections.extend(people.iter().map(|found| Detection {
            bounding_box: found.bounding_box,
            score: found.score,
        }));
        let Some(appearance) = &mut self.appearance else {
            return Ok(Observation {
                detections: &self.detections,
                features: None,
                columns: Some(image.width()),
            });
        };
        // Surest first, so that whoever has a feature stands before whoever has none.
        let sure = people.iter().filter(|found| found.score >= even_score);
        let sure: Vec<_> = sure
            .map(|found| Person {
                bounding_box: found.bounding_box,
                mask: found.mask.as_ref(),
            })
            .collect();
        let dimension = appearance.length();
        self.features.clear();
        self.features
            .extend_from_slice(appearance.features(image, &sure)?);
        self.features.resize(dimension * self.detections.len(), 0.0);
        Ok(Observation {
            detections: &self.detections,
            features: Some(Features {
                dimension,
                values: &self.features,
                same_person_distance: appearance.same_person_distance(),
            }),
            columns: Some(image.width()),
        })
    }
}
