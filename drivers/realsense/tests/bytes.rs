//! The decoders against numbers from elsewhere: layouts written out by hand, a real unit's printed
//! intrinsics, librealsense's own answers, and the colours of ITU-R BT.601.

use hachi_hal::{Distortion, Intrinsics};
use hachi_realsense::calibration::{CalibrationError, ColorCalibration, DepthCalibration};
use hachi_realsense::controls::{self, DepthSettings, Emitter, Exposure, Query, Selector};
use hachi_realsense::encode;
use hachi_realsense::frame::{
    CaptureTiming, DepthState, FrameError, FrameMetadata, Layout, MetadataError, YuyvImage,
    Z16Image, rgb_of_yuv,
};
use hachi_realsense::monitor::{Command, DeviceInfo, MonitorError, depth_unit_m};

/// Writes values at offsets, as the tables of this file give them.
fn put(bytes: &mut [u8], at: usize, value: &[u8]) {
    bytes[at..at + value.len()].copy_from_slice(value);
}

fn put_f32(bytes: &mut [u8], at: usize, value: f32) {
    put(bytes, at, &value.to_le_bytes());
}

#[test]
fn a_padded_depth_image_is_read_pixel_by_pixel() {
    // 3 x 2 pixels, rows of 8 bytes: two bytes of padding behind each.
    let bytes = [1, 0, 2, 0, 0xE8, 0x03, 9, 9, 0, 0, 0xFF, 0xFF, 6, 1, 9, 9];
    let layout = Layout {
        width: 3,
        height: 2,
        stride: 8,
    };
    let image = Z16Image::new(&bytes, layout).unwrap();
    assert_eq!(image.count(2, 0), Some(1_000));
    assert_eq!(image.count(1, 1), Some(0xFFFF));
    assert_eq!((image.count(3, 0), image.count(0, 2)), (None, None));
    assert_eq!(image.metres(2, 0, 0.001), Some(1.0));
    assert_eq!(image.metres(0, 1, 0.001), None, "0 is nothing measured");
    let mut counts = [7; 6];
    image.copy_to(&mut counts).unwrap();
    assert_eq!(counts, [1, 2, 1_000, 0, 0xFFFF, 262]);
    // The last row may lack its padding, and nothing else.
    assert!(Z16Image::new(&bytes[..14], layout).is_ok());
    let cut = Z16Image::new(&bytes[..13], layout).unwrap_err();
    assert_eq!(
        cut,
        FrameError::Length {
            got: 13,
            needed: 14
        }
    );
    let short = image.copy_to(&mut counts[..5]).unwrap_err();
    assert_eq!(short, FrameError::Target { got: 5, needed: 6 });
}

#[test]
fn layouts_that_are_no_picture_are_refused() {
    let refused = |width, height, stride| {
        let layout = Layout {
            width,
            height,
            stride,
        };
        matches!(
            Z16Image::new(&[0; 64], layout),
            Err(FrameError::Layout { .. })
        )
    };
    assert!(refused(0, 2, 8) && refused(2, 0, 8) && refused(4, 2, 7));
    assert!(refused(u32::MAX, u32::MAX, u32::MAX) && refused(2, 2, u32::MAX));
    assert!(
        YuyvImage::new(&[0; 64], Layout::packed(3, 2)).is_err(),
        "half a pair"
    );
}

/// The 100 % colour bars of ITU-R BT.601 in studio range, as the standard's tables give them.
const BARS: [([u8; 3], [u8; 3]); 8] = [
    ([235, 128, 128], [255, 255, 255]),
    ([210, 16, 146], [255, 255, 0]),
    ([170, 166, 16], [0, 255, 255]),
    ([145, 54, 34], [0, 255, 0]),
    ([106, 202, 222], [255, 0, 255]),
    ([81, 90, 240], [255, 0, 0]),
    ([41, 240, 110], [0, 0, 255]),
    ([16, 128, 128], [0, 0, 0]),
];

