//! How well a network tells people apart, and how well FollowMe and CARPE-ID do with its features.
//!
//! `cargo run --release -p hachi-people --example reid_figures -- NETWORK.onnx reid_col780/train`:
//! a folder of folders, one for each person, with pictures `CAMERA_NUMBER.*`.
//!
//! Ranking: every fourth picture of the first camera is searched for in all of the second. Target
//! against distractors: twelve of a person's pictures, from both cameras in turns, calibrate
//! FollowMe, and are shown to CARPE-ID three hundred times in any order; the rest, and as many of
//! others, are told apart by the threshold. Dealt ten times anew.
#![allow(clippy::print_stdout, reason = "an example prints its result")]

use std::collections::BTreeMap;
use std::error::Error;
use std::path::Path;

use hachi_inference::{ImageView, LoadOptions, load};
use hachi_people::BoundingBox;
use hachi_people::appearance::{Appearance, Person};
use hachi_people::gallery;
use hachi_people::identify::{AppearanceModel, Calibration};
use zune_core::bytestream::ZCursor;
use zune_core::colorspace::ColorSpace;
use zune_core::options::DecoderOptions;
use zune_jpeg::JpegDecoder;

/// Features of one person's pictures, for each camera in the order of their numbers.
type Pictures = BTreeMap<String, Vec<Vec<f32>>>;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<_> = std::env::args().skip(1).collect();
    let [network, folder] = &arguments[..] else {
        return Err("give a network and a folder".into());
    };
    let mut appearance = Appearance::new(load(Path::new(network), &LoadOptions::default())?)?;
    let mut people = Vec::new();
    for person in sorted(Path::new(folder))? {
        let mut pictures = Pictures::new();
        for picture in sorted(&person)? {
            let name = picture
                .file_stem()
                .and_then(|stem| stem.to_str())
                .unwrap_or_default();
            let (camera, _) = name.split_once('_').ok_or("a picture without a camera")?;
            let feature = feature(&mut appearance, &picture)?;
            pictures.entry(camera.to_owned()).or_default().push(feature);
        }
        people.push(pictures);
    }
    let (rank_1, mean_precision) = ranking(&people);
    println!(
        "rank-1 {rank_1:.3}  mAP {mean_precision:.3}  ({} people)",
        people.len()
    );
    for adapts in [false, true] {
        let [right, missed, wrong, refused] = told_apart(&people, adapts);
        let all = right + missed + wrong + refused;
        println!(
            "{}: accuracy {:.3}  precision {:.3}  recall {:.3}  ({all} pictures)",
            if adapts { "CARPE-ID" } else { "FollowMe" },
            (right + refused) as f64 / all as f64,
            right as f64 / (right + wrong) as f64,
            right as f64 / (right + missed) as f64,
        );
    }
    Ok(())
}

fn sorted(folder: &Path) -> Result<Vec<std::path::PathBuf>, Box<dyn Error>> {
    let entries = std::fs::read_dir(folder)?;
    let mut paths = entries
        .map(|e| Ok(e?.path()))
        .collect::<Result<Vec<_>, std::io::Error>>()?;
    paths.sort();
    Ok(paths)
}

fn feature(appearance: &mut Appearance, path: &Path) -> Result<Vec<f32>, Box<dyn Error>> {
    let bytes = std::fs::read(path)?;
    let options = DecoderOptions::default().jpeg_set_out_colorspace(ColorSpace::RGB);
    let mut decoder = JpegDecoder::new_with_options(ZCursor::new(&bytes), options);
    let pixels = decoder
        .decode()
        .map_err(|error| format!("{}: {error}", path.display()))?;
    let info = decoder.info().ok_or("a picture without a size")?;
    let (width, height) = (usize::from(info.width), usize::from(info.height));
    let image = ImageView::new(width, height, &pixels)?;
    let person = Person {
        bounding_box: BoundingBox::new(0.0, 0.0, width as f64, height as f64),
        mask: None,
    };
    Ok(appearance.features(&image, &[person])?.to_vec())
}

fn ranking(people: &[Pictures]) -> (f64, f64) {
    let camera = |pictures: &Pictures, index: usize| {
        pictures.values().nth(index).cloned().unwrap_or_default()
    };
    let (mut queries, mut first, mut precision) = (0, 0, 0.0);
    for (person, pictures) in people.iter().enumerate() {
        for query in camera(pictures, 0).iter().step_by(4) {
            let mut ranked = Vec::new();
            for (other, pictures) in people.iter().enumerate() {
                let found = camera(pictures, 1);
                ranked.extend(
                    found
                        .iter()
                        .map(|f| (gallery::distance(query, f), other == person)),
                );
            }
            ranked.sort_by(|a, b| a.0.total_cmp(&b.0));
            queries += 1;
            first += usize::from(ranked[0].1);
            let places = ranked
                .iter()
                .enumerate()
                .filter(|(_, r)| r.1)
                .map(|(place, _)| place);
            let shares: Vec<_> = places
                .enumerate()
                .map(|(k, place)| (k + 1) as f64 / (place + 1) as f64)
                .collect();
            precision += shares.iter().sum::<f64>() / shares.len() as f64;
        }
    }
    (first as f64 / queries as f64, precision / queries as f64)
}

/// Right, missed, wrong and rightly refused pictures.
fn told_apart(people: &[Pictures], adapts: bool) -> [usize; 4] {
    const DEALS: usize = 10;
    const CALIBRATE: usize = 12;
    let mut counts = [0; 4];
    // Any fixed sequence will do; this one is Knuth's (MMIX).
    let mut state = 1_u64;
    let mut random = move |below: usize| {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as usize % below
    };
    for _ in 0..DEALS {
        for (person, pictures) in people.iter().enumerate() {
            let mut dealt = Vec::new();
            let mut cameras: Vec<Vec<_>> = pictures.values().map(|p| p.iter().collect()).collect();
            while cameras.iter().any(|camera| !camera.is_empty()) {
                for camera in cameras.iter_mut().filter(|camera| !camera.is_empty()) {
                    dealt.push(camera.swap_remove(random(camera.len())));
                }
            }
            let (seen, held_back) = dealt.split_at(CALIBRATE.min(dealt.len()));
            let Some(model) = learnt(seen, adapts, &mut random) else {
                continue;
            };
            let near = |feature: &[f32]| model.distance(feature) <= model.threshold();
            for feature in held_back {
                counts[usize::from(!near(feature))] += 1;
                let other = (person + 1 + random(people.len() - 1)) % people.len();
                let others: Vec<_> = people[other].values().flatten().collect();
                let distractor = others[random(others.len())];
                counts[2 + usize::from(!near(distractor))] += 1;
            }
        }
    }
    counts
}

/// FollowMe's model of these pictures, or CARPE-ID's after it has followed them for a while.
fn learnt(
    seen: &[&Vec<f32>],
    adapts: bool,
    random: &mut impl FnMut(usize) -> usize,
) -> Option<AppearanceModel> {
    const FRAMES: usize = 300;
    if !adapts {
        let mut calibration = Calibration::new(seen.len());
        seen.iter().for_each(|feature| calibration.push(feature));
        return calibration.finish().ok();
    }
    let mut model = AppearanceModel::first(seen.first()?)?;
    for _ in 0..FRAMES {
        let feature = seen[random(seen.len())];
        let distance = model.distance(feature);
        model.learn(feature, distance);
    }
    Some(model)
}
