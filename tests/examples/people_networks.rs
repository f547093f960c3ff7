//! How well networks find people in rendered pictures and tell them apart, through Hachi's own
//! decoders, masks and crops.
//!
//! `cargo run --release -p hachi-tests --example people_networks -- FOLDER [DETECTOR REID]`: a folder
//! that `render_people` has written; the networks in the program itself unless others are named.
//!
//! Found is who has a box of the same person with an overlap of half; average precision as in
//! Pascal VOC 2010 (all points). People seen on less than 96 pixels or lower than 16 are neither
//! asked for nor missed. Ranking: each person found is searched for among those that other cameras
//! found, in all buildings.
#![allow(clippy::print_stdout, reason = "an example prints its result")]

use std::error::Error;
use std::fs::{self, File};
use std::io::{BufReader, Read};
use std::path::Path;
use std::time::Instant;

use hachi_inference::{ImageView, LoadOptions, load};
use hachi_people::BoundingBox;
use hachi_people::appearance::{Appearance, Person};
use hachi_people::detect::{Detector, Found, Wanted};
use hachi_people::gallery;
use hachi_realsense::frame::{Layout, YuyvImage};
use hachi_tests::masks::mask_overlap;

const WIDTH: u32 = 640;
const HEIGHT: u32 = 360;
const LEAST_PIXELS: usize = 96;
const LEAST_HEIGHT: f64 = 16.0;
/// Less seen than this, pixels and share, somebody is not told apart.
const LEAST_TO_TELL: (usize, f64) = (500, 0.3);
const OVERLAP: f64 = 0.5;

/// A person in a picture.
struct Truth {
    camera: u32,
    label: u8,
    id: u32,
    bounding_box: BoundingBox,
    pixels: usize,
    share: f64,
}

impl Truth {
    fn counts(&self) -> bool {
        self.pixels >= LEAST_PIXELS && self.bounding_box.height >= LEAST_HEIGHT
    }
}

/// Somebody found who can be told apart.
struct Seen {
    id: u32,
    camera: u32,
    feature: Vec<f32>,
}

#[derive(Default)]
struct Figures {
    /// Score, and whether it is somebody.
    detections: Vec<(f64, bool)>,
    people: usize,
    masks: Vec<f64>,
    seen: Vec<Seen>,
    detect_s: f64,
    features_s: f64,
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<_> = std::env::args().skip(1).collect();
    let (folder, detector, reid) = match &arguments[..] {
        [folder] => (folder, "own:detector", "own:reid"),
        [folder, detector, reid] => (folder, detector.as_str(), reid.as_str()),
        _ => return Err("give a folder, and two networks or none".into()),
    };
    let options = LoadOptions {
        threads: Some(1),
        ..LoadOptions::default()
    };
    let mut detector = Detector::new(load(Path::new(detector), &options)?, Wanted::People)?;
    let mut appearance = Appearance::new(load(Path::new(reid), &options)?)?;
    let folder = Path::new(folder);
    let truth = read_truth(&folder.join("people.csv"))?;
    let mut color = BufReader::new(File::open(folder.join("color.yuyv"))?);
    let mut masks = BufReader::new(File::open(folder.join("masks.u8"))?);
    let layout = Layout::packed(WIDTH, HEIGHT);
    let mut yuyv = vec![0; 2 * layout.pixels()];
    let mut mask = vec![0; layout.pixels()];
    let mut rgb = vec![0; 3 * layout.pixels()];
    let mut figures = Figures::default();
    let mut frames = 0;
    while color.read_exact(&mut yuyv).is_ok() {
        masks.read_exact(&mut mask)?;
        YuyvImage::new(&yuyv, layout)?.to_rgb(&mut rgb)?;
        let image = ImageView::new(WIDTH as usize, HEIGHT as usize, &rgb)?;
        let people = truth.get(frames).map_or(&[][..], Vec::as_slice);
        figures.look(&mut detector, &mut appearance, &image, (people, &mask))?;
        frames += 1;
    }
    figures.print(
        frames,
        detector.even_score(),
        appearance.same_person_distance(),
    );
    Ok(())
}

