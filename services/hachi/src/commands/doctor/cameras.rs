//! RealSense cameras: which are plugged in, which can be used, and what keeps the others from it.

use hachi_datagram::SystemClock;
use hachi_hal::Clock as _;
use hachi_realsense::device::v4l2::{FoundCamera, V4l2Port, find_cameras};
use hachi_realsense::device::{CameraIdentity, CameraPort as _, CameraRequest, identify};
use hachi_realsense::{CameraError, RealSenseConfig};

use super::finding::Finding;

const NAME: &str = "RealSense";
/// USB 2, Mbit/s. The cameras need more for pictures of the usual size.
const USB_2_MBPS: u32 = 480;

pub(super) fn check() -> Vec<Finding> {
    let found = find_cameras();
    if found.is_empty() {
        return vec![Finding::ok(NAME, "none is plugged in")];
    }
    found.iter().map(|camera| finding(camera, &probe)).collect()
}

/// What is said of one camera; `probe` opens it.
fn finding(
    camera: &FoundCamera,
    probe: &dyn Fn(&FoundCamera) -> Result<CameraIdentity, CameraError>,
) -> Finding {
    let serial = camera.serial.as_deref().unwrap_or("without serial number");
    let Some(model) = camera.model() else {
        return Finding::warn(
            NAME,
            format!(
                "8086:{:04x} {serial} is not a D415, D435 or D455",
                camera.product
            ),
            "use one of these, or say in an issue what it is",
        );
    };
    let name = format!("{} {serial}", model.name());
    match probe(camera) {
        Err(error) => Finding::warn(NAME, format!("{name} cannot be used"), error.to_string()),
        Ok(_) if camera.speed_mbps.is_some_and(|speed| speed <= USB_2_MBPS) => Finding::warn(
            NAME,
            format!("{name} is on USB 2: small pictures only"),
            "use a USB 3 port and the cable that came with it",
        ),
        Ok(identity) => {
            let [a, b, c, d] = identity.info.firmware;
            let unit = if identity.depth_unit_assumed {
                ", depth unit taken as 1 mm"
            } else {
                ""
            };
            Finding::ok(NAME, format!("{name}, firmware {a}.{b}.{c}.{d}{unit}"))
        }
    }
}

/// Opens the camera with the built-in settings and reads what it is; nothing streams.
fn probe(camera: &FoundCamera) -> Result<CameraIdentity, CameraError> {
    let clock = SystemClock::new();
    let settings = RealSenseConfig::default();
    let request = CameraRequest {
        serial: camera.serial.clone(),
        depth: settings.depth,
        color: settings.color,
    };
    let mut link = V4l2Port::new(clock)
        .open(&request, clock.now())?
        .ok_or_else(|| CameraError::Missing {
            serial: camera.serial.clone(),
        })?;
    let (identity, _) = identify(&mut link)?;
    Ok(identity)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::commands::doctor::finding::Level;
    use hachi_realsense::Model;
    use hachi_realsense::device::LinkError;
    use hachi_realsense::monitor::DeviceInfo;

    fn camera(product: u16, speed_mbps: u32) -> FoundCamera {
        FoundCamera::new(
            product,
            Some("152223001234"),
            Some(speed_mbps),
            &["/dev/video2"],
        )
    }

    fn identity() -> CameraIdentity {
        CameraIdentity {
            model: Model::D455,
            info: DeviceInfo {
                firmware: [5, 16, 0, 1],
                serial: [0; 6],
            },
            depth_unit_assumed: false,
        }
    }

    #[test]
    fn a_camera_that_can_be_used_is_named_with_its_firmware() {
        let said = finding(&camera(0x0B5C, 5_000), &|_| Ok(identity()));
        assert_eq!(said.level, Level::Ok);
        assert_eq!(said.what, "D455 152223001234, firmware 5.16.0.1");
    }

    #[test]
    fn what_keeps_a_camera_from_working_is_said_with_what_to_do() {
        let denied = |_: &FoundCamera| {
            Err(CameraError::Link(LinkError::Denied {
                path: "/dev/video2".into(),
            }))
        };
        let said = finding(&camera(0x0B5C, 5_000), &denied);
        assert_eq!(said.level, Level::Warn);
        assert!(said.next_step.unwrap().contains("usermod -aG video"));
        let slow = finding(&camera(0x0AD3, 480), &|_| Ok(identity()));
        assert!(
            slow.what.contains("D415") && slow.what.contains("USB 2"),
            "{slow:?}"
        );
        let unknown = finding(&camera(0x0B3A, 5_000), &|_| panic!("it must not be opened"));
        assert!(unknown.what.contains("8086:0b3a"), "{unknown:?}");
    }
}
