//! What a model is to its users, whatever runs it.

use std::fmt;

use crate::Tensor;

/// A network that turns one tensor into some.
///
/// The same input gives the same outputs, bit for bit, on one back end with one number of threads.
pub trait Model: Send {
    /// What it takes and gives, as its file says.
    fn signature(&self) -> &Signature;

    /// Runs it. `outputs` are replaced by as many as the signature names, in its order.
    ///
    /// # Errors
    /// The input has another shape than the signature, or the back end failed.
    fn run(&mut self, input: &Tensor, outputs: &mut Vec<Tensor>) -> Result<(), RunError>;
}

/// What a model takes and gives.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Signature {
    /// What runs it: `embedded`, `onnxruntime (CPU)`.
    pub back_end: String,
    /// Its inputs.
    pub inputs: Vec<Port>,
    /// Its outputs.
    pub outputs: Vec<Port>,
}

/// An input or output.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Port {
    /// Its name in the file.
    pub name: String,
    /// Its dimensions; `None` where any size will do. No shape at all where the file gives none.
    pub shape: Option<Vec<Option<usize>>>,
    /// Whether it holds single-precision numbers.
    pub is_f32: bool,
}

impl Port {
    /// Whether a tensor of this shape fits.
    pub fn takes(&self, shape: &[usize]) -> bool {
        self.shape.as_ref().is_none_or(|dimensions| {
            dimensions.len() == shape.len()
                && dimensions
                    .iter()
                    .zip(shape)
                    .all(|(d, s)| d.is_none_or(|d| d == *s))
        })
    }
}

impl fmt::Display for Port {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:?} ", self.name)?;
        match &self.shape {
            None => f.write_str("of any shape")?,
            Some(shape) => f.write_str(&shape_text(shape))?,
        }
        if !self.is_f32 {
            f.write_str(", not single precision")?;
        }
        Ok(())
    }
}

/// A shape in words: `[any, 3]`.
pub fn shape_text(shape: &[Option<usize>]) -> String {
    let size = |size: &Option<usize>| size.map_or_else(|| "any".to_owned(), |s| s.to_string());
    let sizes: Vec<_> = shape.iter().map(size).collect();
    format!("[{}]", sizes.join(", "))
}

/// Why a model gave no answer.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum RunError {
    /// The input is not what the model takes.
    #[error("the model takes {expected}, and was given {found:?}")]
    Input {
        /// What it takes.
        expected: String,
        /// What it was given.
        found: Vec<usize>,
    },
    /// An output is not what was announced.
    #[error("output {name:?} is {found}")]
    Output {
        /// Which.
        name: String,
        /// What it is.
        found: String,
    },
    /// The back end failed.
    #[error("{back_end} failed: {reason}")]
    BackEnd {
        /// Which.
        back_end: String,
        /// What it said.
        reason: String,
    },
}
