//! A model of fixed answers: tests of what comes after a network need no weights.

use std::collections::VecDeque;

use crate::{Model, RunError, Signature, Tensor};

/// Gives one answer after the other, whatever it is asked; the last one for good.
#[derive(Debug, Clone)]
pub struct FixedAnswers {
    signature: Signature,
    answers: VecDeque<Vec<Tensor>>,
}

impl FixedAnswers {
    /// A model that gives these answers.
    pub fn new(signature: Signature, answers: impl IntoIterator<Item = Vec<Tensor>>) -> Self {
        Self {
            signature,
            answers: answers.into_iter().collect(),
        }
    }
}

impl Model for FixedAnswers {
    fn signature(&self) -> &Signature {
        &self.signature
    }

    fn run(&mut self, _: &Tensor, outputs: &mut Vec<Tensor>) -> Result<(), RunError> {
        let answer = match self.answers.len() {
            0 => None,
            1 => self.answers.front().cloned(),
            _ => self.answers.pop_front(),
        };
        *outputs = answer.ok_or_else(|| RunError::BackEnd {
            back_end: "fixed".to_owned(),
            reason: "there is no answer".to_owned(),
        })?;
        Ok(())
    }
}
