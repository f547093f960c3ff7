//! The VLP-16: when and where its lasers fire, and the bytes it sends.
//!
//! Numbers come from the maker's manual (63-9243): laser table, firing sequence, data packet and
//! position packet; each constant says what it is. Little-endian.

use crate::calendar::Utc;
use crate::returns::Report;
use crate::sensor::Firing;

/// Payload of a data packet, bytes.
pub(crate) const DATA_BYTES: usize = 1206;
/// Payload of a position packet, bytes.
pub(crate) const POSITION_BYTES: usize = 512;
/// UDP port of data packets.
pub(crate) const DATA_PORT: u16 = 2368;
/// UDP port of position packets.
pub(crate) const POSITION_PORT: u16 = 8308;
/// Data packets to one position packet.
pub(crate) const DATA_PER_POSITION: u64 = 14;
/// From one firing of 16 lasers to the next, ns.
pub(crate) const SEQUENCE_NS: i64 = 55_296;
/// From one laser to the next, ns.
const LASER_NS: i64 = 2_304;
/// Distance unit, metres.
pub(crate) const DISTANCE_UNIT_M: f64 = 0.002;

/// Elevation of each laser in firing order, degrees.
pub(crate) const ELEVATION_DEG: [f64; 16] = [
    -15.0, 1.0, -13.0, 3.0, -11.0, 5.0, -9.0, 7.0, -7.0, 9.0, -5.0, 11.0, -3.0, 13.0, -1.0, 15.0,
];

/// When laser `laser` of sequence `sequence` of a packet fires, ns after the packet's first.
pub(crate) fn firing(sequence: usize, laser: usize) -> Firing {
    Firing {
        offset_ns: SEQUENCE_NS * sequence as i64 + LASER_NS * laser as i64,
        elevation_rad: ELEVATION_DEG[laser].to_radians(),
        azimuth_offset_rad: 0.0,
    }
}

/// Writes a data packet. `azimuths` are those of the 12 blocks (0.01 degree), `reports` their 32
/// channels each.
pub(crate) fn encode_data(
    bytes: &mut [u8; DATA_BYTES],
    azimuths: &[u16; 12],
    reports: &[Report; 384],
    micros_past_hour: u32,
    dual: bool,
) {
    for (block, azimuth) in azimuths.iter().enumerate() {
        let at = 100 * block;
        bytes[at..at + 2].copy_from_slice(&[0xff, 0xee]);
        bytes[at + 2..at + 4].copy_from_slice(&azimuth.to_le_bytes());
        for channel in 0..32 {
            let report = &reports[32 * block + channel];
            let at = at + 4 + 3 * channel;
            bytes[at..at + 2].copy_from_slice(&report.distance.to_le_bytes());
            bytes[at + 2] = report.intensity;
        }
    }
    bytes[1200..1204].copy_from_slice(&micros_past_hour.to_le_bytes());
    bytes[1204] = if dual { 0x39 } else { 0x37 };
    bytes[1205] = 0x22; // VLP-16
}

/// Writes a position packet of a sensor locked to GPS time.
pub(crate) fn encode_position(bytes: &mut [u8; POSITION_BYTES], utc: &Utc) {
    bytes.fill(0);
    bytes[198..202].copy_from_slice(&utc.micros_past_hour().to_le_bytes());
    bytes[202] = 2; // PPS locked
    let sentence = utc.gprmc();
    let text = sentence.as_bytes();
    bytes[206..206 + text.len()].copy_from_slice(text);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_firing_of_a_packet_is_where_the_manual_puts_it() {
        // Block 11, channel 31: 55.296 * 23 + 2.304 * 15 = 1306.368 us.
        assert_eq!(firing(23, 15).offset_ns, 1_306_368);
    }

    #[test]
    fn a_data_packet_has_its_fields_at_the_manuals_offsets() {
        let mut reports = [Report::default(); 384];
        reports[32 + 17] = Report {
            distance: 0x1234,
            intensity: 0x56,
        };
        let mut azimuths = [0; 12];
        azimuths[1] = 35_999;
        let mut bytes = [0; DATA_BYTES];
        encode_data(&mut bytes, &azimuths, &reports, 0x0102_0304, false);
        assert_eq!(bytes[0..4], [0xff, 0xee, 0, 0]);
        assert_eq!(bytes[100..104], [0xff, 0xee, 0x9f, 0x8c]);
        assert_eq!(bytes[155..158], [0x34, 0x12, 0x56]);
        assert_eq!(bytes[1200..], [4, 3, 2, 1, 0x37, 0x22]);
    }
}
