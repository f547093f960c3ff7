//! A small decoder, written from the makers' manuals and nothing of this workspace, so that the
//! simulator's bytes are judged by something else than itself.

/// One channel of a data packet.
#[derive(Debug, Clone, Copy)]
pub struct Channel {
    pub x: f64,
    pub y: f64,
    pub z: f64,
    pub raw_distance: u16,
    pub intensity: u8,
    pub laser: usize,
    /// Seconds after the packet's first firing.
    pub time_s: f64,
}

const VLP16_ELEVATION: [f64; 16] = [
    -15., 1., -13., 3., -11., 5., -9., 7., -7., 9., -5., 11., -3., 13., -1., 15.,
];

/// The 384 channels of a VLP-16 packet, and its time stamp in µs past the hour.
pub fn vlp16(bytes: &[u8]) -> (Vec<Channel>, u32) {
    assert_eq!(bytes.len(), 1206);
    assert_eq!(bytes[1205], 0x22);
    let dual = bytes[1204] == 0x39;
    assert!(dual || bytes[1204] == 0x37);
    let azimuth = |block: usize| {
        let at = 100 * block;
        assert_eq!(bytes[at..at + 2], [0xff, 0xee]);
        f64::from(u16::from_le_bytes([bytes[at + 2], bytes[at + 3]])) / 100.0
    };
    let step = if dual { 2 } else { 1 };
    let mut channels = Vec::new();
    for block in 0..12 {
        let from = if block + step < 12 {
            block
        } else {
            block - step
        };
        let span = (azimuth(from + step) - azimuth(from)).rem_euclid(360.0);
        for channel in 0..32 {
            let laser = channel % 16;
            let within = 55.296 * (channel / 16) as f64 + 2.304 * laser as f64;
            let azimuth = (azimuth(block) + span * within / 110.592).to_radians();
            let elevation = VLP16_ELEVATION[laser].to_radians();
            let at = 100 * block + 4 + 3 * channel;
            let raw = u16::from_le_bytes([bytes[at], bytes[at + 1]]);
            let range = 0.002 * f64::from(raw);
            channels.push(Channel {
                x: range * elevation.cos() * azimuth.cos(),
                y: -range * elevation.cos() * azimuth.sin(),
                z: range * elevation.sin(),
                raw_distance: raw,
                intensity: bytes[at + 2],
                laser,
                time_s: 1e-6 * (110.592 * (block / step) as f64 + within),
            });
        }
    }
    let stamp = u32::from_le_bytes([bytes[1200], bytes[1201], bytes[1202], bytes[1203]]);
    (channels, stamp)
}

/// Vertical and horizontal angles of a Helios, degrees, from its DIFOP packet.
pub fn helios_angles(bytes: &[u8]) -> Vec<(f64, f64)> {
    assert_eq!(bytes.len(), 1248);
    assert_eq!(bytes[..8], [0xa5, 0xff, 0x00, 0x5a, 0x11, 0x11, 0x55, 0x55]);
    assert_eq!(bytes[1246..], [0x0f, 0xf0]);
    let angle = |at: usize| {
        let magnitude = f64::from(u16::from_be_bytes([bytes[at + 1], bytes[at + 2]])) / 100.0;
        match bytes[at] {
            0 => magnitude,
            1 => -magnitude,
            sign => panic!("sign {sign}"),
        }
    };
    (0..16)
        .map(|laser| (angle(468 + 3 * laser), angle(564 + 3 * laser)))
        .collect()
}

/// The 384 channels of a Helios MSOP packet, and its time stamp in µs.
pub fn helios(bytes: &[u8], angles: &[(f64, f64)]) -> (Vec<Channel>, u64) {
    assert_eq!(bytes.len(), 1248);
    assert_eq!(bytes[..4], [0x55, 0xaa, 0x05, 0x5a]);
    let mut channels = Vec::new();
    for block in 0..12 {
        let at = 42 + 100 * block;
        assert_eq!(bytes[at..at + 2], [0xff, 0xee]);
        let azimuth = f64::from(u16::from_be_bytes([bytes[at + 2], bytes[at + 3]])) / 100.0;
        for channel in 0..32 {
            let (vertical, horizontal) = angles[channel % 16];
            let within = 1.73 * channel as f64;
            let head = azimuth + 0.2 * within / 55.56;
            let (beam, head) = ((head + horizontal).to_radians(), head.to_radians());
            let (at, vertical) = (at + 4 + 3 * channel, vertical.to_radians());
            let raw = u16::from_be_bytes([bytes[at], bytes[at + 1]]);
            let range = 0.0025 * f64::from(raw);
            channels.push(Channel {
                x: range * vertical.cos() * beam.cos() + 0.03498 * head.cos(),
                y: -range * vertical.cos() * beam.sin() - 0.03498 * head.sin(),
                z: range * vertical.sin(),
                raw_distance: raw,
                intensity: bytes[at + 2],
                laser: channel % 16,
                time_s: 1e-6 * (55.56 * block as f64 + within),
            });
        }
    }
    let [mut seconds, mut micros] = [0u64; 2];
    for byte in &bytes[20..26] {
        seconds = seconds << 8 | u64::from(*byte);
    }
    for byte in &bytes[26..30] {
        micros = micros << 8 | u64::from(*byte);
    }
    (channels, seconds * 1_000_000 + micros)
}
