//! People and models as bytes: what is sealed in a store.
//!
//! In: a name and a day, or a model with the network that made it. Out: little-endian bytes that begin
//! with their version, and the same again. Bytes that are anything else are refused, longer ones too.

use hachi_people::identify::AppearanceModel;
use hachi_people::identify::appearance_model::{MOST_NUMBERS, NotAModel, Statistics};

use super::NetworkIdentity;

/// Characters of a name.
pub const LONGEST_NAME: usize = 100;

/// The bytes' version.
const VERSION: u8 = 1;

/// Bytes that are no person and no model.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum CodecError {
    /// Another program's.
    #[error("they have version {0}, not {VERSION}")]
    Version(u8),
    /// They end too early.
    #[error("they end after {0} bytes")]
    Short(usize),
    /// They go on.
    #[error("{0} bytes follow the end")]
    Long(usize),
    /// No text, or too long for a name.
    #[error("the name is none")]
    Name,
    /// The feature is too long.
    #[error("{0} numbers are too many for a feature")]
    Length(u32),
    /// No model has these numbers.
    #[error(transparent)]
    NotAModel(#[from] NotAModel),
}

/// A person's name, and when they were enrolled.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Record {
    /// The name.
    pub name: String,
    /// Seconds since 1970.
    pub enrolled_unix_s: i64,
}

/// A person as bytes.
pub fn encode_record(record: &Record) -> Vec<u8> {
    let mut bytes = vec![VERSION];
    bytes.extend(record.enrolled_unix_s.to_le_bytes());
    put_text(&mut bytes, &record.name);
    bytes
}

/// A person from bytes.
///
/// # Errors
/// [`CodecError`].
pub fn decode_record(bytes: &[u8]) -> Result<Record, CodecError> {
    let mut bytes = Bytes::new(bytes)?;
    let enrolled_unix_s = i64::from_le_bytes(bytes.take()?);
    let name = bytes.text()?;
    bytes.end()?;
    Ok(Record {
        name,
        enrolled_unix_s,
    })
}

/// A model as bytes.
pub fn encode_model(network: &NetworkIdentity, model: &AppearanceModel) -> Vec<u8> {
    let numbers = model.statistics();
    let mut bytes = vec![VERSION];
    put_text(&mut bytes, &network.name);
    bytes.extend(network.sha256);
    bytes.extend(numbers.least_deviation.to_le_bytes());
    bytes.extend(numbers.distance_mean.to_le_bytes());
    bytes.extend(numbers.distance_variance.to_le_bytes());
    bytes.extend(numbers.updates.to_le_bytes());
    bytes.extend((numbers.mean.len() as u32).to_le_bytes());
    for number in numbers.mean.iter().chain(&numbers.variance) {
        bytes.extend(number.to_le_bytes());
    }
    bytes
}

/// A model from bytes.
///
/// # Errors
/// [`CodecError`].
pub fn decode_model(bytes: &[u8]) -> Result<(NetworkIdentity, AppearanceModel), CodecError> {
    let mut bytes = Bytes::new(bytes)?;
    let network = NetworkIdentity {
        name: bytes.text()?,
        sha256: bytes.take()?,
    };
    let least_deviation = f32::from_le_bytes(bytes.take()?);
    let distance_mean = f64::from_le_bytes(bytes.take()?);
    let distance_variance = f64::from_le_bytes(bytes.take()?);
    let updates = u32::from_le_bytes(bytes.take()?);
    let length = u32::from_le_bytes(bytes.take()?);
    if length as usize > MOST_NUMBERS {
        return Err(CodecError::Length(length));
    }
    let mean = bytes.numbers(length as usize)?;
    let variance = bytes.numbers(length as usize)?;
    bytes.end()?;
    let model = AppearanceModel::from_statistics(Statistics {
        mean,
        variance,
        least_deviation,
        distance_mean,
        distance_variance,
        updates,
    })?;
    Ok((network, model))
}

fn put_text(bytes: &mut Vec<u8>, text: &str) {
    let length = u16::try_from(text.len()).unwrap_or(u16::MAX);
    bytes.extend(length.to_le_bytes());
    bytes.extend(&text.as_bytes()[..usize::from(length)]);
}