#[test]
fn colour_bars_have_their_colours() {
    for ([y, u, v], rgb) in BARS {
        for (got, want) in rgb_of_yuv(y, u, v).iter().zip(rgb) {
            assert!(got.abs_diff(want) <= 1, "{y} {u} {v}: {got} for {want}");
        }
        assert_eq!(encode::yuv_of_rgb(rgb), [y, u, v]);
    }
    assert_eq!(
        rgb_of_yuv(255, 255, 255),
        [255, 125, 255],
        "beyond the range is cut"
    );
}

#[test]
fn two_pixels_share_their_colour_differences() {
    // Red and then black luma with red's differences; a padded second row of white.
    let bytes = [81, 90, 16, 240, 0, 0, 235, 128, 235, 128];
    let layout = Layout {
        width: 2,
        height: 2,
        stride: 6,
    };
    let mut rgb = [0; 12];
    YuyvImage::new(&bytes, layout)
        .unwrap()
        .to_rgb(&mut rgb)
        .unwrap();
    let red_on_black = rgb_of_yuv(16, 90, 240);
    assert_eq!(rgb[..3], rgb_of_yuv(81, 90, 240));
    assert_eq!(rgb[3..6], red_on_black);
    assert_eq!(rgb[6..], [255; 6]);
}

/// A depth stream's buffer by the offsets of the kernel's `metafmt-d4xx`, with the values that a
/// real D435 sent with its 169th frame.
fn real_metadata() -> Vec<u8> {
    let mut bytes = vec![0; 242];
    put(&mut bytes, 0, &123_456_789_000_u64.to_le_bytes());
    put(&mut bytes, 8, &77_u16.to_le_bytes());
    let header = &mut bytes[10..];
    // Its length; end of header, end of frame, device time, source clock.
    put(header, 0, &[232, 0x8E]);
    put(header, 2, &360_815_089_u32.to_le_bytes());
    for (at, value) in [
        (12, 0x8000_0001_u32),
        (16, 40),
        (20, 1),
        (24, 0b1011),
        (28, 169),
        (32, 360_811_863),
        (36, 1),
        (40, 6_452),
        (132, 0x8000_0000),
        (136, 60),
        (144, 0b1000_1111),
        (148, 16),
        (152, 6_452),
        (156, 150),
        (160, 1),
        (164, 1),
        (168, 80),
        (172, 560),
        (176, 60),
        (180, 420),
    ] {
        put(header, at, &value.to_le_bytes());
    }
    header[188] = 1;
    bytes
}

#[test]
fn metadata_of_a_real_frame() {
    let metadata = FrameMetadata::decode(&real_metadata()).unwrap();
    let expected = FrameMetadata {
        host_ns: 123_456_789_000,
        damaged: false,
        device_us: Some(360_815_089),
        timing: CaptureTiming {
            frame_counter: Some(169),
            sensor_us: Some(360_811_863),
            readout_us: None,
            exposure_us: Some(6_452),
            interval_us: None,
            latency_us: None,
        },
        depth: Some(DepthState {
            gain: Some(16),
            exposure_us: Some(6_452),
            laser_power_mw: Some(150),
            auto_exposure: Some(true),
            emitter: Some(1),
        }),
    };
    assert_eq!(metadata, expected);
    // The camera's own word for the middle of the exposure is half of it before the read-out.
    assert_eq!(metadata.exposed_us(), Some(360_811_863));
    let mut without = metadata;
    without.timing.sensor_us = None;
    assert_eq!(without.exposed_us(), Some(360_815_089 - 3_226));
}

#[test]
fn metadata_with_the_header_alone_still_tell_the_time() {
    let whole = real_metadata();
    let mut short = whole[..22].to_vec();
    short[10] = 12;
    let metadata = FrameMetadata::decode(&short).unwrap();
    assert_eq!(metadata.device_us, Some(360_815_089));
    assert_eq!(metadata.timing, CaptureTiming::default());
    assert_eq!(metadata.depth, None);
}

