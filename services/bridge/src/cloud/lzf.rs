//! LZF decompression, as PCD's `binary_compressed` uses it.
//!
//! The format is Marc Lehmann's liblzf: a control byte below 32 is followed by that many literal
//! bytes plus one; any other starts a back reference whose length is its upper three bits (7: the
//! next byte is added) plus two, at a distance of its lower five bits and one more byte, plus one.

use crate::error::CloudError;

/// The most bytes that one compressed byte can become: a three-byte reference copies 264.
const MOST_PER_BYTE: u64 = 88;

/// Decompresses `input` to exactly `len` bytes into `output`, which is cleared first.
pub(super) fn decompress(input: &[u8], len: u64, output: &mut Vec<u8>) -> Result<(), CloudError> {
    let broken = |at: usize| CloudError::Compressed {
        at,
        len: input.len(),
    };
    output.clear();
    // Checked before memory is asked for: a short file cannot claim gigabytes.
    if len > (input.len() as u64).saturating_mul(MOST_PER_BYTE) {
        return Err(broken(0));
    }
    let len = usize::try_from(len).map_err(|_| broken(0))?;
    output.reserve(len);
    let mut at = 0;
    while at < input.len() {
        let start = at;
        let mut next = || {
            let byte = input.get(at).copied();
            at += 1;
            byte.map(usize::from).ok_or_else(|| broken(start))
        };
        let control = next()?;
        if control < 32 {
            let literal = input
                .get(at..at + control + 1)
                .ok_or_else(|| broken(start))?;
            at += literal.len();
            output.extend_from_slice(literal);
        } else {
            let mut count = control >> 5;
            if count == 7 {
                count += next()?;
            }
            count += 2;
            let distance = ((control & 31) << 8) + next()? + 1;
            let from = output
                .len()
                .checked_sub(distance)
                .ok_or_else(|| broken(start))?;
            // A reference may reach into what it is writing.
            for index in from..from + count {
                output.push(output[index]);
            }
        }
        if output.len() > len {
            return Err(broken(start));
        }
    }
    if output.len() == len {
        Ok(())
    } else {
        Err(broken(input.len()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn literals_and_overlapping_references_expand_as_the_format_says() {
        // "abc" literally, then six bytes from a distance of three: control 100_00000, offset 2.
        let input = [2, b'a', b'b', b'c', 0x80, 2];
        let mut output = Vec::new();
        decompress(&input, 9, &mut output).unwrap();
        assert_eq!(output, b"abcabcabc");
        // A long one: 7 in the length bits, 20 more, plus two, at a distance of one.
        let input = [0, b'x', 0xe0, 20, 0];
        decompress(&input, 30, &mut output).unwrap();
        assert_eq!(output, [b'x'; 30]);
    }

    #[test]
    fn lies_are_refused() {
        let mut output = Vec::new();
        for (input, len) in [
            (&[2, b'a'][..], 3),
            (&[0x80, 2][..], 6),
            (&[0, b'x'][..], 2),
            (&[1, b'x', b'y'][..], 1),
            (&[0, b'x'][..], 1 << 40),
            (&[0xe0][..], 9),
        ] {
            assert!(decompress(input, len, &mut output).is_err(), "{input:?}");
        }
    }
}
