//! How to feed a model and read its answer.
//!
//! In: TOML, beside the ONNX file (`yolox.onnx`, `yolox.toml`). Out: a checked [`Manifest`]. What
//! each decoder makes of the numbers is written where they are decoded (`hachi-people`).

use serde::{Deserialize, Serialize};

use crate::model::{Port, Signature, shape_text};

/// No model takes a larger image than this on a side, pixels.
const MAX_SIDE: usize = 4096;

/// Cells of YOLO's coarsest grid are so many pixels wide.
const COARSEST: usize = 32;

/// Cells of YOLACT's finest grid are so many pixels wide, those of the next twice as many.
const YOLACT_FINEST: usize = 8;
/// More anchors than this are a mistake: YOLACT++ with its nine in each cell has 57 744.
const MAX_ANCHORS: usize = 1_000_000;

/// A model's description.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Manifest {
    /// What it is and where it is from, for people.
    pub about: String,
    /// What goes in.
    pub input: InputLayout,
    /// What comes out.
    pub decoder: Decoder,
}

/// How an image becomes a model's input.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct InputLayout {
    /// The input's name in the file.
    pub name: String,
    /// Pixels.
    pub width: usize,
    /// Pixels.
    pub height: usize,
    /// Channels first or last.
    pub layout: Layout,
    /// The order of colours.
    pub channels: Channels,
    /// How an image of another shape is fitted in.
    pub fit: Fit,
    /// What fills the rest, 0 to 255.
    #[serde(default)]
    pub fill: u8,
    /// How pixels between pixels are made.
    #[serde(default)]
    pub resample: Resample,
    /// Pixels (0 to 255) are divided by this first,
    #[serde(default = "one")]
    pub divide_by: f32,
    /// then the mean of each channel, in the order of `channels`, is taken off,
    #[serde(default)]
    pub mean: [f32; 3],
    /// then the rest is divided by this.
    #[serde(default = "ones")]
    pub deviation: [f32; 3],
    /// Whether it takes several images at once.
    #[serde(default)]
    pub many: bool,
}

fn one() -> f32 {
    1.0
}

fn ones() -> [f32; 3] {
    [1.0; 3]
}

/// Where the channels are.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Layout {
    /// Image, channel, row, column.
    Nchw,
    /// Image, row, column, channel.
    Nhwc,
}

/// The order of colours.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Channels {
    /// Red first.
    Rgb,
    /// Blue first.
    Bgr,
}

/// How an image of another shape is fitted in.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Fit {
    /// Each side by its own factor.
    Stretch,
    /// Both sides by one factor, in the left upper corner.
    LetterboxCorner,
    /// Both sides by one factor, in the middle.
    LetterboxCentre,
}

/// How pixels between pixels are made.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Resample {
    /// From the four around it, as OpenCV's `INTER_LINEAR`.
    #[default]
    Linear,
    /// The same, averaged where the image shrinks, as Pillow's `BILINEAR`.
    Smooth,
}

/// What the outputs mean.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Decoder {
    /// YOLOX: one output [1, places, 5 + classes].
    Yolox {
        /// Number of classes.
        classes: usize,
        /// The class of people.
        person: usize,
        /// The score at which a detection is as likely right as wrong.
        even_score: f64,
    },
    /// YOLOv8 and YOLO11: one output [1, 4 + classes + coefficients, places], and with coefficients
    /// a second one of mask prototypes [1, coefficients, height, width].
    Yolov8 {
        /// Number of classes.
        classes: usize,
        /// The class of people.
        person: usize,
        /// The score at which a detection is as likely right as wrong.
        even_score: f64,
        /// Numbers in a mask's recipe; 0 for a model without masks.
        #[serde(default)]
        coefficients: usize,
    },
    /// YOLACT: boxes [1, anchors, 4], scores [1, anchors, 1 + classes], recipes [1, anchors,
    /// coefficients], prototypes [1, height, width, coefficients], in this order.
    Yolact {
        /// Number of classes, without the background.
        classes: usize,
        /// The class of people, counted from 0 without the background.
        person: usize,
        /// The score at which a detection is as likely right as wrong.
        even_score: f64,
        /// Numbers in a mask's recipe.
        coefficients: usize,
        /// Side of the anchors on each level, pixels of the input: one list for each level.
        scales: Vec<Vec<f64>>,
        /// Width over height of the anchors.
        #[serde(default = "yolact_ratios")]
        aspect_ratios: Vec<f64>,
        /// Whether anchors are square whatever their ratio, as in YOLACT before ++.
        #[serde(default)]
        square: bool,
    },
    /// A feature of appearance: one output [n, length].
    Appearance {
        /// Numbers in a feature.
        length: usize,
        /// Whether features are brought to unit length. Cosine distances go by direction either way.
        normalise: bool,
        /// Two features are of one person up to this distance (1 - cosine).
        same_person_distance: f64,
    },
}

