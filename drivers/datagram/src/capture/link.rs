//! From a link-layer frame to the UDP datagram in it.
//!
//! Ethernet with up to three tags, Linux cooked captures (both versions), raw IP, BSD loopback.
//! IP and UDP are `etherparse`'s; the cooked and loopback headers are a few fixed bytes, read here
//! (tcpdump.org link-layer header types).

use std::net::IpAddr;

use etherparse::{EtherType, IpNumber, Ipv6ExtensionSlice, LaxNetSlice, LaxSlicedPacket, UdpSlice};

use super::container::Frame;
use super::fragments::{Fragment, FragmentKey, FragmentPool};

const LINK_NULL: u32 = 0;
const LINK_ETHERNET: u32 = 1;
const LINK_RAW: [u32; 5] = [12, 14, 101, 228, 229];
const LINK_LOOP: u32 = 108;
const LINK_COOKED: u32 = 113;
const LINK_COOKED_2: u32 = 276;

/// Why a frame gives no datagram.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Ignored {
    UnsupportedLink,
    NotIp,
    NotUdp,
    CutBySnaplen,
    Truncated,
    Malformed,
    /// A fragment was put aside; nothing is missing yet.
    AwaitingFragments,
}

/// A UDP datagram.
pub(super) struct UdpDatagram<'a> {
    pub(super) sender: IpAddr,
    pub(super) port: u16,
    pub(super) payload: &'a [u8],
}

/// The datagram in `frame`, or completed by it.
pub(super) fn datagram<'a>(
    frame: &Frame<'a>,
    fragments: &'a mut FragmentPool,
) -> Result<UdpDatagram<'a>, Ignored> {
    // A frame that the capture program cut fails in many ways further down; all have that cause.
    let fail = |reason| match reason {
        Ignored::Truncated | Ignored::Malformed if frame.cut => Ignored::CutBySnaplen,
        reason => reason,
    };
    let packet = ip_packet(frame).map_err(fail)?;
    let ip = IpPart::of(&packet).map_err(fail)?;
    if ip.protocol != IpNumber::UDP {
        return Err(Ignored::NotUdp);
    }
    if ip.incomplete {
        return Err(fail(Ignored::Truncated));
    }
    let bytes = match ip.fragment {
        None => ip.bytes,
        Some((key, fragment)) => fragments
            .add(key, fragment, frame.stamp)
            .map_err(|_| fail(Ignored::Malformed))?
            .ok_or(Ignored::AwaitingFragments)?,
    };
    let udp = UdpSlice::from_slice_lax(bytes).map_err(|_| fail(Ignored::Truncated))?;
    let payload = udp.payload();
    // A length of 0 is allowed for datagrams too long for the field: then the frame tells.
    if usize::from(udp.length()) > payload.len() + 8 {
        return Err(fail(Ignored::Truncated));
    }
    Ok(UdpDatagram {
        sender: ip.sender,
        port: udp.destination_port(),
        payload,
    })
}

fn ip_packet<'a>(frame: &Frame<'a>) -> Result<LaxSlicedPacket<'a>, Ignored> {
    let bytes = frame.bytes;
    let from_type = |ether_type: Option<&[u8; 2]>, payload: Option<&'a [u8]>| {
        let (kind, payload) = ether_type.zip(payload).ok_or(Ignored::Truncated)?;
        let kind = EtherType(u16::from_be_bytes(*kind));
        Ok(LaxSlicedPacket::from_ether_type(kind, payload))
    };
    match frame.link {
        LINK_ETHERNET => LaxSlicedPacket::from_ethernet(bytes).map_err(|_| Ignored::Truncated),
        LINK_COOKED => from_type(
            bytes.get(14..).and_then(|rest| rest.first_chunk()),
            bytes.get(16..),
        ),
        LINK_COOKED_2 => from_type(bytes.first_chunk(), bytes.get(20..)),
        LINK_NULL | LINK_LOOP => {
            let family = bytes.first_chunk::<4>().ok_or(Ignored::Truncated)?;
            // In the byte order of the machine that captured; AF_INET is 2 everywhere, AF_INET6
            // differs by system.
            let family = u32::from_be_bytes(*family);
            match family.min(family.swap_bytes()) {
                2 | 10 | 24 | 28 | 30 => from_ip(&bytes[4..]),
                _ => Err(Ignored::NotIp),
            }
        }
        link if LINK_RAW.contains(&link) => from_ip(bytes),
        _ => Err(Ignored::UnsupportedLink),
    }
}

