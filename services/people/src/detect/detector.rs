//! An image in, people and things out.

use hachi_inference::{
    Decoder, ImageError, ImageView, Loaded, Manifest, Model, Placement, Preprocessor, RunError,
    Tensor,
};

use super::candidate::{Candidate, DecodeError};
use super::mask::Mask;
use super::suppress::suppress;
use super::yolact::Anchors;
use super::{yolact, yolov8, yolox};
use crate::BoundingBox;
use crate::track::LEAST_SHARE;

/// What was found in an image.
#[derive(Debug, Clone, PartialEq)]
pub struct Found {
    /// Where, pixels of the image, inside it.
    pub bounding_box: BoundingBox,
    /// How sure, 0 to 1.
    pub score: f64,
    /// What, by the network's own numbers.
    pub class: usize,
    /// Which pixels, if the network says so.
    pub mask: Option<Mask>,
}

/// What to look for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Wanted {
    /// People alone.
    People,
    /// All that the network knows.
    All,
}

/// The model is no detector.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("this model gives features of appearance: it finds nobody")]
pub struct NotADetector;

/// Why an image was not looked at.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum DetectError {
    /// It is no image.
    #[error(transparent)]
    Image(#[from] ImageError),
    /// The network failed.
    #[error(transparent)]
    Run(#[from] RunError),
    /// The network's answer is none.
    #[error(transparent)]
    Decode(#[from] DecodeError),
}

/// A detector's network with its buffers.
pub struct Detector {
    model: Box<dyn Model>,
    manifest: Manifest,
    wanted: Wanted,
    person: usize,
    even_score: f64,
    anchors: Anchors,
    preprocessor: Preprocessor,
    input: Tensor,
    outputs: Vec<Tensor>,
    candidates: Vec<Candidate>,
    found: Vec<Found>,
}

impl Detector {
    /// A detector that looks for people, or for all its network knows.
    ///
    /// # Errors
    /// The model is none.
    pub fn new(loaded: Loaded, wanted: Wanted) -> Result<Self, NotADetector> {
        let Loaded { manifest, model } = loaded;
        let size = [manifest.input.width, manifest.input.height];
        let mut anchors = Anchors::default();
        let (person, even_score) = match &manifest.decoder {
            Decoder::Yolox {
                person, even_score, ..
            }
            | Decoder::Yolov8 {
                person, even_score, ..
            } => (*person, *even_score),
            Decoder::Yolact {
                person,
                even_score,
                scales,
                aspect_ratios,
                square,
                ..
            } => {
                anchors = Anchors::new(size, scales, aspect_ratios, *square);
                (*person, *even_score)
            }
            Decoder::Appearance { .. } => return Err(NotADetector),
        };
        Ok(Self {
            input: Tensor::zeros(&manifest.input_shape(1)),
            model,
            manifest,
            wanted,
            person,
            even_score,
            anchors,
            preprocessor: Preprocessor::default(),
            outputs: Vec::new(),
            candidates: Vec::new(),
            found: Vec::new(),
        })
    }

    /// The score at which a detection is as likely right as wrong.
    pub fn even_score(&self) -> f64 {
        self.even_score
    }

    /// The class of people.
    pub fn person(&self) -> usize {
        self.person
    }

    /// What was in the last image.
    pub fn found(&self) -> &[Found] {
        &self.found
    }

    /// What is in the image, surest first.
    ///
    /// # Errors
    /// [`DetectError`]; the detector goes on with the next image.
    pub fn detect(&mut self, image: &ImageView<'_>) -> Result<&[Found], DetectError> {
        self.found.clear();
        let layout = &self.manifest.input;
        let slot = self.input.values_mut();
        let placement = self.preprocessor.fill(layout, image, None, slot)?;
        self.model.run(&self.input, &mut self.outputs)?;
        self.decode()?;
        if self.wanted == Wanted::People {
            let person = self.person;
            self.candidates
                .retain(|candidate| candidate.class == person);
        }
        suppress(&mut self.candidates);
        self.bring_back(image, placement)?;
        Ok(&self.found)
    }

    fn decode(&mut self) -> Result<(), DecodeError> {
        let least = LEAST_SHARE * self.even_score;
        let candidates = &mut self.candidates;
        candidates.clear();
        let size = [self.manifest.input.width, self.manifest.input.height];
        match &self.manifest.decoder {
            Decoder::Yolox { classes, .. } => {
                yolox::decode(&self.outputs, size, *classes, least, candidates)
            }
            Decoder::Yolov8 {
                classes,
                coefficients,
                ..
            } => yolov8::decode(&self.outputs, *classes, *coefficients, least, candidates),
            Decoder::Yolact { classes, .. } => {
                yolact::decode(&self.outputs, &self.anchors, *classes, least, candidates)
            }
            Decoder::Appearance { .. } => Ok(()),
        }
    }

    /// Boxes and masks, in pixels of the image. A box that lies outside it was seen in the margin.
    fn bring_back(
        &mut self,
        image: &ImageView<'_>,
        placement: Placement,
    ) -> Result<(), DecodeError> {
        let size = [self.manifest.input.width, self.manifest.input.height];
        let masks = match &self.manifest.decoder {
            Decoder::Yolov8 {
                classes,
                coefficients,
                ..
            } if *coefficients > 0 => Some(yolov8::masks(&self.outputs, *classes, *coefficients)?),
            Decoder::Yolact { coefficients, .. } => {
                Some(yolact::masks(&self.outputs, &self.anchors, *coefficients)?)
            }
            _ => None,
        };
        for candidate in &self.candidates {
            let b = &candidate.bounding_box;
            let [left, top] = placement.to_image([b.left, b.top]);
            let [right, bottom] = placement.to_image([b.right(), b.bottom()]);
            let (left, top) = (left.max(0.0), top.max(0.0));
            let right = right.min(image.width() as f64);
            let bottom = bottom.min(image.height() as f64);
            let bounding_box = BoundingBox::of_edges([left, top, right, bottom]);
            if !bounding_box.is_sound() {
                continue;
            }
            let mask = masks.as_ref().map(|(prototypes, recipes)| {
                Mask::assemble(prototypes, recipes, candidate.place, b, size, placement)
            });
            self.found.push(Found {
                bounding_box,
                score: candidate.score,
                class: candidate.class,
                mask,
            });
        }
        Ok(())
    }
}
