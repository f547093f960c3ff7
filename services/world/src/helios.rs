//! The RS-Helios-16P: when and where its lasers fire, and the bytes it sends.
//!
//! Numbers come from the maker's manual and driver, and from a recording of a real sensor: 600
//! rpm, strongest return, two firings of 16 lasers in a block of 55.56 µs, 150 packets a turn, the
//! calibration angles below. Big-endian.

use crate::calendar::Utc;
use crate::returns::Report;
use crate::sensor::Firing;

/// Payload of both kinds of packet, bytes.
pub(crate) const BYTES: usize = 1248;
/// UDP port of MSOP packets (points).
pub(crate) const MSOP_PORT: u16 = 6699;
/// UDP port of DIFOP packets (device and calibration).
pub(crate) const DIFOP_PORT: u16 = 7788;
/// Duration of a block, ns.
pub(crate) const BLOCK_NS: i64 = 55_560;
/// From one channel of a block to the next, ns.
const CHANNEL_NS: i64 = 1_730;
/// MSOP packets to one DIFOP packet: about one a second.
pub(crate) const MSOP_PER_DIFOP: u64 = 1_500;
/// Distance unit, metres.
pub(crate) const DISTANCE_UNIT_M: f64 = 0.002_5;
/// The beams leave the lens this far from the axis, in the direction the head points, metres.
pub(crate) const LENS_M: f64 = 0.034_98;

/// Elevation of each laser, 0.01 degree.
pub(crate) const ELEVATION: [i16; 16] = [
    1494, 1303, 1092, 890, 696, 546, 398, 267, 133, 0, -133, -267, -396, -523, -663, -801,
];
/// Azimuth of each laser relative to the head, 0.01 degree.
pub(crate) const AZIMUTH: [i16; 16] = [
    -405, 361, -400, 358, -397, 356, -396, 355, -395, 355, -395, 355, -396, 356, -397, 357,
];

/// When a channel (0 to 31) of a block (0 to 11) fires, ns after the packet's first.
pub(crate) fn firing(block: usize, channel: usize) -> Firing {
    let laser = channel % 16;
    Firing {
        offset_ns: BLOCK_NS * block as i64 + CHANNEL_NS * channel as i64,
        elevation_rad: (f64::from(ELEVATION[laser]) / 100.0).to_radians(),
        azimuth_offset_rad: (f64::from(AZIMUTH[laser]) / 100.0).to_radians(),
    }
}

fn put<const N: usize>(bytes: &mut [u8], at: usize, field: [u8; N]) {
    bytes[at..at + N].copy_from_slice(&field);
}

fn put_time(bytes: &mut [u8], at: usize, utc: &Utc) {
    let [_, _, seconds @ ..] = utc.seconds.to_be_bytes();
    put(bytes, at, seconds);
    put(bytes, at + 6, utc.micros.to_be_bytes());
}

/// Writes an MSOP packet, the `counter`-th since power-on, in strongest-return mode.
pub(crate) fn encode_msop(
    bytes: &mut [u8; BYTES],
    azimuths: &[u16; 12],
    reports: &[Report; 384],
    utc: &Utc,
    counter: u32,
) {
    bytes.fill(0);
    put(bytes, 0, [0x55, 0xaa, 0x05, 0x5a, 0x00, 0x01]);
    put(bytes, 8, counter.wrapping_mul(3).to_be_bytes());
    put(bytes, 12, counter.to_be_bytes());
    put(bytes, 17, [1]); // range resolution 0.25 cm
    put_time(bytes, 20, utc);
    put(bytes, 31, [0x06, 0x03]); // Helios, 16P
    for (block, azimuth) in azimuths.iter().enumerate() {
        let at = 42 + 100 * block;
        put(bytes, at, [0xff, 0xee]);
        put(bytes, at + 2, azimuth.to_be_bytes());
        for channel in 0..32 {
            let report = &reports[32 * block + channel];
            let at = at + 4 + 3 * channel;
            put(bytes, at, report.distance.to_be_bytes());
            bytes[at + 2] = report.intensity;
        }
    }
    put(bytes, 1246, [0x00, 0xff]);
}

/// Writes a DIFOP packet: settings, time and the calibration angles.
pub(crate) fn encode_difop(bytes: &mut [u8; BYTES], utc: &Utc) {
    bytes.fill(0);
    put(bytes, 0, [0xa5, 0xff, 0x00, 0x5a, 0x11, 0x11, 0x55, 0x55]);
    put(bytes, 8, 600_u16.to_be_bytes());
    put(bytes, 10, [192, 168, 1, 200]);
    put(bytes, 14, [192, 168, 1, 102]);
    for (at, port) in [
        (24, MSOP_PORT),
        (26, MSOP_PORT),
        (28, DIFOP_PORT),
        (30, DIFOP_PORT),
    ] {
        put(bytes, at, port.to_be_bytes());
    }
    put(bytes, 34, 36_000_u16.to_be_bytes()); // field of view: 0 to 360 degrees
    put(bytes, 300, [0x04]); // strongest return
    put(bytes, 302, [1]); // synchronised by GPS
    put_time(bytes, 303, utc);
    put(bytes, 352, 600_u16.to_be_bytes()); // measured speed
    for (table, angles) in [(468, &ELEVATION), (564, &AZIMUTH)] {
        // Entries of lasers that this model lacks are marked as not calibrated.
        bytes[table..table + 96].fill(0xff);
        for (laser, angle) in angles.iter().enumerate() {
            let at = table + 3 * laser;
            bytes[at] = u8::from(*angle < 0);
            put(bytes, at + 1, angle.unsigned_abs().to_be_bytes());
        }
    }
    put(bytes, 1246, [0x0f, 0xf0]);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn calibration_angles_are_sign_and_magnitude() {
        let mut bytes = [0; BYTES];
        encode_difop(&mut bytes, &Utc::from_nanos(1_700_000_000_000_000_000));
        assert_eq!(bytes[468..471], [0x00, 0x05, 0xd6]); // +14.94
        assert_eq!(bytes[564..567], [0x01, 0x01, 0x95]); // -4.05
        assert_eq!(bytes[300], 4);
    }

    #[test]
    fn an_msop_packet_has_its_fields_at_the_manuals_offsets() {
        let mut reports = [Report::default(); 384];
        reports[383] = Report {
            distance: 0x0fa0,
            intensity: 7,
        };
        let mut bytes = [0; BYTES];
        let utc = Utc::from_nanos(0x0102_0304 * 1_000_000_000 + 5_000);
        encode_msop(&mut bytes, &[36; 12], &reports, &utc, 9);
        assert_eq!(bytes[..6], [0x55, 0xaa, 5, 0x5a, 0, 1]);
        assert_eq!(bytes[12..16], [0, 0, 0, 9]);
        assert_eq!(bytes[20..30], [0, 0, 1, 2, 3, 4, 0, 0, 0, 5]);
        assert_eq!(bytes[42..46], [0xff, 0xee, 0, 36]);
        assert_eq!(bytes[1239..1242], [0x0f, 0xa0, 7]);
    }
}