/// Bytes that are read from the front.
struct Bytes<'a> {
    left: &'a [u8],
    all: usize,
}

impl<'a> Bytes<'a> {
    fn new(bytes: &'a [u8]) -> Result<Self, CodecError> {
        let mut bytes = Self {
            left: bytes,
            all: bytes.len(),
        };
        match bytes.take::<1>()? {
            [VERSION] => Ok(bytes),
            [other] => Err(CodecError::Version(other)),
        }
    }

    fn part(&mut self, length: usize) -> Result<&'a [u8], CodecError> {
        let parts = self.left.split_at_checked(length);
        let (part, left) = parts.ok_or(CodecError::Short(self.all))?;
        self.left = left;
        Ok(part)
    }

    fn take<const N: usize>(&mut self) -> Result<[u8; N], CodecError> {
        let part = self.left.first_chunk::<N>();
        let part = *part.ok_or(CodecError::Short(self.all))?;
        self.left = &self.left[N..];
        Ok(part)
    }

    fn text(&mut self) -> Result<String, CodecError> {
        let length = u16::from_le_bytes(self.take()?);
        let part = self.part(usize::from(length))?;
        let text = std::str::from_utf8(part).map_err(|_| CodecError::Name)?;
        match text.chars().count() <= LONGEST_NAME {
            true => Ok(text.to_owned()),
            false => Err(CodecError::Name),
        }
    }

    fn numbers(&mut self, length: usize) -> Result<Vec<f32>, CodecError> {
        let part = self.part(4 * length)?;
        let (numbers, _) = part.as_chunks::<4>();
        Ok(numbers.iter().map(|n| f32::from_le_bytes(*n)).collect())
    }

    fn end(&self) -> Result<(), CodecError> {
        match self.left.len() {
            0 => Ok(()),
            more => Err(CodecError::Long(more)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn network() -> NetworkIdentity {
        NetworkIdentity {
            name: "osnet".to_owned(),
            sha256: [9; 32],
        }
    }

    #[test]
    fn a_record_is_laid_out_as_said() {
        let record = Record {
            name: "Zoë".to_owned(),
            enrolled_unix_s: 0x0102,
        };
        let bytes = encode_record(&record);
        assert_eq!(
            bytes,
            [1, 2, 1, 0, 0, 0, 0, 0, 0, 4, 0, b'Z', b'o', 0xC3, 0xAB]
        );
        assert_eq!(decode_record(&bytes), Ok(record));
    }

    #[test]
    fn a_model_comes_back_and_cut_or_changed_lengths_are_refused() {
        let model = AppearanceModel::first(&[0.6, -0.8]).unwrap();
        let bytes = encode_model(&network(), &model);
        // Version, name, hash, three numbers of the distance, updates, length, two times two.
        assert_eq!(bytes.len(), 1 + 7 + 32 + 4 + 8 + 8 + 4 + 4 + 16);
        assert_eq!(decode_model(&bytes), Ok((network(), model)));
        for cut in 0..bytes.len() {
            let refused = decode_model(&bytes[..cut]);
            assert_eq!(refused, Err(CodecError::Short(cut)));
        }
        let longer = [&bytes[..], &[0]].concat();
        assert_eq!(decode_model(&longer), Err(CodecError::Long(1)));
        let at = 1 + 7 + 32 + 4 + 8 + 8 + 4;
        let mut huge = bytes.clone();
        huge[at..at + 4].copy_from_slice(&u32::MAX.to_le_bytes());
        assert_eq!(decode_model(&huge), Err(CodecError::Length(u32::MAX)));
        let mut other = bytes.clone();
        other[0] = 2;
        assert_eq!(decode_model(&other), Err(CodecError::Version(2)));
        let mut not_finite = bytes;
        not_finite[at + 4..at + 8].copy_from_slice(&f32::NAN.to_le_bytes());
        let refused = decode_model(&not_finite).unwrap_err();
        assert!(matches!(refused, CodecError::NotAModel(_)), "{refused:?}");
    }
}
