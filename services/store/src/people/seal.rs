//! Bytes sealed under a key: unreadable and unchangeable without it.
//!
//! In: bytes, and the place they belong to. Out: nonce (24 bytes), ciphertext and tag (16 bytes), of
//! XChaCha20-Poly1305. Its nonce is long enough to be drawn at random each time. The place is
//! authenticated: bytes that were moved to another row, or another person's, do not open.

use chacha20poly1305::aead::{Aead, KeyInit, Payload};
use chacha20poly1305::{XChaCha20Poly1305, XNonce};
use zeroize::Zeroizing;

const NONCE_BYTES: usize = 24;

/// A person's key. Its memory is overwritten when it is dropped.
#[derive(Clone)]
pub(super) struct Key(Zeroizing<[u8; 32]>);

impl Key {
    /// A new one, from the system's random numbers.
    pub(super) fn random() -> Result<Self, getrandom::Error> {
        let mut bytes = Zeroizing::new([0; 32]);
        getrandom::fill(&mut *bytes)?;
        Ok(Self(bytes))
    }

    pub(super) fn from_bytes(bytes: [u8; 32]) -> Self {
        Self(Zeroizing::new(bytes))
    }

    pub(super) fn bytes(&self) -> &[u8; 32] {
        &self.0
    }

    fn cipher(&self) -> XChaCha20Poly1305 {
        XChaCha20Poly1305::new(&(*self.0).into())
    }

    /// Seals bytes for a place.
    pub(super) fn seal(&self, place: &Place, plain: &[u8]) -> Result<Vec<u8>, getrandom::Error> {
        let mut nonce = [0; NONCE_BYTES];
        getrandom::fill(&mut nonce)?;
        let payload = Payload {
            msg: plain,
            aad: &place.bytes(),
        };
        let sealed = self
            .cipher()
            .encrypt(&XNonce::from(nonce), payload)
            .expect("a picture is shorter than the 256 GB that a nonce is good for");
        Ok([&nonce[..], &sealed].concat())
    }

    /// What was sealed for this place; `None` if it was not, or with another key, or is damaged.
    pub(super) fn open(&self, place: &Place, sealed: &[u8]) -> Option<Zeroizing<Vec<u8>>> {
        let (nonce, sealed) = sealed.split_first_chunk::<NONCE_BYTES>()?;
        let payload = Payload {
            msg: sealed,
            aad: &place.bytes(),
        };
        let opened = self.cipher().decrypt(&XNonce::from(*nonce), payload);
        opened.ok().map(Zeroizing::new)
    }
}

/// Where sealed bytes belong.
#[derive(Debug, Clone, Copy)]
pub(super) enum Place {
    /// Name and day of a person.
    Record(i64),
    /// A person's model.
    Model(i64),
    /// A picture of a person.
    Image { person: i64, image: i64 },
}

impl Place {
    fn bytes(&self) -> [u8; 17] {
        let (kind, person, image) = match *self {
            Self::Record(person) => (0, person, 0),
            Self::Model(person) => (1, person, 0),
            Self::Image { person, image } => (2, person, image),
        };
        let mut bytes = [kind; 17];
        bytes[1..9].copy_from_slice(&person.to_le_bytes());
        bytes[9..].copy_from_slice(&image.to_le_bytes());
        bytes
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// draft-irtf-cfrg-xchacha-03, appendix A.3.1: key 80..9f, nonce 40..57.
    #[test]
    fn opens_the_draft_s_test_vector() {
        let key: [u8; 32] = std::array::from_fn(|i| 0x80 + i as u8);
        let nonce: [u8; 24] = std::array::from_fn(|i| 0x40 + i as u8);
        let aad = [
            0x50, 0x51, 0x52, 0x53, 0xc0, 0xc1, 0xc2, 0xc3, 0xc4, 0xc5, 0xc6, 0xc7,
        ];
        let plain = "Ladies and Gentlemen of the class of '99: If I could offer you only one tip for \
                     the future, sunscreen would be it.";
        let payload = Payload {
            msg: plain.as_bytes(),
            aad: &aad,
        };
        let sealed = Key::from_bytes(key)
            .cipher()
            .encrypt(&XNonce::from(nonce), payload)
            .unwrap();
        assert_eq!(sealed[..4], [0xbd, 0x6d, 0x17, 0x9d]);
        assert_eq!(
            sealed[sealed.len() - 16..],
            [
                0xc0, 0x87, 0x59, 0x24, 0xc1, 0xc7, 0x98, 0x79, 0x47, 0xde, 0xaf, 0xd8, 0x78, 0x0a,
                0xcf, 0x49
            ]
        );
    }

    #[test]
    fn only_the_right_key_and_place_open_what_was_sealed_and_only_whole() {
        let key = Key::random().unwrap();
        let place = Place::Image {
            person: 7,
            image: 3,
        };
        let sealed = key.seal(&place, b"a face").unwrap();
        assert_eq!(&**key.open(&place, &sealed).unwrap(), b"a face");
        assert!(Key::random().unwrap().open(&place, &sealed).is_none());
        let elsewhere = Place::Image {
            person: 8,
            image: 3,
        };
        assert!(key.open(&elsewhere, &sealed).is_none());
        for cut in 0..sealed.len() {
            assert!(key.open(&place, &sealed[..cut]).is_none(), "{cut}");
        }
        for at in 0..sealed.len() {
            let mut changed = sealed.clone();
            changed[at] ^= 1;
            assert!(key.open(&place, &changed).is_none(), "{at}");
        }
        assert_ne!(
            key.seal(&place, b"a face").unwrap(),
            sealed,
            "a nonce twice"
        );
    }
}
