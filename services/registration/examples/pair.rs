//! Median time and result of one alignment: `pair TARGET.bin SOURCE.bin [THREADS] [VOXEL_M]`,
//! clouds as little-endian `f32` x y z intensity.
#![allow(clippy::print_stdout, reason = "a program")]

use std::time::Instant;

use hachi_hal::Pose;
use hachi_registration::{Aligner, AlignerConfig, Kernel, Preparer, SurfaceCloud};

fn load(path: &str) -> Vec<[f32; 3]> {
    let bytes = std::fs::read(path).expect("readable file");
    let float = |c: &[u8]| f32::from_le_bytes(c.try_into().expect("four bytes"));
    bytes
        .chunks_exact(16)
        .map(|p| [float(&p[0..4]), float(&p[4..8]), float(&p[8..12])])
        .collect()
}

fn main() {
    let args: Vec<String> = std::env::args().collect();
    let (target, source) = (load(&args[1]), load(&args[2]));
    let threads = args.get(3).map_or(1, |t| t.parse().expect("threads"));
    let voxel_m = args.get(4).map_or(0.25, |t| t.parse().expect("voxel size"));
    let scale: f32 = args
        .get(5)
        .map_or(0.0, |t| t.parse().expect("kernel scale"));
    let reach_m: f32 = args.get(6).map_or(1.0, |t| t.parse().expect("reach"));
    let kernel = if scale > 0.0 {
        Kernel::GemanMcClure { scale_m: scale }
    } else if scale < 0.0 {
        Kernel::Cauchy { scale_m: -scale }
    } else {
        Kernel::None
    };
    let config = AlignerConfig {
        kernel,
        reach_m,
        ..AlignerConfig::default()
    };
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .expect("threads");
    pool.install(|| {
        let mut preparers = [Preparer::default(), Preparer::default()];
        let mut clouds = [SurfaceCloud::default(), SurfaceCloud::default()];
        let mut aligner = Aligner::default();
        let (mut prepare, mut align) = (Vec::new(), Vec::new());
        let mut result = None;
        for _ in 0..31 {
            let start = Instant::now();
            let [p, q] = &mut preparers;
            let [t, s] = &mut clouds;
            rayon::join(
                || p.prepare(target.iter().map(|&p| (p, 0.0)), voxel_m, t),
                || q.prepare(source.iter().map(|&p| (p, 0.0)), voxel_m, s),
            );
            let middle = Instant::now();
            let r = aligner.align(&s.points, t, &Pose::identity(), None, &config);
            align.push(middle.elapsed());
            prepare.push(middle - start);
            result = Some(r);
        }
        prepare.sort();
        align.sort();
        let r = result.expect("repeated");
        println!(
            "points {} {}  prepare {:?} align {:?} iterations {} share {:.3} residual {:.4}",
            clouds[0].len(),
            clouds[1].len(),
            prepare[15],
            align[15],
            r.iterations,
            r.inlier_share,
            r.residual_m
        );
        let v = r.target_from_source.translation.vector;
        let a = r.target_from_source.rotation.scaled_axis();
        println!(
            "t {:.5} {:.5} {:.5} r {:.5} {:.5} {:.5}",
            v.x, v.y, v.z, a.x, a.y, a.z
        );
    });
}
