//! What people look like, as a network's features.
//!
//! In: an image, boxes of people, their masks where there are some. Out: one feature for each box.
//! The network's manifest says what size crops have, how they are normalised, and how features
//! compare. What does not belong to the person is black.

use hachi_inference::{
    Decoder, ImageError, ImageView, Loaded, Manifest, Model, Preprocessor, Region, RunError, Tensor,
};

use crate::BoundingBox;
use crate::detect::Mask;

/// So many crops go through the network at once: more gain nothing on small computers.
const MOST_AT_ONCE: usize = 16;

/// The model gives no features.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("this model is a detector: it gives no features of appearance")]
pub struct NoFeatures;

/// Why there are no features.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum AppearanceError {
    /// It is no image.
    #[error(transparent)]
    Image(#[from] ImageError),
    /// The network failed.
    #[error(transparent)]
    Run(#[from] RunError),
    /// A network that has come apart, or another shape than it announced.
    #[error("the network gave {found}, expected {expected} finite numbers")]
    Answer {
        /// How many.
        expected: usize,
        /// What came.
        found: String,
    },
}

/// A person in an image.
#[derive(Debug, Clone, Copy)]
pub struct Person<'a> {
    /// Where, pixels.
    pub bounding_box: BoundingBox,
    /// Which pixels.
    pub mask: Option<&'a Mask>,
}

/// A network that tells people apart, with its buffers.
pub struct Appearance {
    model: Box<dyn Model>,
    manifest: Manifest,
    length: usize,
    normalise: bool,
    same_person_distance: f64,
    preprocessor: Preprocessor,
    blanked: Vec<u8>,
    input: Tensor,
    outputs: Vec<Tensor>,
    features: Vec<f32>,
}

impl Appearance {
    /// A network for features.
    ///
    /// # Errors
    /// The model is none.
    pub fn new(loaded: Loaded) -> Result<Self, NoFeatures> {
        let Loaded { manifest, model } = loaded;
        let Decoder::Appearance {
            length,
            normalise,
            same_person_distance,
        } = manifest.decoder
        else {
            return Err(NoFeatures);
        };
        Ok(Self {
            model,
            manifest,
            length,
            normalise,
            same_person_distance,
            preprocessor: Preprocessor::default(),
            blanked: Vec::new(),
            input: Tensor::default(),
            outputs: Vec::new(),
            features: Vec::new(),
        })
    }

    /// Numbers in a feature.
    pub fn length(&self) -> usize {
        self.length
    }

    /// Two features are of one person up to this distance (1 - cosine).
    pub fn same_person_distance(&self) -> f64 {
        self.same_person_distance
    }