fn yolact_ratios() -> Vec<f64> {
    vec![1.0, 0.5, 2.0]
}

/// Columns and rows of YOLACT's grid on a level, from 0, for an input of this size.
pub fn yolact_grid([width, height]: [usize; 2], level: usize) -> [usize; 2] {
    // From the tenth level on, one cell holds the largest image.
    let cell = YOLACT_FINEST << level.min(9);
    [width.div_ceil(cell), height.div_ceil(cell)]
}

/// Anchors of all levels.
fn yolact_anchors(input: &InputLayout, scales: &[Vec<f64>], ratios: &[f64]) -> usize {
    let levels = scales.iter().enumerate().map(|(level, scales)| {
        let [columns, rows] = yolact_grid([input.width, input.height], level);
        let factors = [columns, rows, scales.len(), ratios.len()];
        factors.into_iter().fold(1, usize::saturating_mul)
    });
    levels.fold(0, usize::saturating_add)
}

/// Why a manifest or a model is refused.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ManifestError {
    /// Not a manifest.
    #[error("{0}")]
    Toml(String),
    /// A value that can't be.
    #[error("{key} is {found}, expected {expected}")]
    Value {
        /// Which.
        key: &'static str,
        /// What it is.
        found: String,
        /// What it may be.
        expected: &'static str,
    },
    /// The model is not the one described.
    #[error("{what}: the manifest expects {expected}, the model has {found}")]
    Mismatch {
        /// Of what.
        what: String,
        /// By the manifest.
        expected: String,
        /// In the file.
        found: String,
    },
}

impl Manifest {
    /// Reads and checks a manifest.
    ///
    /// # Errors
    /// Text that is no manifest, unknown keys, impossible values: each named.
    pub fn from_toml(text: &str) -> Result<Self, ManifestError> {
        let parsed: Result<Self, _> = toml::from_str(text);
        let manifest = parsed.map_err(|error| {
            // The first lines say where and what; the rest draws it.
            let said = error.to_string();
            ManifestError::Toml(said.split_whitespace().collect::<Vec<_>>().join(" "))
        })?;
        manifest.check()?;
        Ok(manifest)
    }

    fn check(&self) -> Result<(), ManifestError> {
        let value = |key, found: String, expected| {
            Err(ManifestError::Value {
                key,
                found,
                expected,
            })
        };
        let input = &self.input;
        for (key, side) in [("input.width", input.width), ("input.height", input.height)] {
            if !(1..=MAX_SIDE).contains(&side) {
                return value(key, side.to_string(), "1 to 4096 pixels");
            }
        }
        let grids = matches!(self.decoder, Decoder::Yolox { .. } | Decoder::Yolov8 { .. });
        let whole = |side: usize| side.is_multiple_of(COARSEST);
        if grids && !(whole(input.width) && whole(input.height)) {
            let found = format!("{}x{}", input.width, input.height);
            return value("input.width and input.height", found, "multiples of 32");
        }
        let divisors = std::iter::once(input.divide_by).chain(input.deviation);
        for divisor in divisors {
            if !(divisor.is_finite() && divisor > 0.0) {
                let key = "input.divide_by or input.deviation";
                return value(key, divisor.to_string(), "a number above 0");
            }
        }
        if input.mean.iter().any(|m| !m.is_finite()) {
            return value("input.mean", format!("{:?}", input.mean), "three numbers");
        }
        let (classes, person, even) = match &self.decoder {
            Decoder::Appearance {
                length,
                same_person_distance,
                ..
            } => {
                if !(1..=8192).contains(length) {
                    return value("decoder.length", length.to_string(), "1 to 8192");
                }
                if !(*same_person_distance > 0.0 && *same_person_distance < 2.0) {
                    let key = "decoder.same_person_distance";
                    return value(key, same_person_distance.to_string(), "above 0, below 2");
                }
                return Ok(());
            }
            Decoder::Yolox {
                classes,
                person,
                even_score,
            }
            | Decoder::Yolov8 {
                classes,
                person,
                even_score,
                ..
            } => (classes, person, even_score),
            Decoder::Yolact {
                classes,
                person,
                even_score,
                scales,
                aspect_ratios,
                ..
            } => {
                let mut sizes = scales.iter().flatten().chain(aspect_ratios);
                if scales.is_empty() || !sizes.all(|s| s.is_finite() && *s > 0.0) {
                    return value(
                        "decoder.scales",
                        format!("{scales:?}"),
                        "sizes above 0 for each level",
                    );
                }
                let anchors = yolact_anchors(input, scales, aspect_ratios);
                if !(1..=MAX_ANCHORS).contains(&anchors) {
                    let found = format!("{anchors} anchors");
                    return value("decoder.scales", found, "1 to 1000000 anchors");
                }
                (classes, person, even_score)
            }
        };
        if !(1..=10_000).contains(classes) {
            return value("decoder.classes", classes.to_string(), "1 to 10000");
        }
        if person >= classes {
            return value(
                "decoder.person",
                person.to_string(),
                "one of the classes, from 0",
            );
        }
        if !(*even > 0.0 && *even < 1.0) {
            return value("decoder.even_score", even.to_string(), "above 0, below 1");
        }
        Ok(())
    }

