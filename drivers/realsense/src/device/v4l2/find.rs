//! Which cameras are plugged in, by what the kernel says of its video devices under
//! `/sys/class/video4linux`: whose interface of which USB device each is.

use std::fs;
use std::path::{Path, PathBuf};
use std::string::{String, ToString};
use std::vec::Vec;

use crate::{Model, VENDOR};

/// A camera of the maker that is plugged in.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FoundCamera {
    /// Its USB product number.
    pub product: u16,
    /// Its serial number on the USB, if it says one.
    pub serial: Option<String>,
    /// Speed of its link, Mbit/s, if the system says: 480 is USB 2, on which large pictures are not
    /// to be had.
    pub speed_mbps: Option<u32>,
    /// Its video devices, in the order of their numbers.
    pub nodes: Vec<PathBuf>,
    /// The USB device's folder.
    usb: PathBuf,
}

impl FoundCamera {
    /// A camera as the system would list it.
    pub fn new(
        product: u16,
        serial: Option<&str>,
        speed_mbps: Option<u32>,
        nodes: &[&str],
    ) -> Self {
        Self {
            product,
            serial: serial.map(ToString::to_string),
            speed_mbps,
            nodes: nodes.iter().map(PathBuf::from).collect(),
            usb: PathBuf::new(),
        }
    }

    /// Which camera it is; `None` if it is one that is not known here.
    pub fn model(&self) -> Option<Model> {
        Model::from_product(self.product)
    }
}

/// The maker's cameras that are plugged in, in the order of their first device.
pub fn find_cameras() -> Vec<FoundCamera> {
    find_in(Path::new("/sys/class/video4linux"), Path::new("/dev"))
}

pub(super) fn find_in(class: &Path, dev: &Path) -> Vec<FoundCamera> {
    let mut numbers: Vec<u32> = fs::read_dir(class)
        .into_iter()
        .flatten()
        .flatten()
        .filter_map(|entry| {
            let name = entry.file_name();
            name.to_str()?.strip_prefix("video")?.parse().ok()
        })
        .collect();
    numbers.sort_unstable();
    let mut cameras: Vec<FoundCamera> = Vec::new();
    for number in numbers {
        let name = std::format!("video{number}");
        // `device` is the USB interface, its folder lies in the USB device's.
        let Ok(interface) = fs::canonicalize(class.join(&name).join("device")) else {
            continue;
        };
        let Some(usb) = interface.parent() else {
            continue;
        };
        let text = |what: &str| {
            let text = fs::read_to_string(usb.join(what)).ok()?;
            Some(text.trim().to_string()).filter(|text| !text.is_empty())
        };
        let hexadecimal = |what| u16::from_str_radix(&text(what)?, 16).ok();
        if hexadecimal("idVendor") != Some(VENDOR) {
            continue;
        }
        let Some(product) = hexadecimal("idProduct") else {
            continue;
        };
        let node = dev.join(&name);
        match cameras.iter_mut().find(|camera| camera.usb == usb) {
            Some(camera) => camera.nodes.push(node),
            None => cameras.push(FoundCamera {
                product,
                serial: text("serial"),
                speed_mbps: text("speed").and_then(|speed| speed.parse().ok()),
                nodes: Vec::from([node]),
                usb: usb.to_path_buf(),
            }),
        }
    }
    cameras
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::os::unix::fs::symlink;

    /// A `/sys` as a D455 at USB port 2-3, a laptop's own camera and a loopback device have it.
    fn system(root: &Path) {
        let class = root.join("class/video4linux");
        fs::create_dir_all(&class).unwrap();
        let usb = |port: &str, facts: &[(&str, &str)]| {
            let folder = root.join("devices/usb").join(port);
            fs::create_dir_all(&folder).unwrap();
            for (name, value) in facts {
                fs::write(folder.join(name), std::format!("{value}\n")).unwrap();
            }
        };
        usb(
            "2-3",
            &[
                ("idVendor", "8086"),
                ("idProduct", "0b5c"),
                ("serial", "152223001234"),
                ("speed", "5000"),
            ],
        );
        usb("1-5", &[("idVendor", "04f2"), ("idProduct", "b7b6")]);
        let video = |number: u32, interface: &str| {
            let interface = root.join("devices").join(interface);
            let node = interface.join(std::format!("video4linux/video{number}"));
            fs::create_dir_all(&node).unwrap();
            symlink(&interface, node.join("device")).unwrap();
            symlink(&node, class.join(std::format!("video{number}"))).unwrap();
        };
        video(0, "usb/1-5/1-5:1.0");
        for number in [2, 3, 4, 5] {
            video(number, "usb/2-3/2-3:1.0");
        }
        video(10, "usb/2-3/2-3:1.3");
        video(6, "usb/2-3/2-3:1.3");
        video(7, "virtual");
    }

    #[test]
    fn a_camera_is_found_by_its_maker_with_its_devices_in_order() {
        let root = std::env::temp_dir().join(std::format!("hachi-sysfs-{}", std::process::id()));
        system(&root);
        let found = find_in(&root.join("class/video4linux"), Path::new("/dev"));
        fs::remove_dir_all(&root).unwrap();
        assert_eq!(found.len(), 1, "{found:?}");
        let camera = &found[0];
        assert_eq!(camera.model(), Some(Model::D455));
        assert_eq!(camera.serial.as_deref(), Some("152223001234"));
        assert_eq!(camera.speed_mbps, Some(5_000));
        let nodes = [2, 3, 4, 5, 6, 10].map(|n| PathBuf::from(std::format!("/dev/video{n}")));
        assert_eq!(camera.nodes, nodes);
    }

    #[test]
    fn a_system_without_video_has_no_camera() {
        assert_eq!(find_in(Path::new("/no/such/folder"), Path::new("/dev")), []);
    }
}
