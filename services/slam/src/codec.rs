//! A submap as bytes: ten for each point.
//!
//! Little-endian: `HSM1`, a checksum (FNV-1a, 64 bits) of all that follows, the number of points
//! (u32), the edge of a cube (f32 m), the quantum (f32 m), the number of viewpoints (u8), then the
//! viewpoints and points. A position is three i16 quanta; the quantum is the least that reaches the
//! farthest point: 1.5 mm at 50 m. A normal is two bytes on an octahedron (Meyer et al., "On
//! floating-point normal vectors", EGSR 2010), good to half a degree; intensity and viewpoint are
//! a byte each.
//!
//! Bytes come from files that may be cut short, damaged or hostile: nothing is allocated before
//! the length was found to fit.

use crate::submap::{MOST_POINTS, MOST_VIEWPOINTS, Submap, SubmapPoint};

const MAGIC: [u8; 4] = *b"HSM1";
const HEAD: usize = 4 + 8 + 4 + 4 + 4 + 1;
const VIEWPOINT: usize = 6;
const POINT: usize = 10;
/// Stands for "no normal", which lies on no octahedron.
const NO_NORMAL: [u8; 2] = [0x80; 2];

/// Why bytes are no submap, with what was seen.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SubmapError {
    /// Fewer bytes than the header takes or announces, or more.
    #[error("a submap of {expected} bytes has {got}")]
    Length {
        /// What the header says.
        expected: usize,
        /// What is there.
        got: usize,
    },
    /// Other bytes than a submap's at the start.
    #[error("it starts with {got:02x?}, not as a submap")]
    Magic {
        /// The first four.
        got: [u8; 4],
    },
    /// The content is not what was written.
    #[error("its checksum is {got:016x}, its content's {computed:016x}")]
    Checksum {
        /// As written.
        got: u64,
        /// Of what is there.
        computed: u64,
    },
    /// More points or viewpoints than a submap may have.
    #[error("{points} points and {viewpoints} viewpoints are more than a submap has")]
    TooMany {
        /// Points announced.
        points: u32,
        /// Viewpoints announced.
        viewpoints: u8,
    },
    /// A size that is no size, or an index into nothing.
    #[error("{0} is not possible")]
    Value(&'static str),
}

/// Appends the submap's bytes to `out`. Points beyond [`MOST_POINTS`] are left out.
pub fn encode(submap: &Submap, out: &mut Vec<u8>) {
    let points = &submap.points[..submap.points.len().min(MOST_POINTS)];
    let viewpoints = &submap.viewpoints[..submap.viewpoints.len().min(MOST_VIEWPOINTS)];
    let farthest = points
        .iter()
        .map(|p| p.position)
        .chain(viewpoints.iter().copied())
        .flatten()
        .fold(1.0f32, |far, c| far.max(c.abs()));
    let quantum = farthest / f32::from(i16::MAX);
    let quanta = |c: f32| ((c / quantum).round() as i16).to_le_bytes();
    let start = out.len();
    out.extend(MAGIC);
    out.extend([0; 8]);
    out.extend((points.len() as u32).to_le_bytes());
    out.extend(submap.voxel_m.to_le_bytes());
    out.extend(quantum.to_le_bytes());
    out.push(viewpoints.len() as u8);
    for v in viewpoints {
        v.iter().for_each(|&c| out.extend(quanta(c)));
    }
    for p in points {
        p.position.iter().for_each(|&c| out.extend(quanta(c)));
        out.extend(octahedral(p.normal));
        out.extend([p.intensity, p.viewpoint]);
    }
    let sum = checksum(&out[start + 12..]).to_le_bytes();
    out[start + 4..start + 12].copy_from_slice(&sum);
}

/// Reads a submap into `out`, whose memory is reused. On an error `out` is empty.
///
/// # Errors
/// [`SubmapError`].
pub fn decode(bytes: &[u8], out: &mut Submap) -> Result<(), SubmapError> {
    out.points.clear();
    out.viewpoints.clear();
    out.voxel_m = 0.0;
    let (head, body) = bytes.split_at_checked(HEAD).ok_or(SubmapError::Length {
        expected: HEAD,
        got: bytes.len(),
    })?;
    let magic = word(head, 0);
    if magic != MAGIC {
        return Err(SubmapError::Magic { got: magic });
    }
    let points = u32::from_le_bytes(word(head, 12));
    let viewpoints = head[HEAD - 1];
    if points as usize > MOST_POINTS || usize::from(viewpoints) > MOST_VIEWPOINTS {
        return Err(SubmapError::TooMany { points, viewpoints });
    }
    let expected = HEAD + usize::from(viewpoints) * VIEWPOINT + points as usize * POINT;
    if bytes.len() != expected {
        return Err(SubmapError::Length {
            expected,
            got: bytes.len(),
        });
    }
    let (low, high) = (word(head, 4), word(head, 8));
    let got = u64::from(u32::from_le_bytes(low)) | u64::from(u32::from_le_bytes(high)) << 32;
    let computed = checksum(&bytes[12..]);
    if got != computed {
        return Err(SubmapError::Checksum { got, computed });
    }
    let voxel_m = f32::from_le_bytes(word(head, 16));
    let quantum = f32::from_le_bytes(word(head, 20));
    if !(voxel_m.is_finite() && voxel_m > 0.0) {
        return Err(SubmapError::Value("the edge of a cube"));
    }
    if !(quantum > 0.0 && quantum < 1.0) {
        return Err(SubmapError::Value("the quantum"));
    }
    let place = |b: &[u8]| -> [f32; 3] {
        std::array::from_fn(|a| f32::from(i16::from_le_bytes([b[2 * a], b[2 * a + 1]])) * quantum)
    };
    let (seen_from, surfaces) = body.split_at(usize::from(viewpoints) * VIEWPOINT);
    if surfaces.chunks_exact(POINT).any(|p| p[9] >= viewpoints) {
        return Err(SubmapError::Value("a point that was seen from nowhere"));
    }
    out.voxel_m = voxel_m;
    out.viewpoints
        .extend(seen_from.chunks_exact(VIEWPOINT).map(place));
    out.points
        .extend(surfaces.chunks_exact(POINT).map(|p| SubmapPoint {
            position: place(p),
            normal: from_octahedral([p[6], p[7]]),
            intensity: p[8],
            viewpoint: p[9],
        }));
    Ok(())
}

