//! `camera receive`: what the camera sends, picture by picture.
//!
//! A camera that is away is looked for once a second; whoever relies on it sees how old the last
//! picture is.

use hachi_hal::{DeviceError, RgbdCamera, RgbdImages, Stamp};
use hachi_runtime::{Progress, Work};
use tracing::{info, warn};

use super::messages::{Belt, Picture};
use super::signs::SharedSigns;

/// From one try to open a camera that failed to the next, ns: looking for one takes the kernel a while.
const RETRY_NS: i64 = 1_000_000_000;

/// Something that takes pictures, whatever goes wrong in it being told in words.
pub trait PictureSource: Send {
    /// Puts the next picture that is there at `now` into `picture`; whether there was one.
    ///
    /// # Errors
    /// Why there is none; the next call tries again.
    fn read(&mut self, picture: &mut Picture, now: Stamp) -> Result<bool, String>;
}

/// The colour pictures of a depth camera.
pub struct ColorOf<C> {
    camera: C,
    depth: Vec<u16>,
    /// Bytes of a colour picture.
    bytes: usize,
}

impl<C: RgbdCamera> ColorOf<C> {
    /// Pictures of a camera that sends so many pixels of depth and colour.
    pub fn new(camera: C, depth_pixels: usize, color_pixels: usize) -> Self {
        Self {
            camera,
            depth: vec![0; depth_pixels],
            bytes: 3 * color_pixels,
        }
    }
}

impl<C> PictureSource for ColorOf<C>
where
    C: RgbdCamera + Send,
    C::Error: DeviceError,
{
    fn read(&mut self, picture: &mut Picture, now: Stamp) -> Result<bool, String> {
        picture.rgb.resize(self.bytes, 0);
        let images = RgbdImages {
            depth: &mut self.depth,
            color: &mut picture.rgb,
        };
        let header = self.camera.read_frame(images, now);
        let Some(header) = header.map_err(|error| error.to_string())? else {
            return Ok(false);
        };
        let Some(geometry) = self.camera.geometry() else {
            return Ok(false);
        };
        let [width, height] = [geometry.color.width, geometry.color.height].map(|n| n as usize);
        picture.rgb.truncate(3 * width * height);
        (picture.width, picture.height) = (width, height);
        picture.stamp = header.color_stamp;
        Ok(true)
    }
}

/// The task.
pub struct CameraReceive {
    /// The camera.
    pub camera: Box<dyn PictureSource>,
    /// To detection.
    pub out: Belt<Picture>,
    /// Where the last picture's time is left.
    pub signs: SharedSigns,
    /// When to try again, after a failure.
    pub retry_at: Option<Stamp>,
}

impl Work for CameraReceive {
    fn run(&mut self, now: Stamp) -> Progress {
        if self.retry_at.is_some_and(|at| now < at) {
            return Progress::Done;
        }
        let Some(mut picture) = self.out.empty.receive() else {
            // All boxes are under way; pictures wait in the camera.
            return Progress::Done;
        };
        match self.camera.read(&mut picture, now) {
            Ok(true) => {
                if self.retry_at.take().is_some() {
                    info!("the camera is there");
                }
                self.signs.camera.set(picture.stamp);
                self.out.send(picture);
                return Progress::Done;
            }
            Ok(false) => {}
            Err(error) => {
                if self.retry_at.is_none() {
                    warn!(error, "no picture");
                }
                self.retry_at = Some(now + RETRY_NS);
            }
        }
        self.out.give_back(picture);
        Progress::Done
    }
}
