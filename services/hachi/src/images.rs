//! Folders of images, one frame at a time.
//!
//! In: a folder of JPEG and PNG files, or a MOTChallenge sequence with them in `img1`. Out: frames
//! in the order of the numbers in their names, and their pixels. What a file is, its first bytes
//! say, whatever its name.

use std::io::Cursor;
use std::path::{Path, PathBuf};

use hachi_inference::{ImageError, ImageView};
use hachi_people::BoundingBox;
use zune_core::bytestream::ZCursor;
use zune_core::colorspace::ColorSpace;
use zune_core::options::DecoderOptions;
use zune_jpeg::JpegDecoder;

use crate::exit::Failure;

/// Longer sides are refused: 16k video has them.
const MAX_SIDE: usize = 16_384;
/// Larger images are refused: they would take 300 MB.
const MAX_PIXELS: usize = 100_000_000;
/// Larger files are refused.
const MAX_FILE_BYTES: u64 = 256 << 20;

/// Pictures of people are kept at most so high: twice what networks look at.
const MOST_HIGH: usize = 512;

/// RGB pixels, 8 bits each.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Rgb {
    /// Pixels.
    pub width: usize,
    /// Pixels.
    pub height: usize,
    /// Row by row.
    pub pixels: Vec<u8>,
}

impl Rgb {
    /// The image as networks take it.
    ///
    /// # Errors
    /// It has no pixel.
    pub fn view(&self) -> Result<ImageView<'_>, ImageError> {
        ImageView::new(self.width, self.height, &self.pixels)
    }

    /// What lies in a box, as far as it lies in the image; `None` if nothing does.
    pub fn cut(&self, bounding_box: &BoundingBox) -> Option<Self> {
        Self::cut_from((self.width, self.height), &self.pixels, bounding_box)
    }

    /// The same of an image of so many columns and rows.
    pub fn cut_from(
        (columns, rows): (usize, usize),
        pixels: &[u8],
        bounding_box: &BoundingBox,
    ) -> Option<Self> {
        let b = bounding_box;
        // Casts take what is no number, and what is below nought, for nought.
        let (left, top) = (b.left.floor() as usize, b.top.floor() as usize);
        let right = ((b.left + b.width).ceil() as usize).min(columns);
        let bottom = ((b.top + b.height).ceil() as usize).min(rows);
        let (width, height) = (right.checked_sub(left)?, bottom.checked_sub(top)?);
        if width == 0 || height == 0 {
            return None;
        }
        let mut cut = Vec::with_capacity(3 * width * height);
        for y in top..bottom {
            cut.extend_from_slice(&pixels[3 * (y * columns + left)..][..3 * width]);
        }
        Some(Self {
            width,
            height,
            pixels: cut,
        })
    }

    /// The image so many times smaller: each pixel is the mean of a square with sides of `by`. What is
    /// left over at the right and below is dropped.
    pub fn shrunk(&self, by: usize) -> Self {
        let by = by.max(1);
        let (width, height) = (self.width / by, self.height / by);
        let mut pixels = Vec::with_capacity(3 * width * height);
        for (y, x) in (0..height).flat_map(|y| (0..width).map(move |x| (y * by, x * by))) {
            pixels.extend([0, 1, 2].map(|channel| {
                let rows = (y..y + by).map(|y| &self.pixels[3 * (y * self.width + x)..][..3 * by]);
                let values = rows.flat_map(|row| row[channel..].iter().step_by(3));
                let sum: usize = values.map(|&value| usize::from(value)).sum();
                // The mean of bytes is one.
                (sum / (by * by)) as u8
            }));
        }
        Self {
            width,
            height,
            pixels,
        }
    }

    /// The image as a PNG file.
    ///
    /// # Errors
    /// It has no pixel.
    pub fn to_png(&self) -> Result<Vec<u8>, png::EncodingError> {
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, self.width as u32, self.height as u32);
        encoder.set_color(png::ColorType::Rgb);
        encoder.set_depth(png::BitDepth::Eight);
        let mut writer = encoder.write_header()?;
        writer.write_image_data(&self.pixels)?;
        writer.finish()?;
        Ok(bytes)
    }
}

/// A picture of a person as it is kept: a PNG file of no more pixels than needed.
///
/// # Errors
/// It has no pixel.
pub fn kept(mut crop: Rgb) -> Result<Vec<u8>, String> {
    while crop.height.max(crop.width) > MOST_HIGH && crop.height.min(crop.width) > 1 {
        crop = crop.shrunk(2);
    }
    crop.to_png().map_err(|error| error.to_string())
}

