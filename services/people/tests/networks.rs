//! Real images through real networks: people are found where they are, and told apart.
#![allow(clippy::print_stderr, reason = "a test that does not run says so")]

use std::path::{Path, PathBuf};

use hachi_inference::{ImageView, LoadOptions, load};
use hachi_people::BoundingBox;
use hachi_people::appearance::{Appearance, NoFeatures};
use hachi_people::detect::{Detector, Found, NotADetector, Wanted};
use hachi_people::mot;
use zune_core::bytestream::ZCursor;
use zune_core::colorspace::ColorSpace;
use zune_core::options::DecoderOptions;
use zune_jpeg::JpegDecoder;

fn data() -> Option<PathBuf> {
    let folder = std::env::var_os("HACHI_DATA").map(PathBuf::from);
    if folder.is_none() {
        eprintln!("skipped: HACHI_DATA names no folder with models and people");
    }
    folder
}

fn detector(data: &Path, name: &str) -> Detector {
    let loaded = load(&data.join("models").join(name), &LoadOptions::default()).unwrap();
    Detector::new(loaded, Wanted::People).unwrap()
}

fn find(detector: &mut Detector, path: &Path) -> Vec<Found> {
    let bytes = std::fs::read(path).unwrap();
    let options = DecoderOptions::default().jpeg_set_out_colorspace(ColorSpace::RGB);
    let mut decoder = JpegDecoder::new_with_options(ZCursor::new(&bytes), options);
    let pixels = decoder.decode().unwrap();
    let info = decoder.info().unwrap();
    let image = ImageView::new(info.width.into(), info.height.into(), &pixels).unwrap();
    detector.detect(&image).unwrap().to_vec()
}

/// People taller than 150 pixels in a frame of a MOT17 sequence.
fn tall_people(sequence: &Path, frame: u64) -> Vec<BoundingBox> {
    let text = std::fs::read(sequence.join("gt/gt.txt")).unwrap();
    let truth = mot::read(&text[..]).unwrap().into_iter();
    let tall = truth.filter(|line| line.frame == frame && line.confidence == 1.0);
    tall.map(|line| line.bounding_box)
        .filter(|b| b.height > 150.0)
        .collect()
}

/// The recipe of `yolox_nano` is right if it finds as many as the network's own program does.
#[test]
fn as_many_people_are_found_as_by_the_reference() {
    let Some(data) = data() else { return };
    let mut detector = detector(&data, "yolox_nano_416x416.onnx");
    let sequences = data.join("people/MOT17-mini/train");
    let mut found_in = |name: &str| {
        let sequence = sequences.join(name);
        let people = tall_people(&sequence, 1);
        let found = find(&mut detector, &sequence.join("img1/000001.jpg"));
        let hit = |person: &&BoundingBox| found.iter().any(|f| f.bounding_box.iou(person) >= 0.5);
        (people.iter().filter(hit).count(), people.len())
    };
    let [first, second] = ["MOT17-02-FRCNN", "MOT17-04-FRCNN"].map(&mut found_in);
    eprintln!("found of people taller than 150 pixels: {first:?}, {second:?}");
    assert!(first.0 >= 5 && second.0 >= 17, "{first:?} {second:?}");
}

#[test]
fn a_segmenting_network_finds_the_same_people_with_masks_inside_their_boxes() {
    let Some(data) = data() else { return };
    let frame = data.join("people/MOT17-mini/train/MOT17-04-FRCNN/img1/000001.jpg");
    let mut boxes = detector(&data, "yolox_nano_416x416.onnx");
    let boxes = find(&mut boxes, &frame);
    let mut masks = detector(&data, "yolov8n-seg_int8.onnx");
    let masked = find(&mut masks, &frame);
    let sure = masked.iter().filter(|found| found.score > 0.5);
    let mut seen = 0;
    for found in sure {
        let b = &found.bounding_box;
        let agrees = boxes.iter().any(|other| other.bounding_box.iou(b) > 0.5);
        seen += usize::from(agrees);
        let mask = found.mask.as_ref().unwrap();
        // A person fills a good part of the box, and not its corners.
        let at = |x: f64, y: f64| mask.covers([b.left + x * b.width, b.top + y * b.height]);
        let grid = (0..400).filter(|i| at(f64::from(i % 20) / 19.0, f64::from(i / 20) / 19.0));
        let share = grid.count() as f64 / 400.0;
        assert!((0.2..0.95).contains(&share), "{share} of {b:?}");
    }
    assert!(seen >= 2, "{seen} of {masked:?}");
}

#[test]
fn a_network_of_the_other_kind_is_refused() {
    let Some(data) = data() else { return };
    let open = |name: &str| load(&data.join("models").join(name), &LoadOptions::default()).unwrap();
    let osnet = Detector::new(open("osnet_x0_25_msmt17.onnx"), Wanted::All);
    assert_eq!(osnet.err(), Some(NotADetector));
    let yolox = Appearance::new(open("yolox_nano_416x416.onnx"));
    assert_eq!(yolox.err(), Some(NoFeatures));
}