#[test]
fn damaged_metadata_are_refused_or_said() {
    let whole = real_metadata();
    assert_eq!(
        FrameMetadata::decode(&whole[..11]),
        Err(MetadataError::Short { got: 11 })
    );
    assert_eq!(
        FrameMetadata::decode(&whole[..100]),
        Err(MetadataError::HeaderLength {
            said: 232,
            room: 90
        })
    );
    let mut zero = whole.clone();
    zero[10] = 0;
    assert!(FrameMetadata::decode(&zero).is_err());
    let mut damaged = whole.clone();
    damaged[11] |= 0x40;
    assert!(FrameMetadata::decode(&damaged).unwrap().damaged);
    // Another kind of block where timing should be: no times are made of it.
    let mut other = whole;
    other[10 + 12] = 5;
    assert_eq!(
        FrameMetadata::decode(&other).unwrap().timing,
        CaptureTiming::default()
    );
}

#[test]
fn metadata_come_back_from_their_own_bytes() {
    let said = FrameMetadata::decode(&real_metadata()).unwrap();
    let (bytes, len) = encode::metadata(&said);
    assert_eq!(len, 242);
    assert_eq!(FrameMetadata::decode(&bytes[..len]), Ok(said));
}

#[test]
fn a_command_has_the_bytes_that_cameras_know() {
    let bytes = Command::calibration(25).encode();
    let head = [
        0x14, 0x00, 0xAB, 0xCD, 0x15, 0x00, 0x00, 0x00, 0x19, 0x00, 0x00, 0x00,
    ];
    assert_eq!(bytes[..12], head);
    assert!(bytes[12..].iter().all(|&byte| byte == 0));
    let unit = Command::DEPTH_TABLE.encode();
    assert_eq!(unit[4..12], [0x2C, 0, 0, 0, 9, 0, 0, 0]);
}

#[test]
fn an_answer_is_taken_for_what_it_is() {
    let command = Command::calibration(25);
    let mut answer = vec![0; 1024];
    put(&mut answer, 0, &0x15_u32.to_le_bytes());
    put(&mut answer, 4, &[1, 2, 3]);
    put(&mut answer, 1020, &3_u32.to_le_bytes());
    assert_eq!(command.answer(&answer), Ok(&[1, 2, 3][..]));
    put(&mut answer, 1020, &1_017_u32.to_le_bytes());
    let too_long = MonitorError::PayloadLength { length: 1_017 };
    assert_eq!(command.answer(&answer), Err(too_long));
    put(&mut answer, 0, &0x10_u32.to_le_bytes());
    let other = MonitorError::OtherCommand {
        expected: 0x15,
        got: 0x10,
    };
    assert_eq!(command.answer(&answer), Err(other));
    put(&mut answer, 0, &(-25_i32).to_le_bytes());
    let refused = command.answer(&answer).unwrap_err();
    assert!(
        refused.to_string().contains("the table is empty"),
        "{refused}"
    );
    assert_eq!(
        command.answer(&answer[..1_000]),
        Err(MonitorError::Length { got: 1_000 })
    );
}

#[test]
fn what_a_camera_says_of_itself() {
    let mut payload = vec![0; 256];
    put(&mut payload, 12, &[0, 14, 9, 5]);
    put(&mut payload, 48, &[0x72, 0x86, 0x12, 0x07, 0x02, 0x59]);
    let info = DeviceInfo::decode(&payload).unwrap();
    assert_eq!(info.firmware, [5, 9, 14, 0]);
    assert_eq!(&info.serial_digits(), b"728612070259");
    assert!(DeviceInfo::decode(&payload[..53]).is_err());
}

#[test]
fn the_depth_unit_is_in_micrometres() {
    let mut table = 1_000_u32.to_le_bytes().to_vec();
    table.extend([0; 16]);
    assert_eq!(depth_unit_m(&table), Ok(0.001));
    assert_eq!(depth_unit_m(&100_u32.to_le_bytes()), Ok(1e-4));
    let none = MonitorError::DepthUnit { micrometres: 0 };
    assert_eq!(depth_unit_m(&[0; 20]), Err(none));
    assert!(depth_unit_m(&[1, 2, 3]).is_err());
}

