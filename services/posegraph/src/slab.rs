//! Factors under identifiers that are never given twice, in slots that are.

use crate::error::Error;
use crate::factor::{Factor, FactorId};
use crate::group::Group;

#[derive(Debug, Clone)]
struct Slot<T> {
    generation: u32,
    content: Option<T>,
}

/// Values under [`FactorId`]s. Memory follows the largest number of values held at once.
#[derive(Debug, Clone)]
pub(crate) struct Slab<T> {
    slots: Vec<Slot<T>>,
    free: Vec<u32>,
}

impl<T> Default for Slab<T> {
    fn default() -> Self {
        Self {
            slots: Vec::new(),
            free: Vec::new(),
        }
    }
}

/// Slots and poses are numbered with 32 bits; the last number means none.
pub(crate) const MOST: usize = u32::MAX as usize - 1;

impl<T> Slab<T> {
    /// Whether `more` values can be added.
    pub fn check_room(&self, more: usize) -> Result<(), Error> {
        if self.slots.len().saturating_add(more) > MOST {
            return Err(Error::TooLarge { limit: MOST });
        }
        Ok(())
    }

    /// Adds a value; [`check_room`](Self::check_room) was asked before.
    pub fn insert(&mut self, content: T) -> FactorId {
        if let Some(slot) = self.free.pop() {
            let entry = &mut self.slots[slot as usize];
            entry.content = Some(content);
            return FactorId {
                slot,
                generation: entry.generation,
            };
        }
        let slot = self.slots.len() as u32;
        self.slots.push(Slot {
            generation: 0,
            content: Some(content),
        });
        FactorId {
            slot,
            generation: 0,
        }
    }

    pub fn get(&self, id: FactorId) -> Option<&T> {
        let slot = self.slots.get(id.slot as usize)?;
        (slot.generation == id.generation)
            .then_some(slot.content.as_ref())
            .flatten()
    }

    /// Takes a value out. Its identifier is spent.
    pub fn remove(&mut self, id: FactorId) -> Option<T> {
        let content = self.take(id)?;
        self.release(id);
        Some(content)
    }

    /// Takes a value out for [`restore`](Self::restore) or [`release`](Self::release).
    pub fn take(&mut self, id: FactorId) -> Option<T> {
        self.get(id)?;
        self.slots[id.slot as usize].content.take()
    }

    /// Puts a value back as if it had never been taken.
    pub fn restore(&mut self, id: FactorId, content: T) {
        self.slots[id.slot as usize].content = Some(content);
    }

    /// Spends the identifier of a value that was taken.
    pub fn release(&mut self, id: FactorId) {
        let slot = &mut self.slots[id.slot as usize];
        // A slot whose generations are spent is left empty for good.
        if let Some(next) = slot.generation.checked_add(1) {
            slot.generation = next;
            self.free.push(id.slot);
        }
    }

    /// The value in a slot that is known to be full.
    #[inline(always)]
    pub fn at(&self, slot: u32) -> &T {
        self.slots[slot as usize]
            .content
            .as_ref()
            .expect("a slot that poses point to is full")
    }

    pub fn id_at(&self, slot: u32) -> FactorId {
        FactorId {
            slot,
            generation: self.slots[slot as usize].generation,
        }
    }

    /// In the order of slots.
    pub fn iter(&self) -> impl Iterator<Item = (FactorId, &T)> {
        self.slots.iter().enumerate().filter_map(|(slot, entry)| {
            let id = FactorId {
                slot: slot as u32,
                generation: entry.generation,
            };
            entry.content.as_ref().map(|content| (id, content))
        })
    }
}

/// A factor with the indices of its poses; both the same for a prior.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Bound<G: Group> {
    pub factor: Factor<G>,
    pub from: u32,
    pub to: u32,
    /// Its information leaves no direction open.
    pub definite: bool,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_identifier_is_never_given_twice() {
        let mut slab = Slab::default();
        let a = slab.insert("a");
        assert_eq!(slab.remove(a), Some("a"));
        let b = slab.insert("b");
        assert_ne!(a, b);
        assert_eq!(slab.get(a), None);
        assert_eq!(slab.remove(a), None);
        assert_eq!(slab.get(b), Some(&"b"));
    }

    #[test]
    fn slots_are_used_again() {
        let mut slab = Slab::default();
        for k in 0..1000 {
            let id = slab.insert(k);
            slab.remove(id);
        }
        assert_eq!(slab.slots.len(), 1);
    }
}
