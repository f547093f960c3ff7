//! Numbers and a shape.

/// Single-precision numbers in row-major order.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Tensor {
    shape: Vec<usize>,
    values: Vec<f32>,
}

impl Tensor {
    /// A tensor of zeros.
    pub fn zeros(shape: &[usize]) -> Self {
        let mut tensor = Self::default();
        tensor.reset(shape);
        tensor
    }

    /// A tensor of these numbers; `None` if there are not as many as the shape has places.
    pub fn from_values(shape: &[usize], values: Vec<f32>) -> Option<Self> {
        let places = shape.iter().try_fold(1_usize, |n, &d| n.checked_mul(d))?;
        (places == values.len()).then(|| Self {
            shape: shape.to_vec(),
            values,
        })
    }

    /// Makes it zeros of another shape; memory it has is used again.
    pub fn reset(&mut self, shape: &[usize]) {
        self.shape.clear();
        self.shape.extend_from_slice(shape);
        self.values.clear();
        self.values.resize(shape.iter().product(), 0.0);
    }

    /// Its shape.
    pub fn shape(&self) -> &[usize] {
        &self.shape
    }

    /// Its numbers.
    pub fn values(&self) -> &[f32] {
        &self.values
    }

    /// Its numbers, to be filled in.
    pub fn values_mut(&mut self) -> &mut [f32] {
        &mut self.values
    }
}