fn from_ip(bytes: &[u8]) -> Result<LaxSlicedPacket<'_>, Ignored> {
    LaxSlicedPacket::from_ip(bytes).map_err(|_| match bytes.first() {
        Some(first) if matches!(first >> 4, 4 | 6) => Ignored::Truncated,
        Some(_) => Ignored::NotIp,
        None => Ignored::Truncated,
    })
}

/// Whether `etherparse` steps over this extension header of IPv6.
fn steps_over(header: IpNumber) -> bool {
    matches!(
        header,
        IpNumber::IPV6_HEADER_HOP_BY_HOP
            | IpNumber::IPV6_ROUTE_HEADER
            | IpNumber::IPV6_FRAGMENTATION_HEADER
            | IpNumber::IPV6_DESTINATION_OPTIONS
            | IpNumber::AUTHENTICATION_HEADER
    )
}

/// What is needed of an IP packet.
struct IpPart<'a> {
    sender: IpAddr,
    protocol: IpNumber,
    bytes: &'a [u8],
    /// The packet is shorter than its header says.
    incomplete: bool,
    fragment: Option<(FragmentKey, Fragment<'a>)>,
}

impl<'a> IpPart<'a> {
    fn of(packet: &LaxSlicedPacket<'a>) -> Result<Self, Ignored> {
        match &packet.net {
            Some(LaxNetSlice::Ipv4(v4)) => {
                let (header, payload) = (v4.header(), v4.payload());
                let key = FragmentKey {
                    sender: header.source_addr().into(),
                    receiver: header.destination_addr().into(),
                    identification: u32::from(header.identification()),
                };
                let fragment = Fragment {
                    start: usize::from(header.fragments_offset().byte_offset()),
                    more: header.more_fragments(),
                    bytes: payload.payload,
                };
                Ok(Self {
                    sender: key.sender,
                    protocol: payload.ip_number,
                    bytes: payload.payload,
                    incomplete: payload.incomplete,
                    fragment: payload.fragmented.then_some((key, fragment)),
                })
            }
            Some(LaxNetSlice::Ipv6(v6)) => {
                let (header, payload) = (v6.header(), v6.payload());
                // `etherparse` stopped inside the extension headers. Its iterator over them takes
                // for granted that all of them were checked, and reads past the end of these.
                if steps_over(payload.ip_number) {
                    return Err(Ignored::Malformed);
                }
                let mut extensions = v6.extensions().clone().into_iter();
                let fragment = extensions.find_map(|extension| match extension {
                    Ipv6ExtensionSlice::Fragment(f) if f.is_fragmenting_payload() => Some((
                        FragmentKey {
                            sender: header.source_addr().into(),
                            receiver: header.destination_addr().into(),
                            identification: f.identification(),
                        },
                        Fragment {
                            start: usize::from(f.fragment_offset().byte_offset()),
                            more: f.more_fragments(),
                            bytes: payload.payload,
                        },
                    )),
                    _ => None,
                });
                Ok(Self {
                    sender: header.source_addr().into(),
                    protocol: payload.ip_number,
                    bytes: payload.payload,
                    incomplete: payload.incomplete,
                    fragment,
                })
            }
            Some(LaxNetSlice::Arp(_)) => Err(Ignored::NotIp),
            None if packet.stop_err.is_some() => Err(Ignored::Malformed),
            None => Err(Ignored::NotIp),
        }
    }
}