/// One image of a folder.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Frame {
    /// The number in its name; its place from 1, if not all names are numbers.
    pub number: u64,
    /// The file.
    pub path: PathBuf,
}

/// The images in a folder.
///
/// # Errors
/// The folder can't be read or holds none.
pub fn frames(folder: &Path) -> Result<Vec<Frame>, Failure> {
    let nested = folder.join("img1");
    let folder = if nested.is_dir() {
        nested.as_path()
    } else {
        folder
    };
    let unread = |error: std::io::Error| {
        Failure::new(
            format_args!("{} can't be read: {error}", folder.display()),
            "give a folder of JPEG or PNG frames",
        )
    };
    let mut paths = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(unread)? {
        let path = entry.map_err(unread)?.path();
        let extension = path
            .extension()
            .and_then(|e| e.to_str())
            .unwrap_or_default();
        if ["jpg", "jpeg", "png"].contains(&extension.to_ascii_lowercase().as_str()) {
            paths.push(path);
        }
    }
    if paths.is_empty() {
        return Err(Failure::new(
            format_args!("{} holds no .jpg or .png file", folder.display()),
            "give a folder of JPEG or PNG frames",
        ));
    }
    let number = |path: &PathBuf| path.file_stem()?.to_str()?.parse::<u64>().ok();
    let largest = hachi_people::mot::MAX_FRAME;
    let numbers: Vec<_> = paths.iter().map(number).collect();
    let mut sorted = numbers.clone();
    sorted.sort_unstable();
    sorted.dedup();
    let numbered =
        sorted.len() == paths.len() && sorted.iter().all(|n| n.is_some_and(|n| n <= largest));
    if numbered {
        let mut frames: Vec<_> = numbers
            .into_iter()
            .zip(paths)
            .filter_map(|(number, path)| number.map(|number| Frame { number, path }))
            .collect();
        frames.sort_by_key(|frame| frame.number);
        return Ok(frames);
    }
    paths.sort();
    let place = |(index, path)| Frame {
        number: index as u64 + 1,
        path,
    };
    Ok(paths.into_iter().enumerate().map(place).collect())
}

/// Reads an image.
///
/// # Errors
/// Why it can't be read or decoded, in a few words.
pub fn read(path: &Path) -> Result<Rgb, String> {
    let length = std::fs::metadata(path).map_err(|e| e.to_string())?.len();
    if length > MAX_FILE_BYTES {
        return Err(format!("{length} bytes are more than {MAX_FILE_BYTES}"));
    }
    decode(&std::fs::read(path).map_err(|e| e.to_string())?)
}

/// Decodes a JPEG or PNG file.
///
/// # Errors
/// What is wrong with it, in a few words.
pub fn decode(bytes: &[u8]) -> Result<Rgb, String> {
    match bytes {
        [0xFF, 0xD8, ..] => jpeg(bytes),
        [0x89, b'P', b'N', b'G', ..] => png(bytes),
        [] => Err("the file is empty".to_owned()),
        _ => Err("neither a JPEG nor a PNG file".to_owned()),
    }
}

fn within_limits(width: usize, height: usize) -> Result<usize, String> {
    match width.checked_mul(height) {
        Some(pixels) if (1..=MAX_PIXELS).contains(&pixels) => Ok(pixels),
        _ => Err(format!("{width}x{height} pixels are no size for an image")),
    }
}

fn jpeg(bytes: &[u8]) -> Result<Rgb, String> {
    let options = DecoderOptions::default()
        .set_max_width(MAX_SIDE)
        .set_max_height(MAX_SIDE)
        .jpeg_set_out_colorspace(ColorSpace::RGB);
    let mut decoder = JpegDecoder::new_with_options(ZCursor::new(bytes), options);
    decoder.decode_headers().map_err(|e| e.to_string())?;
    let info = decoder.info().ok_or("it has no size")?;
    let (width, height) = (usize::from(info.width), usize::from(info.height));
    let places = within_limits(width, height)?;
    let pixels = decoder.decode().map_err(|e| e.to_string())?;
    match pixels.len() == 3 * places {
        true => Ok(Rgb {
            width,
            height,
            pixels,
        }),
        false => Err("its colours are not understood".to_owned()),
    }
}