fn read_truth(path: &Path) -> Result<Vec<Vec<Truth>>, Box<dyn Error>> {
    let mut frames: Vec<Vec<Truth>> = Vec::new();
    for line in fs::read_to_string(path)?.lines().skip(1) {
        let row = line.split(',').map(str::parse::<f64>);
        let row = row.collect::<Result<Vec<_>, _>>()?;
        let [
            frame,
            camera,
            label,
            id,
            left,
            top,
            right,
            bottom,
            visible,
            whole,
            _distance_m,
            _bearing_deg,
        ] = row[..]
        else {
            return Err(format!("{}: {line}", path.display()).into());
        };
        frames.resize_with(frames.len().max(frame as usize + 1), Vec::new);
        frames[frame as usize].push(Truth {
            camera: camera as u32,
            label: label as u8,
            id: id as u32,
            bounding_box: BoundingBox::of_edges([left, top, right, bottom]),
            pixels: visible as usize,
            share: visible / whole,
        });
    }
    Ok(frames)
}

impl Figures {
    fn look(
        &mut self,
        detector: &mut Detector,
        appearance: &mut Appearance,
        image: &ImageView<'_>,
        (people, mask): (&[Truth], &[u8]),
    ) -> Result<(), Box<dyn Error>> {
        let begun = Instant::now();
        let found = detector.detect(image)?.to_vec();
        self.detect_s += begun.elapsed().as_secs_f64();
        self.people += people.iter().filter(|person| person.counts()).count();
        let mut taken = vec![false; people.len()];
        let mut matched: Vec<(&Found, &Truth)> = Vec::new();
        for found in &found {
            let fits = |index: &usize| people[*index].bounding_box.iou(&found.bounding_box);
            let free = (0..people.len()).filter(|index| !taken[*index]);
            let best = free.max_by(|a, b| fits(a).total_cmp(&fits(b)));
            match best.filter(|best| fits(best) >= OVERLAP) {
                Some(best) if people[best].counts() => {
                    taken[best] = true;
                    self.detections.push((found.score, true));
                    if found.score >= detector.even_score() {
                        matched.push((found, &people[best]));
                    }
                }
                Some(_) => {}
                None => self.detections.push((found.score, false)),
            }
        }
        let overlap = |(found, truth): &(&Found, &Truth)| {
            mask_overlap(found, truth.label, mask, WIDTH as usize)
        };
        self.masks.extend(matched.iter().filter_map(overlap));
        matched
            .retain(|(_, truth)| truth.pixels >= LEAST_TO_TELL.0 && truth.share >= LEAST_TO_TELL.1);
        let people: Vec<_> = matched.iter().map(|(found, _)| crop(found)).collect();
        let begun = Instant::now();
        let features = appearance.features(image, &people)?.to_vec();
        self.features_s += begun.elapsed().as_secs_f64();
        let features = features.chunks_exact(appearance.length());
        for ((_, truth), feature) in matched.iter().zip(features) {
            self.seen.push(Seen {
                id: truth.id,
                camera: truth.camera,
                feature: feature.to_vec(),
            });
        }
        Ok(())
    }

