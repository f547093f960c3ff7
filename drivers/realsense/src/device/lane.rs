//! One stream: pictures and their metadata, which come through two devices in either order, put
//! together by their sequence number.
//!
//! In: buffers. Out: whole frames, oldest first; when more than a few wait the oldest goes. All
//! memory is taken when the lane is made.

use std::collections::VecDeque;
use std::vec;
use std::vec::Vec;

use hachi_hal::Stamp;

use super::counters::StreamCounters;
use super::link::{Buffer, Part};
use crate::frame::FrameMetadata;

/// Whole frames that may wait for their partner: one stream may be so many frames later than the
/// other.
const MOST_READY: usize = 4;

/// A whole frame; its bytes are the lane's.
#[derive(Debug, Clone, Copy)]
pub(super) struct Frame {
    /// When the kernel saw its picture.
    pub received: Stamp,
    /// What the camera says of it, if it says anything.
    pub metadata: Option<FrameMetadata>,
}

#[derive(Debug)]
pub(super) struct Lane {
    has_metadata: bool,
    /// The picture that waits for its metadata.
    waiting: Option<(u32, Stamp)>,
    waiting_bytes: Vec<u8>,
    /// The metadata that wait for their picture.
    metadata: Option<(u32, FrameMetadata)>,
    ready: VecDeque<(Frame, Vec<u8>)>,
    /// Memory for pictures that is not in use.
    spare: Vec<Vec<u8>>,
    last_sequence: Option<u32>,
    pub counters: StreamCounters,
}

impl Lane {
    /// A lane for pictures of `len` bytes.
    pub fn new(len: usize, has_metadata: bool) -> Self {
        Self {
            has_metadata,
            waiting: None,
            waiting_bytes: vec![0; len],
            metadata: None,
            ready: VecDeque::with_capacity(MOST_READY),
            spare: vec![vec![0; len]; MOST_READY],
            last_sequence: None,
            counters: StreamCounters::default(),
        }
    }

    /// Takes a buffer in.
    pub fn push(&mut self, buffer: &Buffer<'_>) {
        match buffer.part {
            Part::Picture => self.push_picture(buffer),
            Part::Metadata => self.push_metadata(buffer),
        }
    }

    fn push_picture(&mut self, buffer: &Buffer<'_>) {
        // A picture still waiting is one whose metadata the kernel dropped.
        self.finish(None);
        let sequence = buffer.sequence;
        if let Some(last) = self.last_sequence.replace(sequence) {
            // Half the range: numbers that go back begin anew, which is no loss.
            let step = sequence.wrapping_sub(last).cast_signed();
            self.counters.lost += u64::try_from(step - 1).unwrap_or(0);
        }
        let Some(bytes) = buffer.bytes.get(..self.waiting_bytes.len()) else {
            self.counters.cut += 1;
            return;
        };
        if buffer.damaged {
            self.counters.damaged += 1;
            return;
        }
        self.waiting_bytes.copy_from_slice(bytes);
        self.waiting = Some((sequence, buffer.received));
        match self.metadata.take() {
            Some((of, metadata)) if of == sequence => self.finish(Some(metadata)),
            Some(_) => self.counters.stray_metadata += 1,
            None if self.has_metadata => {}
            None => self.finish(None),
        }
    }

    fn push_metadata(&mut self, buffer: &Buffer<'_>) {
        let Ok(metadata) = FrameMetadata::decode(buffer.bytes) else {
            self.counters.bad_metadata += 1;
            return;
        };
        if self.waiting.is_some_and(|(of, _)| of == buffer.sequence) {
            self.finish(Some(metadata));
        } else if self.metadata.replace((buffer.sequence, metadata)).is_some() {
            self.counters.stray_metadata += 1;
        }
    }

    /// Makes the waiting picture a whole frame.
    fn finish(&mut self, metadata: Option<FrameMetadata>) {
        let Some((_, received)) = self.waiting.take() else {
            return;
        };
        if metadata.is_some_and(|m| m.damaged) {
            self.counters.damaged += 1;
            return;
        }
        if self.has_metadata && metadata.is_none() {
            self.counters.without_metadata += 1;
        }
        self.counters.frames += 1;
        if self.ready.len() == MOST_READY {
            self.drop_unpaired();
        }
        // As many pictures are spare or ready as there may be ready ones, so one is spare here.
        let Some(mut bytes) = self.spare.pop() else {
            return;
        };
        std::mem::swap(&mut self.waiting_bytes, &mut bytes);
        self.ready.push_back((Frame { received, metadata }, bytes));
    }

    /// The oldest whole frame, if there is one, and its picture.
    pub fn ready(&self) -> Option<(&Frame, &[u8])> {
        let (frame, bytes) = self.ready.front()?;
        Some((frame, bytes))
    }

    /// The newest whole frame.
    pub fn newest(&self) -> Option<&Frame> {
        self.ready.back().map(|(frame, _)| frame)
    }

    /// The oldest whole frame was used.
    pub fn take(&mut self) {
        if let Some((_, bytes)) = self.ready.pop_front() {
            self.spare.push(bytes);
        }
    }

    /// The oldest whole frame has no partner.
    pub fn drop_unpaired(&mut self) {
        self.take();
        self.counters.unpaired += 1;
    }
}
