//! What happens once when a camera is opened: its identity and calibration are read, its settings
//! written.

use hachi_hal::RgbdGeometry;

use super::link::{CameraLink, LinkError, Stream};
use super::session::CameraIdentity;
use super::{CameraError, RealSenseConfig};
use crate::calibration::{ColorCalibration, DepthCalibration};
use crate::controls::{self, Exposure, Query, Selector};
use crate::monitor::{
    Command, DeviceInfo, MONITOR_LEN, MonitorError, USUAL_DEPTH_UNIT_M, depth_unit_m,
};

/// The system's controls of a colour camera (`linux/v4l2-controls.h`).
const EXPOSURE_AUTO: u32 = 0x009A_0901;
const EXPOSURE_ABSOLUTE: u32 = 0x009A_0902;
/// Values of the first: manual, and automatic as these cameras have it ("aperture priority").
const EXPOSURE_MANUAL: i32 = 1;
const EXPOSURE_APERTURE_PRIORITY: i32 = 3;
/// The unit of the second, µs.
const EXPOSURE_UNIT_US: u32 = 100;

/// What an open camera is and where the pixels of its streams look. Nothing streams for that.
///
/// # Errors
/// The firmware does not answer, or the calibration cannot be used.
pub fn read(link: &mut impl CameraLink) -> Result<(CameraIdentity, RgbdGeometry), CameraError> {
    let mut buffer = [0; MONITOR_LEN];
    let info = DeviceInfo::decode(ask(link, &Command::DEVICE_INFO, &mut buffer)?)?;
    let table = Command::calibration(DepthCalibration::TABLE);
    let depth = DepthCalibration::decode(ask(link, &table, &mut buffer)?)?;
    let table = Command::calibration(ColorCalibration::TABLE);
    let color = ColorCalibration::decode(ask(link, &table, &mut buffer)?)?;
    let unit = match ask(link, &Command::DEPTH_TABLE, &mut buffer) {
        Ok(payload) => Some(depth_unit_m(payload)?),
        // Without advanced mode the firmware does not answer.
        Err(CameraError::Monitor(MonitorError::Refused { .. })) => None,
        Err(error) => return Err(error),
    };
    let [depth_size, color_size] = Stream::BOTH.map(|stream| link.layout(stream));
    let geometry = RgbdGeometry {
        depth: depth.intrinsics(depth_size.width, depth_size.height)?,
        color: color.intrinsics(color_size.width, color_size.height)?,
        color_from_depth: color.depth_from_color().inverse(),
        depth_unit_m: unit.unwrap_or(USUAL_DEPTH_UNIT_M),
    };
    let identity = CameraIdentity {
        model: link.model(),
        info,
        depth_unit_assumed: unit.is_none(),
    };
    Ok((identity, geometry))
}

/// One command and the payload of its answer.
fn ask<'a>(
    link: &mut impl CameraLink,
    command: &Command,
    buffer: &'a mut [u8; MONITOR_LEN],
) -> Result<&'a [u8], CameraError> {
    link.set_unit(Selector::Monitor, &command.encode())?;
    link.get_unit(Selector::Monitor, Query::Current, buffer)?;
    Ok(command.answer(buffer)?)
}

/// Writes the settings.
pub(super) fn apply(
    link: &mut impl CameraLink,
    config: &RealSenseConfig,
) -> Result<(), CameraError> {
    for (selector, value) in config.depth_settings.controls() {
        let range =
            [Query::Minimum, Query::Maximum].map(|query| ask_control(link, selector, query));
        let [Ok(least), Ok(most)] = range else {
            return Err(range
                .into_iter()
                .find_map(Result::err)
                .map_or(CameraError::NoSuchControl { selector }, CameraError::Link));
        };
        let mut buffer = [0; 4];
        let bytes = controls::encode(selector, value, &mut buffer);
        let (Some(bytes), true) = (bytes, (least..=most).contains(&value)) else {
            return Err(CameraError::Setting {
                selector,
                value,
                least,
                most,
            });
        };
        link.set_unit(selector, bytes)?;
    }
    let (mode, exposure) = match config.color_exposure {
        Exposure::Automatic => (EXPOSURE_APERTURE_PRIORITY, None),
        Exposure::Fixed(us) => (EXPOSURE_MANUAL, Some((us / EXPOSURE_UNIT_US).max(1))),
    };
    link.set_video(Stream::Color, EXPOSURE_AUTO, mode)?;
    if let Some(units) = exposure {
        let units = i32::try_from(units).unwrap_or(i32::MAX);
        link.set_video(Stream::Color, EXPOSURE_ABSOLUTE, units)?;
    }
    Ok(())
}

/// One answer of a control that holds a number.
fn ask_control(
    link: &mut impl CameraLink,
    selector: Selector,
    query: Query,
) -> Result<u32, LinkError> {
    let mut buffer = [0; 4];
    let bytes = &mut buffer[..selector.size().min(4)];
    link.get_unit(selector, query, bytes)?;
    Ok(controls::decode(bytes).unwrap_or(0))
}
