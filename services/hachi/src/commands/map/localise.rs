//! `hachi map localise`: where in a map a recording was made, from nothing.

use hachi_hal::Stamp;
use hachi_slam::overlay::OverlayStore;
use hachi_slam::{Slam, SlamEstimate};
use serde::Serialize;

use crate::cli::map::MapLocaliseArguments;
use crate::commands::replay::thread_pool;
use crate::config::MappingConfig;
use crate::exit::Failure;
use crate::interrupt::Cancelled;
use crate::mapping::Mapping;
use crate::motion_samples::MotionSamples;
use crate::{output, progress, recording, saved_maps};

/// Where the recording was made.
#[derive(Debug, Serialize)]
struct Place {
    /// `OK` if it is known, else why not.
    condition: String,
    reason: String,
    /// The moment of the pose, seconds of the recording's clock.
    stamp_s: f64,
    /// Into the recording, seconds.
    after_s: f64,
    scans: u64,
    /// `x y z qx qy qz qw`.
    map_from_base: [f64; 7],
    /// One standard deviation of the position, metres.
    sigma_m: f64,
}

/// Runs the command.
///
/// # Errors
/// The map or the recording can't be read; or the place is not found.
pub fn run(arguments: &MapLocaliseArguments) -> Result<(), Failure> {
    let config = MappingConfig::load(arguments.platform.as_deref(), arguments.config.as_deref())?;
    let (file, saved) = saved_maps::read(&arguments.map)?;
    let identity = saved_maps::identity(arguments.platform.as_deref());
    file.check_identity(&identity)
        .map_err(|error| saved_maps::failure(&error))?;
    let slam = Slam::resume(
        config.slam.clone(),
        saved,
        Box::new(OverlayStore::over(file)),
    )
    .map_err(|error| Failure::new(error, "restore the map from a copy, or map anew"))?;
    let mut source = recording::open(&arguments.input)?;
    let mut motion = MotionSamples::open(
        &arguments.input,
        config.motion,
        arguments.platform.as_deref(),
    )?;
    let cancelled = Cancelled::on_interrupt()?;
    let bar = progress::bar(source.scan_count(), "scans");
    // No map is written: nothing is put into this folder.
    let mut mapping = Mapping::new(config, &std::env::temp_dir())?.with_slam(slam);

    let pool = thread_pool(None)?;
    let mut begun: Option<Stamp> = None;
    let mut last: Option<SlamEstimate> = None;
    let mut scans = 0;
    pool.install(|| -> Result<(), Failure> {
        let mut points = Vec::new();
        let mut before = Stamp::from_nanos(i64::MIN);
        while !cancelled.is_cancelled()
            && let Some(header) = source.next_scan(&mut points)?
        {
            if header.end <= before {
                continue;
            }
            motion.read_until(before, header.end);
            before = header.end;
            begun.get_or_insert(header.end);
            mapping.step(&header, &points, motion.imu(), motion.odometry());
            scans += 1;
            bar.inc(1);
            last = mapping.place();
            if last.is_some_and(|place| place.condition.is_ok()) {
                break;
            }
        }
        Ok(())
    })?;
    bar.finish_and_clear();
    let (Some(begun), Some(found)) = (begun, last) else {
        return Err(Failure::new(
            format_args!("{} holds no scan", arguments.input.display()),
            "give another recording",
        ));
    };
    tell(arguments, begun, &found, scans)
}

fn tell(
    arguments: &MapLocaliseArguments,
    begun: Stamp,
    found: &SlamEstimate,
    scans: u64,
) -> Result<(), Failure> {
    let (t, q) = (
        found.map_from_base.translation.vector,
        found.map_from_base.rotation.coords,
    );
    let variance = (0..3).map(|i| found.covariance[(i, i)]).sum::<f64>();
    let place = Place {
        condition: found.condition.name().to_owned(),
        reason: found.condition.to_string(),
        stamp_s: found.stamp.as_secs_f64(),
        after_s: found.stamp.secs_since(begun),
        scans,
        map_from_base: [t.x, t.y, t.z, q.x, q.y, q.z, q.w],
        sigma_m: variance.max(0.0).sqrt(),
    };
    if arguments.json {
        output::json(&place)?;
    } else if found.condition.is_ok() {
        let yaw = found.map_from_base.rotation.euler_angles().2.to_degrees();
        output::text(&format!(
            "at x {:.2} y {:.2} z {:.2} m, heading {yaw:.1} degrees, known after {:.1} s ({scans} scans)",
            t.x, t.y, t.z, place.after_s
        ))?;
    }
    if found.condition.is_ok() {
        return Ok(());
    }
    Err(Failure::new(
        format_args!(
            "the place was not found in {scans} scans: {}",
            found.condition
        ),
        "give a longer recording that moves, or check that the map is of this place",
    ))
}