#[test]
fn settings_become_the_bytes_of_their_controls() {
    let settings = DepthSettings {
        exposure: Exposure::Fixed(33_000),
        emitter: Emitter::Off,
        laser_power_mw: Some(150),
    };
    let written: Vec<_> = settings
        .controls()
        .map(|(selector, value)| {
            let mut buffer = [0; 4];
            let bytes = controls::encode(selector, value, &mut buffer).unwrap();
            (selector.number(), bytes.to_vec())
        })
        .collect();
    let expected = [
        (0x0B, vec![0]),
        (3, vec![0xE8, 0x80, 0, 0]),
        (2, vec![0]),
        (4, vec![150, 0]),
    ];
    assert_eq!(written, expected);
    assert_eq!(
        controls::encode(Selector::LaserPower, 65_536, &mut [0; 4]),
        None
    );
    assert_eq!(controls::encode(Selector::Monitor, 1, &mut [0; 4]), None);
    assert_eq!(controls::decode(&[0x68, 0x01]), Some(360));
    assert_eq!(
        (Query::Current.number(), Query::Minimum.number()),
        (0x81, 0x82)
    );
}

/// Table 32 by its offsets, from a D455's printed intrinsics at 1280 x 800; the checksum is zlib's.
fn d455_color_table() -> Vec<u8> {
    let mut table = vec![0; 256];
    let intrinsic = [
        (0, 636.45 / 640.0),
        (4, 635.62 / 400.0),
        (2, 648.58 / 640.0 - 1.0),
        (5, 398.82 / 400.0 - 1.0),
        (8, 1.0),
    ];
    for (index, value) in intrinsic {
        put_f32(&mut table, 16 + 4 * index, value as f32);
    }
    let distortion = [-0.05698, 0.06602, 0.00021, 0.00069, -0.02085];
    for (index, value) in distortion.into_iter().enumerate() {
        put_f32(&mut table, 52 + 4 * index, value);
    }
    put(&mut table, 144, &1_280_u16.to_le_bytes());
    put(&mut table, 146, &800_u16.to_le_bytes());
    for index in [0, 4, 8] {
        put_f32(&mut table, 184 + 4 * index, 1.0);
    }
    for (index, value) in [-59.1, -0.1, 0.2].into_iter().enumerate() {
        put_f32(&mut table, 220 + 4 * index, value);
    }
    put(&mut table, 0, &[3, 3, 32, 0, 240, 0, 0, 0]);
    put(&mut table, 12, &0x2675_9DF5_u32.to_le_bytes());
    table
}

/// What the same unit prints for its other picture sizes: width, height, fx, fy, cx, cy.
const D455_PRINTED: [(u32, u32, [f64; 4]); 4] = [
    (1_280, 720, [636.45, 635.62, 648.58, 358.82]),
    (848, 480, [421.65, 421.10, 429.68, 239.22]),
    (640, 480, [381.87, 381.37, 325.15, 239.29]),
    (640, 360, [318.23, 317.81, 324.29, 179.41]),
];

#[track_caller]
fn assert_pin_hole(got: &Intrinsics, want: [f64; 4], tolerance: f64) {
    let have = [got.focal[0], got.focal[1], got.centre[0], got.centre[1]];
    for (have, want) in have.iter().zip(want) {
        assert!((have - want).abs() < tolerance, "{got:?} {want:?}");
    }
}

#[test]
fn a_real_units_colour_intrinsics_for_every_size_it_prints() {
    let calibration = ColorCalibration::decode(&d455_color_table()).unwrap();
    for (width, height, printed) in D455_PRINTED {
        let intrinsics = calibration.intrinsics(width, height).unwrap();
        assert_pin_hole(&intrinsics, printed, 0.01);
    }
    let translation = calibration.depth_from_color().translation.vector;
    assert!((translation.x - 0.0591).abs() < 1e-6, "{translation}");
    assert!((translation.z + 0.0002).abs() < 1e-6, "{translation}");
}