    fn print(&mut self, frames: usize, even_score: f64, same_person: f64) {
        self.detections.sort_by(|a, b| b.0.total_cmp(&a.0));
        let sure = self.detections.iter().filter(|d| d.0 >= even_score);
        let (right, all) = sure.fold((0, 0), |(right, all), d| {
            (right + usize::from(d.1), all + 1)
        });
        println!("{frames} pictures, {} people", self.people);
        println!(
            "found: AP50 {:.3}; at score {even_score}: recall {:.3}, precision {:.3}, mask IoU {:.3}",
            average_precision(&self.detections, self.people),
            right as f64 / self.people as f64,
            right as f64 / f64::from(all.max(1)),
            mean(&self.masks),
        );
        for (score, recall, precision) in operating_points(&self.detections, self.people) {
            println!("  score {score:.2}: recall {recall:.3}, precision {precision:.3}");
        }
        let (rank_1, precision) = ranking(&self.seen);
        println!(
            "told apart: {} crops, rank-1 {rank_1:.3}, mAP {precision:.3}",
            self.seen.len()
        );
        let (mut same, mut others) = distances(&self.seen);
        same.sort_by(f64::total_cmp);
        others.sort_by(f64::total_cmp);
        let below = |all: &[f64], at| all.partition_point(|d| *d <= at) as f64 / all.len() as f64;
        let even = others
            .iter()
            .find(|d| 1.0 - below(&same, **d) <= below(&others, **d));
        let strict = others.get(others.len() / 100);
        for (name, at) in [
            ("manifest", Some(&same_person)),
            ("as many of each", even),
            ("one other in 100", strict),
        ] {
            let Some(&at) = at else { continue };
            println!(
                "  up to {at:.3} ({name}): {:.3} of the same, {:.4} of others",
                below(&same, at),
                below(&others, at)
            );
        }
        println!(
            "{:.1} ms a picture for boxes and masks, {:.2} ms a person for features",
            1e3 * self.detect_s / frames as f64,
            1e3 * self.features_s / self.seen.len() as f64,
        );
    }
}

fn crop(found: &Found) -> Person<'_> {
    Person {
        bounding_box: found.bounding_box,
        mask: found.mask.as_ref(),
    }
}

/// Area under precision over recall, precision never below that at greater recall.
fn average_precision(detections: &[(f64, bool)], people: usize) -> f64 {
    let mut curve = Vec::new();
    let mut right = 0;
    for (index, (_, is_right)) in detections.iter().enumerate() {
        right += usize::from(*is_right);
        curve.push((
            right as f64 / people as f64,
            right as f64 / (index + 1) as f64,
        ));
    }
    let (mut area, mut best, mut until) = (0.0, 0.0f64, curve.last().map_or(0.0, |c| c.0));
    for (recall, precision) in curve.into_iter().rev() {
        area += (until - recall) * best;
        (best, until) = (best.max(precision), recall);
    }
    area + until * best
}

fn operating_points(detections: &[(f64, bool)], people: usize) -> Vec<(f64, f64, f64)> {
    let at = |score: f64| {
        let above = detections.partition_point(|d| d.0 >= score);
        let right = detections[..above].iter().filter(|d| d.1).count() as f64;
        (score, right / people as f64, right / above.max(1) as f64)
    };
    [0.2, 0.3, 0.4, 0.5, 0.6, 0.7].map(at).to_vec()
}

fn ranking(seen: &[Seen]) -> (f64, f64) {
    let (mut first, mut precisions) = (Vec::new(), Vec::new());
    for query in seen {
        let others = seen.iter().filter(|other| other.camera != query.camera);
        let mut others: Vec<_> = others
            .map(|other| {
                (
                    gallery::distance(&query.feature, &other.feature),
                    other.id == query.id,
                )
            })
            .collect();
        others.sort_by(|a, b| a.0.total_cmp(&b.0));
        let ranks: Vec<usize> = (others.iter().zip(1..))
            .filter_map(|(other, rank)| other.1.then_some(rank))
            .collect();
        let Some(best) = ranks.first() else { continue };
        first.push(if *best == 1 { 1.0 } else { 0.0 });
        let precision = ranks
            .iter()
            .zip(1..)
            .map(|(rank, hit)| f64::from(hit) / *rank as f64);
        precisions.push(precision.sum::<f64>() / ranks.len() as f64);
    }
    (mean(&first), mean(&precisions))
}

/// Of all pairs: of the same person, and of others.
fn distances(seen: &[Seen]) -> (Vec<f64>, Vec<f64>) {
    let (mut same, mut others) = (Vec::new(), Vec::new());
    for (index, a) in seen.iter().enumerate() {
        for b in &seen[index + 1..] {
            let distance = gallery::distance(&a.feature, &b.feature);
            if a.id == b.id { &mut same } else { &mut others }.push(distance);
        }
    }
    (same, others)
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}