    /// The shape of an input of so many images.
    pub fn input_shape(&self, images: usize) -> [usize; 4] {
        let input = &self.input;
        match input.layout {
            Layout::Nchw => [images, 3, input.height, input.width],
            Layout::Nhwc => [images, input.height, input.width, 3],
        }
    }

    /// The shapes of the outputs for so many images, as far as they are known: `None` where the
    /// model says.
    pub fn output_shapes(&self, images: usize) -> Vec<Vec<Option<usize>>> {
        let (width, height) = (self.input.width, self.input.height);
        // One place for each pixel of the three grids.
        let places = [8, 16, 32].iter().map(|s| (width / s) * (height / s));
        let places: usize = places.sum();
        let n = Some(images);
        match &self.decoder {
            Decoder::Yolox { classes, .. } => vec![vec![n, Some(places), Some(5 + classes)]],
            Decoder::Yolov8 {
                classes,
                coefficients,
                ..
            } => {
                let mut shapes = vec![vec![n, Some(4 + classes + coefficients), Some(places)]];
                if *coefficients > 0 {
                    shapes.push(vec![n, Some(*coefficients), None, None]);
                }
                shapes
            }
            Decoder::Yolact {
                classes,
                coefficients,
                scales,
                aspect_ratios,
                ..
            } => {
                let anchors = Some(yolact_anchors(&self.input, scales, aspect_ratios));
                vec![
                    vec![n, anchors, Some(4)],
                    vec![n, anchors, Some(1 + classes)],
                    vec![n, anchors, Some(*coefficients)],
                    vec![n, None, None, Some(*coefficients)],
                ]
            }
            Decoder::Appearance { length, .. } => vec![vec![n, Some(*length)]],
        }
    }

    /// Compares what a file announces with what the manifest expects.
    ///
    /// # Errors
    /// The first difference, with both sides of it.
    pub fn check_signature(&self, signature: &Signature) -> Result<(), ManifestError> {
        let mismatch = |what: String, expected: String, found: String| {
            Err(ManifestError::Mismatch {
                what,
                expected,
                found,
            })
        };
        let [input] = &signature.inputs[..] else {
            let found = format!("{} of them", signature.inputs.len());
            return mismatch("inputs".to_owned(), "one".to_owned(), found);
        };
        if input.name != self.input.name {
            let expected = format!("{:?}", self.input.name);
            return mismatch(
                "the input's name".to_owned(),
                expected,
                format!("{:?}", input.name),
            );
        }
        let shape = self.input_shape(1);
        let many = !self.input.many || input.takes(&self.input_shape(2));
        if !(input.takes(&shape) && many && input.is_f32) {
            let any = if self.input.many {
                "any number of images"
            } else {
                "one image"
            };
            let expected = format!("{shape:?} in single precision, {any}");
            return mismatch("the input".to_owned(), expected, input.to_string());
        }
        let expected = self.output_shapes(1);
        if signature.outputs.len() != expected.len() {
            let found = format!("{}: {}", signature.outputs.len(), names(&signature.outputs));
            return mismatch("outputs".to_owned(), expected.len().to_string(), found);
        }
        for (output, shape) in signature.outputs.iter().zip(&expected) {
            let fits = output
                .shape
                .as_ref()
                .is_none_or(|found| agree(found, shape));
            if !(fits && output.is_f32) {
                let what = format!("output {:?}", output.name);
                return mismatch(what, shape_text(shape), output.to_string());
            }
        }
        Ok(())
    }

    /// Compares a real output's shape with what is expected of output `index`.
    ///
    /// # Errors
    /// The difference, with both sides of it.
    pub fn check_output(
        &self,
        index: usize,
        images: usize,
        shape: &[usize],
    ) -> Result<(), ManifestError> {
        let expected = self.output_shapes(images);
        let found: Vec<Option<usize>> = shape.iter().map(|d| Some(*d)).collect();
        match expected.get(index) {
            Some(expected) if agree(&found, expected) => Ok(()),
            expected => Err(ManifestError::Mismatch {
                what: format!("output {index}"),
                expected: expected.map_or_else(|| "none".to_owned(), |e| shape_text(e)),
                found: format!("{shape:?}"),
            }),
        }
    }
}

fn names(ports: &[Port]) -> String {
    let names: Vec<_> = ports.iter().map(ToString::to_string).collect();
    names.join(", ")
}

/// Whether two shapes can be one.
fn agree(a: &[Option<usize>], b: &[Option<usize>]) -> bool {
    let same = |(a, b): (&Option<usize>, &Option<usize>)| match (a, b) {
        (Some(a), Some(b)) => a == b,
        _ => true,
    };
    a.len() == b.len() && a.iter().zip(b).all(same)
}