    /// Features of these people, one after the other. One of whom nothing lies in the image has a
    /// feature of zeros.
    ///
    /// # Errors
    /// [`AppearanceError`].
    pub fn features(
        &mut self,
        image: &ImageView<'_>,
        people: &[Person<'_>],
    ) -> Result<&[f32], AppearanceError> {
        self.features.clear();
        let at_once = if self.manifest.input.many {
            MOST_AT_ONCE
        } else {
            1
        };
        for group in people.chunks(at_once) {
            self.look(image, group)?;
        }
        Ok(&self.features)
    }

    fn look(
        &mut self,
        image: &ImageView<'_>,
        people: &[Person<'_>],
    ) -> Result<(), AppearanceError> {
        self.input.reset(&self.manifest.input_shape(people.len()));
        let numbers = self.input.values().len() / people.len().max(1);
        let mut seen = [false; MOST_AT_ONCE];
        for (index, person) in people.iter().enumerate() {
            let slot = &mut self.input.values_mut()[index * numbers..(index + 1) * numbers];
            let b = &person.bounding_box;
            let region = Region {
                left: b.left,
                top: b.top,
                width: b.width,
                height: b.height,
            };
            let Some(region) = region.within(image) else {
                continue;
            };
            seen[index] = true;
            let layout = &self.manifest.input;
            let filled = match person.mask {
                None => self.preprocessor.fill(layout, image, Some(region), slot),
                Some(mask) => {
                    let crop = blank(image, &region, mask, &mut self.blanked)?;
                    self.preprocessor.fill(layout, &crop, None, slot)
                }
            };
            filled?;
        }
        self.model.run(&self.input, &mut self.outputs)?;
        let output = self.outputs.first();
        let wrong = |found: String| AppearanceError::Answer {
            expected: people.len() * self.length,
            found,
        };
        let output = output.ok_or_else(|| wrong("nothing".to_owned()))?;
        if output.shape() != [people.len(), self.length] {
            return Err(wrong(format!("{:?}", output.shape())));
        }
        if output.values().iter().any(|v| !v.is_finite()) {
            return Err(wrong("numbers that are none".to_owned()));
        }
        for (feature, seen) in output.values().chunks_exact(self.length).zip(seen) {
            let length = feature.iter().map(|v| v * v).sum::<f32>().sqrt();
            let scale = match self.normalise {
                _ if !seen || length == 0.0 => 0.0,
                true => 1.0 / length,
                false => 1.0,
            };
            self.features.extend(feature.iter().map(|v| v * scale));
        }
        Ok(())
    }
}

/// The region alone, with black where the mask is not.
fn blank<'a>(
    image: &ImageView<'_>,
    region: &Region,
    mask: &Mask,
    pixels: &'a mut Vec<u8>,
) -> Result<ImageView<'a>, ImageError> {
    let (left, top) = (region.left.floor() as usize, region.top.floor() as usize);
    let right = ((region.left + region.width).ceil() as usize).min(image.width());
    let bottom = ((region.top + region.height).ceil() as usize).min(image.height());
    pixels.clear();
    for y in top..bottom {
        for x in left..right {
            let at = 3 * (y * image.width() + x);
            let inside = mask.covers([x as f64 + 0.5, y as f64 + 0.5]);
            let pixel = if inside {
                &image.rgb()[at..at + 3]
            } else {
                &[0; 3]
            };
            pixels.extend_from_slice(pixel);
        }
    }
    ImageView::new(right - left, bottom - top, pixels)
}

#[cfg(test)]
mod tests {
    use super::*;
    use hachi_inference::fixed::FixedAnswers;
    use hachi_inference::{Signature, known};

    /// A network of features of 512 numbers that gives these answers.
    fn network(answers: Vec<Tensor>) -> Appearance {
        let manifest = Manifest::from_toml(known::manifest("osnet_x0_25_msmt17").unwrap()).unwrap();
        let signature = Signature {
            back_end: "fixed".to_owned(),
            inputs: Vec::new(),
            outputs: Vec::new(),
        };
        let answers = answers.into_iter().map(|a| vec![a]);
        let model = Box::new(FixedAnswers::new(signature, answers));
        Appearance::new(Loaded { manifest, model }).unwrap()
    }

    fn person(left: f64) -> Person<'static> {
        Person {
            bounding_box: BoundingBox::new(left, 0.0, 8.0, 16.0),
            mask: None,
        }
    }

    #[test]
    fn features_have_unit_length_and_who_is_not_in_the_image_has_none() {
        let rgb = vec![7; 3 * 32 * 32];
        let image = ImageView::new(32, 32, &rgb).unwrap();
        let answer = Tensor::from_values(&[2, 512], vec![3.0; 1024]).unwrap();
        let mut appearance = network(vec![answer]);
        let features = appearance
            .features(&image, &[person(0.0), person(100.0)])
            .unwrap();
        let length = |f: &[f32]| f.iter().map(|v| v * v).sum::<f32>();
        assert!((length(&features[..512]) - 1.0).abs() < 1e-5);
        assert_eq!(features[512..], [0.0; 512]);
    }

    #[test]
    fn a_network_that_comes_apart_is_refused() {
        let rgb = vec![7; 3 * 32 * 32];
        let image = ImageView::new(32, 32, &rgb).unwrap();
        let nan = Tensor::from_values(&[1, 512], vec![f32::NAN; 512]).unwrap();
        let short = Tensor::zeros(&[1, 256]);
        let mut appearance = network(vec![nan, short]);
        for said in ["none", "[1, 256]"] {
            let error = appearance.features(&image, &[person(0.0)]).unwrap_err();
            assert!(error.to_string().contains(said), "{error}");
        }
    }
}