fn word(bytes: &[u8], at: usize) -> [u8; 4] {
    std::array::from_fn(|i| bytes[at + i])
}

/// FNV-1a, 64 bits.
pub fn checksum(bytes: &[u8]) -> u64 {
    bytes.iter().fold(0xcbf2_9ce4_8422_2325, |hash, &b| {
        (hash ^ u64::from(b)).wrapping_mul(0x0100_0000_01b3)
    })
}

fn octahedral(n: [f32; 3]) -> [u8; 2] {
    let length = n.iter().map(|c| c.abs()).sum::<f32>();
    if !(length > 0.5 && length.is_finite()) {
        return NO_NORMAL;
    }
    let [x, y] = [n[0] / length, n[1] / length];
    let [x, y] = if n[2] < 0.0 {
        [(1.0 - y.abs()).copysign(x), (1.0 - x.abs()).copysign(y)]
    } else {
        [x, y]
    };
    [x, y].map(|c| ((c * 127.0).round() as i8).to_le_bytes()[0])
}

fn from_octahedral(bytes: [u8; 2]) -> [f32; 3] {
    if bytes == NO_NORMAL {
        return [0.0; 3];
    }
    let [x, y] = bytes.map(|b| (f32::from(i8::from_le_bytes([b])) / 127.0).max(-1.0));
    let z = 1.0 - x.abs() - y.abs();
    let [x, y] = if z < 0.0 {
        [(1.0 - y.abs()).copysign(x), (1.0 - x.abs()).copysign(y)]
    } else {
        [x, y]
    };
    let length = (x * x + y * y + z * z).sqrt();
    [x / length, y / length, z / length]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn example() -> Submap {
        let point = |i: usize| {
            let (a, h) = (i as f32 * 0.37, (i as f32 * 0.11).sin());
            let r = (1.0 - h * h).sqrt();
            SubmapPoint {
                position: [40.0 * a.cos(), 25.0 * a.sin(), 3.0 * h],
                normal: [r * a.cos(), r * a.sin(), h],
                intensity: (i % 256) as u8,
                viewpoint: (i % 3) as u8,
            }
        };
        Submap {
            voxel_m: 0.2,
            viewpoints: vec![[0.0; 3], [0.5, 0.1, 0.0], [1.0, -0.2, 0.01]],
            points: (0..500).map(point).collect(),
        }
    }

    #[test]
    fn a_submap_comes_back_to_a_millimetre_and_half_a_degree() {
        let submap = example();
        let (mut bytes, mut back) = (Vec::new(), Submap::default());
        encode(&submap, &mut bytes);
        assert_eq!(bytes.len(), HEAD + 3 * VIEWPOINT + 500 * POINT);
        decode(&bytes, &mut back).unwrap();
        assert_eq!(back.voxel_m, submap.voxel_m);
        for (a, b) in submap.points.iter().zip(&back.points) {
            let off: f32 = (0..3)
                .map(|k| (a.position[k] - b.position[k]).powi(2))
                .sum::<f32>()
                .sqrt();
            assert!(off < 1.1e-3, "{off}");
            let cosine: f32 = (0..3).map(|k| a.normal[k] * b.normal[k]).sum();
            assert!(cosine > 0.999_8, "{cosine} {a:?} {b:?}");
            assert_eq!((a.intensity, a.viewpoint), (b.intensity, b.viewpoint));
        }
        // What was read is written as the same bytes again.
        let mut again = Vec::new();
        encode(&back, &mut again);
        let mut twice = Submap::default();
        decode(&again, &mut twice).unwrap();
        assert_eq!(twice.points.len(), back.points.len());
    }

    #[test]
    fn no_normal_stays_none() {
        assert_eq!(from_octahedral(octahedral([0.0; 3])), [0.0; 3]);
        assert_eq!(from_octahedral(octahedral([f32::NAN; 3])), [0.0; 3]);
    }

    #[test]
    fn bytes_cut_short_or_changed_are_refused_with_what_was_seen() {
        let (mut bytes, mut out) = (Vec::new(), Submap::default());
        encode(&example(), &mut bytes);
        for len in [0, 3, HEAD, bytes.len() - 1] {
            assert!(decode(&bytes[..len], &mut out).is_err(), "{len}");
            assert!(out.points.is_empty());
        }
        for at in 0..HEAD + 40 {
            let mut changed = bytes.clone();
            changed[at] ^= 0x41;
            assert!(decode(&changed, &mut out).is_err(), "byte {at}");
        }
        let mut many = bytes.clone();
        many[12..16].copy_from_slice(&u32::MAX.to_le_bytes());
        assert!(matches!(
            decode(&many, &mut out),
            Err(SubmapError::TooMany { .. })
        ));
    }
}
