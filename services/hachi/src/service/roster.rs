//! Whom the robot knows, by lasting numbers: whoever is in the store, and the person that was picked.
//!
//! In: who became known, was picked, released or forgotten. Out: which of CARPE-ID's people each is. A
//! person whom the user points at again has another number in there, and the same one here.

use hachi_people::identify::PersonId;
use hachi_people::pointing::Picked;
use hachi_store::people::StoredId;

/// Somebody whom the robot knows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Known {
    /// Their number: counted from 1, never given twice.
    pub number: u32,
    /// Their number in the identifier.
    pub person: PersonId,
    /// Their number in the store, if they are in it.
    pub stored: Option<StoredId>,
}

/// Everybody whom the robot knows.
#[derive(Debug, Default)]
pub struct Roster {
    people: Vec<Known>,
    picked: Option<u32>,
    last: u32,
}

impl Roster {
    /// Everybody, in the order in which they became known.
    pub fn people(&self) -> &[Known] {
        &self.people
    }

    /// The number of the robot's person.
    pub fn picked(&self) -> Option<u32> {
        self.picked
    }

    /// Who has a number in the identifier.
    pub fn of(&self, person: PersonId) -> Option<&Known> {
        self.people.iter().find(|known| known.person == person)
    }

    /// The robot's person, or whoever else is known first.
    pub fn first(&self) -> Option<&Known> {
        let picked = |known: &&Known| Some(known.number) == self.picked;
        let found = self.people.iter().find(picked);
        found.or_else(|| self.people.first())
    }

    /// Somebody is known from now on; their number.
    pub fn add(&mut self, person: PersonId, stored: Option<StoredId>) -> u32 {
        self.last += 1;
        self.people.push(Known {
            number: self.last,
            person,
            stored,
        });
        self.last
    }

    /// Somebody has another number in the identifier.
    pub fn renumber(&mut self, was: PersonId, person: PersonId) {
        if let Some(known) = self.people.iter_mut().find(|known| known.person == was) {
            known.person = person;
        }
    }

    /// The robot's person from now on: their number. Whoever was it before, and is in no store, is
    /// nobody any more: the identifier is to forget them.
    pub fn pick(&mut self, picked: &Picked) -> (u32, Option<PersonId>) {
        if let Some(was) = picked.was {
            self.renumber(was, picked.person);
        }
        let number = match self.of(picked.person) {
            Some(known) => known.number,
            None => self.add(picked.person, None),
        };
        let gone = match self.picked {
            Some(before) if before != number => self.release().and_then(|(_, gone)| gone),
            _ => None,
        };
        self.picked = Some(number);
        (number, gone)
    }

    /// The robot has no person any more: who that was, and whom the identifier is to forget.
    pub fn release(&mut self) -> Option<(u32, Option<PersonId>)> {
        let number = self.picked.take()?;
        let nobody = |known: &Known| known.number == number && known.stored.is_none();
        let gone = self.people.iter().find(|known| nobody(known));
        let gone = gone.map(|known| known.person);
        self.people.retain(|known| !nobody(known));
        Some((number, gone))
    }

    /// Somebody is in the store from now on, under the number that they had.
    pub fn store(&mut self, person: PersonId, stored: StoredId) {
        if let Some(known) = self.people.iter_mut().find(|known| known.person == person) {
            known.stored = Some(stored);
        }
    }

    /// Somebody is in the store no more, and known no more: whom the identifier is to forget.
    pub fn forget(&mut self, stored: StoredId) -> Option<PersonId> {
        let found = self.people.iter().find(|k| k.stored == Some(stored));
        let Known { number, person, .. } = *found?;
        self.people.retain(|known| known.number != number);
        self.picked = self.picked.filter(|picked| *picked != number);
        Some(person)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picked(person: u32, was: Option<u32>) -> Picked {
        Picked {
            person: PersonId(person),
            track: 9,
            was: was.map(PersonId),
        }
    }

    #[test]
    fn a_person_keeps_their_number_and_one_who_is_in_no_store_goes_with_the_next() {
        let mut roster = Roster::default();
        assert_eq!(roster.pick(&picked(1, None)), (1, None));
        // Pointed at again: another number inside, the same outside.
        assert_eq!(roster.pick(&picked(2, Some(1))), (1, None));
        assert_eq!(roster.people().len(), 1);
        assert_eq!(roster.pick(&picked(3, None)), (2, Some(PersonId(2))));
        assert_eq!(roster.release(), Some((2, Some(PersonId(3)))));
        assert_eq!(roster.people(), []);
        assert_eq!(roster.release(), None);
    }
}