/// `rs2_deproject_pixel_to_point` of librealsense 2.59 at 2 m. It bends the tangential terms a second
/// time, which is worth a fiftieth of a pixel.
#[test]
fn rays_of_the_colour_camera_are_librealsenses() {
    let camera = Intrinsics {
        width: 1_280,
        height: 720,
        focal: [636.45, 635.62],
        centre: [648.58, 358.82],
        distortion: Distortion::BrownConrady([-0.05698, 0.06602, 0.00021, 0.00069, -0.02085]),
    };
    for (pixel, [x, y]) in [
        ([0.0, 0.0], [-2.059_187, -1.140_229]),
        ([1_279.0, 719.0], [1.992_320, 1.140_255]),
        ([100.0, 700.0], [-1.746_360, 1.086_168]),
        ([900.5, 20.25], [0.802_152, -1.080_512]),
    ] {
        let point = camera.deproject(pixel, 2.0);
        assert!(
            (point.x - x).abs() < 1e-4 && (point.y - y).abs() < 1e-4,
            "{point}"
        );
    }
}

/// Table 25 with three entries that are a camera's and one that is a placeholder.
fn depth_table() -> Vec<u8> {
    let mut table = vec![0; 576];
    put_f32(&mut table, 160, -94.96);
    for (index, entry) in [
        (0, [957.0, 956.0, 955.0, 532.0]),
        (3, [424.23, 424.23, 423.43, 236.05]),
        (2, [384.21, 384.21, 319.48, 236.35]),
        (4, [1.0, 1.0, 0.5, 0.5]),
    ] {
        for (i, value) in entry.into_iter().enumerate() {
            put_f32(&mut table, 256 + 16 * index + 4 * i, value);
        }
    }
    encode::seal(&mut table, 25);
    table
}

#[test]
fn depth_intrinsics_come_from_the_entry_of_their_size() {
    let calibration = DepthCalibration::decode(&depth_table()).unwrap();
    assert!((calibration.baseline_m() - 0.094_96).abs() < 1e-7);
    for (width, height, want) in [
        (848, 480, [424.23, 424.23, 423.43, 236.05]),
        (640, 480, [384.21, 384.21, 319.48, 236.35]),
        // Rows from the middle of 848 x 480, pixels from the middle of the full picture.
        (848, 100, [424.23, 424.23, 423.43, 46.05]),
        (256, 144, [957.0, 956.0, 123.0, 64.0]),
        // A placeholder is a nominal lens.
        (640, 360, [960.0, 960.0, 320.0, 180.0]),
        // No entry: scaled from the full picture.
        (960, 270, [478.5, 239.0, 477.5, 133.0]),
    ] {
        let intrinsics = calibration.intrinsics(width, height).unwrap();
        assert_pin_hole(&intrinsics, want, 1e-4);
        assert_eq!(intrinsics.distortion, Distortion::None);
    }
    // An entry of zeros is a camera that was never calibrated for this size.
    let empty = calibration.intrinsics(424, 240).unwrap_err();
    assert!(empty.to_string().contains("424 x 240"), "{empty}");
}

#[test]
fn a_damaged_table_is_never_believed() {
    let whole = d455_color_table();
    for at in [0, 20, 60, 100, 190, 255] {
        let mut damaged = whole.clone();
        damaged[at.max(16)] ^= 1;
        assert!(
            matches!(
                ColorCalibration::decode(&damaged),
                Err(CalibrationError::Checksum { table: 32, .. })
            ),
            "{at}"
        );
    }
    let other = DepthCalibration::decode(&whole).unwrap_err();
    assert_eq!(other, CalibrationError::Table { table: 25, got: 32 });
    for len in [0, 15, 16, 100, 255] {
        let short = ColorCalibration::decode(&whole[..len]);
        assert!(
            matches!(short, Err(CalibrationError::Length { .. })),
            "{len}"
        );
    }
    // Whole by its checksum, and still not a rotation.
    let mut bent = whole.clone();
    put_f32(&mut bent, 184, 2.0);
    encode::seal(&mut bent, 32);
    assert!(matches!(
        ColorCalibration::decode(&bent),
        Err(CalibrationError::Impossible {
            what: "extrinsics",
            ..
        })
    ));
    let mut blind = whole;
    put_f32(&mut blind, 16, f32::NAN);
    encode::seal(&mut blind, 32);
    let calibration = ColorCalibration::decode(&blind).unwrap();
    assert!(calibration.intrinsics(640, 480).is_err());
}