fn png(bytes: &[u8]) -> Result<Rgb, String> {
    let mut decoder = png::Decoder::new(Cursor::new(bytes));
    decoder.set_transformations(png::Transformations::normalize_to_color8());
    let mut reader = decoder.read_info().map_err(|e| e.to_string())?;
    let (width, height) = (reader.info().width as usize, reader.info().height as usize);
    let places = within_limits(width, height)?;
    let size = reader.output_buffer_size().ok_or("too large")?;
    let mut raw = vec![0; size];
    let info = reader.next_frame(&mut raw).map_err(|e| e.to_string())?;
    let raw = &raw[..info.buffer_size()];
    let mut pixels = Vec::with_capacity(3 * places);
    match info.color_type {
        png::ColorType::Rgb => pixels.extend_from_slice(raw),
        png::ColorType::Rgba => raw
            .chunks_exact(4)
            .for_each(|p| pixels.extend_from_slice(&p[..3])),
        png::ColorType::Grayscale => raw.iter().for_each(|p| pixels.extend([*p; 3])),
        png::ColorType::GrayscaleAlpha => {
            raw.chunks_exact(2).for_each(|p| pixels.extend([p[0]; 3]));
        }
        png::ColorType::Indexed => return Err("its palette is not understood".to_owned()),
    }
    match pixels.len() == 3 * places {
        true => Ok(Rgb {
            width,
            height,
            pixels,
        }),
        false => Err("it is cut short".to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn written(colour: png::ColorType, data: &[u8]) -> Vec<u8> {
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, 2, 1);
        encoder.set_color(colour);
        encoder.set_depth(png::BitDepth::Eight);
        let mut writer = encoder.write_header().unwrap();
        writer.write_image_data(data).unwrap();
        writer.finish().unwrap();
        bytes
    }

    #[test]
    fn colours_and_greys_become_rgb() {
        let rgba = written(png::ColorType::Rgba, &[1, 2, 3, 255, 4, 5, 6, 0]);
        assert_eq!(decode(&rgba).unwrap().pixels, [1, 2, 3, 4, 5, 6]);
        let grey = written(png::ColorType::Grayscale, &[9, 8]);
        assert_eq!(decode(&grey).unwrap().pixels, [9, 9, 9, 8, 8, 8]);
    }

    #[test]
    fn what_is_cut_out_shrunk_and_written_has_the_pixels_it_had() {
        let image = Rgb {
            width: 4,
            height: 2,
            pixels: (0..24).collect(),
        };
        let cut = image.cut(&BoundingBox::new(0.7, -3.0, 1.1, 4.5)).unwrap();
        assert_eq!((cut.width, cut.height), (2, 2));
        assert_eq!(cut.pixels, [0, 1, 2, 3, 4, 5, 12, 13, 14, 15, 16, 17]);
        assert_eq!(image.cut(&BoundingBox::new(4.0, 0.0, 2.0, 2.0)), None);
        assert_eq!(image.cut(&BoundingBox::new(f64::NAN, 0.0, 0.0, 2.0)), None);
        // Means of (0, 3, 12, 15) and so on, by hand.
        assert_eq!(image.shrunk(2).pixels, [7, 8, 9, 13, 14, 15]);
        assert_eq!(decode(&image.to_png().unwrap()), Ok(image));
    }

    #[test]
    fn a_shrunk_image_has_the_means_of_squares() {
        let large = Rgb {
            width: 4,
            height: 2,
            pixels: (0..4 * 2).flat_map(|i| [i * 10, 0, 200]).collect(),
        };
        let small = large.shrunk(2);
        // (0 + 10 + 40 + 50) / 4 and (20 + 30 + 60 + 70) / 4.
        assert_eq!(small.pixels, [25, 0, 200, 45, 0, 200]);
        assert_eq!((small.width, small.height), (2, 1));
        assert_eq!(large.shrunk(1), large);
    }

    #[test]
    fn what_is_no_image_is_refused() {
        let whole = written(png::ColorType::Rgb, &[1, 2, 3, 4, 5, 6]);
        for bytes in [&b""[..], b"BM", b"\xFF\xD8\xFF", &whole[..40], &whole[..8]] {
            assert!(decode(bytes).is_err(), "{bytes:?}");
        }
    }

    #[test]
    fn frames_come_in_the_order_of_their_numbers() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["10.jpg", "9.jpg", "notes.txt", "100.png"] {
            std::fs::write(folder.path().join(name), b"x").unwrap();
        }
        let numbers: Vec<_> = frames(folder.path())
            .unwrap()
            .iter()
            .map(|f| f.number)
            .collect();
        assert_eq!(numbers, [9, 10, 100]);
        std::fs::write(folder.path().join("last.jpg"), b"x").unwrap();
        let numbers: Vec<_> = frames(folder.path())
            .unwrap()
            .iter()
            .map(|f| f.number)
            .collect();
        assert_eq!(numbers, [1, 2, 3, 4]);
    }
}
