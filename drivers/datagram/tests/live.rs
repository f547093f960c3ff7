//! Live sockets over the loopback interface.

use std::net::{IpAddr, Ipv4Addr, UdpSocket};
use std::time::{Duration, Instant};

use hachi_datagram::{SystemClock, UdpConfig, UdpError, UdpSource};
use hachi_hal::conformance::{check_packet_source, check_refuses_to_cut};
use hachi_hal::{Clock, DeviceError, FaultKind, PacketSource};

const LOOPBACK: IpAddr = IpAddr::V4(Ipv4Addr::LOCALHOST);

fn open(ports: usize) -> UdpSource {
    open_from(ports, None)
}

fn open_from(ports: usize, source_address: Option<IpAddr>) -> UdpSource {
    let config = UdpConfig {
        bind_address: LOOPBACK,
        source_address,
        ..UdpConfig::on_ports(&vec![0; ports])
    };
    UdpSource::open(&config, SystemClock::new()).unwrap()
}

fn sender() -> UdpSocket {
    UdpSocket::bind((LOOPBACK, 0)).unwrap()
}

#[test]
fn datagrams_of_both_ports_come_through_one_source_with_their_port_and_time() {
    let mut source = open(2);
    let ports = source.local_ports();
    let sender = sender();
    let before = source.clock().now();
    sender.send_to(&[1], (LOOPBACK, ports[0])).unwrap();
    sender.send_to(&[2, 2], (LOOPBACK, ports[1])).unwrap();
    let mut buffer = [0; 2048];
    let mut seen = Vec::new();
    for _ in 0..2 {
        let deadline = source.clock().now() + 1_000_000_000;
        let received = source.receive(&mut buffer, deadline).unwrap().unwrap();
        // The kernel's stamp and ours come from two clocks read microseconds apart.
        assert!(
            received.stamp.nanos_since(before) > -1_000_000,
            "{received:?}"
        );
        assert!(received.stamp <= source.clock().now());
        seen.push((received.port, buffer[..received.len].to_vec()));
    }
    seen.sort_by_key(|(_, bytes)| bytes.len());
    assert_eq!(seen, [(ports[0], vec![1]), (ports[1], vec![2, 2])]);
    assert_eq!(source.counters().without_kernel_stamp, 0);
}

#[test]
fn stamps_are_of_arrival_and_not_of_reading() {
    let mut source = open(1);
    let target = (LOOPBACK, source.local_ports()[0]);
    // Linux begins to stamp on arrival a moment after the first socket asks; until then it stamps
    // on reading.
    std::thread::sleep(Duration::from_millis(50));
    sender().send_to(&[1], target).unwrap();
    std::thread::sleep(Duration::from_millis(80));
    let now = source.clock().now();
    let received = source.receive(&mut [0; 4], now).unwrap().unwrap();
    let age_ms = source.clock().now().nanos_since(received.stamp) / 1_000_000;
    assert!((80..2_000).contains(&age_ms), "{age_ms} ms");
}

#[test]
fn who_is_spoken_to_from_a_source_can_answer_it() {
    let mut source = open_from(1, Some(LOOPBACK));
    let device = sender();
    device
        .set_read_timeout(Some(Duration::from_secs(5)))
        .unwrap();
    source.send(&[1, 2], device.local_addr().unwrap()).unwrap();
    let mut buffer = [0; 4];
    let (len, from) = device.recv_from(&mut buffer).unwrap();
    assert_eq!(
        (&buffer[..len], from.port()),
        (&[1, 2][..], source.local_ports()[0])
    );
    device.send_to(&[3], from).unwrap();
    let deadline = source.clock().now() + 5_000_000_000;
    let answer = source.receive(&mut buffer, deadline).unwrap().unwrap();
    assert_eq!(buffer[..answer.len], [3]);
}

#[test]
fn nothing_by_the_deadline_is_none_and_on_time() {
    let mut source = open(2);
    let begun = Instant::now();
    let deadline = source.clock().now() + 50_000_000;
    assert_eq!(source.receive(&mut [0; 4], deadline).unwrap(), None);
    let waited = begun.elapsed();
    assert!(waited >= Duration::from_millis(50), "{waited:?}");
    assert!(waited < Duration::from_millis(550), "{waited:?}");
    assert!(!source.at_end());
}

#[test]
fn strangers_are_counted_and_left_out() {
    let mut source = open_from(1, Some([127, 0, 0, 2].into()));
    let target = (LOOPBACK, source.local_ports()[0]);
    sender().send_to(&[1], target).unwrap();
    let friend = UdpSocket::bind("127.0.0.2:0").unwrap();
    friend.send_to(&[2], target).unwrap();
    let deadline = source.clock().now() + 1_000_000_000;
    let mut buffer = [0; 4];
    let received = source.receive(&mut buffer, deadline).unwrap().unwrap();
    assert_eq!(buffer[..received.len], [2]);
    assert_eq!(source.counters().foreign_sender, 1);
}

#[test]
fn the_source_keeps_its_promise() {
    let mut source = open(1);
    let target = (LOOPBACK, source.local_ports()[0]);
    let sender = sender();
    sender.send_to(&[1; 100], target).unwrap();
    sender.send_to(&[2; 3], target).unwrap();
    let clock = source.clock();
    let deadline = clock.now() + 1_000_000_000;
    let refused = check_refuses_to_cut(&mut source, &mut [0; 10], 100, deadline).unwrap();
    let refused = refused.unwrap();
    assert!(
        matches!(refused, UdpError::Oversize { len: 100, .. }),
        "{refused}"
    );
    assert_eq!(refused.kind(), FaultKind::ReadAgain);
    let tally = check_packet_source(&mut source, &clock, &mut [0; 10], 3, 20_000_000).unwrap();
    assert_eq!((tally.items, tally.contents, tally.nothing), (1, 3, 2));
}

#[test]
fn a_port_in_use_is_a_fault_of_the_configuration_that_names_it() {
    let first = open(1);
    let config = UdpConfig {
        bind_address: LOOPBACK,
        ..UdpConfig::on_ports(&first.local_ports())
    };
    let error = UdpSource::open(&config, SystemClock::new()).unwrap_err();
    assert_eq!(error.kind(), FaultKind::FixConfig);
    let port = first.local_ports()[0].to_string();
    assert!(error.to_string().contains(&port), "{error}");
    let none = UdpSource::open(&UdpConfig::on_ports(&[]), SystemClock::new()).unwrap_err();
    assert!(matches!(none, UdpError::Ports { got: 0 }));
}

#[test]
fn what_overflows_the_receive_buffer_is_counted() {
    let config = UdpConfig {
        bind_address: LOOPBACK,
        receive_buffer_bytes: 8 << 10,
        ..UdpConfig::on_ports(&[0])
    };
    let mut source = UdpSource::open(&config, SystemClock::new()).unwrap();
    assert!(source.granted_buffer_bytes() >= 8 << 10);
    let target = (LOOPBACK, source.local_ports()[0]);
    let sender = sender();
    let mut buffer = [0; 2048];
    let mut drain = |source: &mut UdpSource| {
        let mut count = 0;
        loop {
            let deadline = source.clock().now() + 50_000_000;
            match source.receive(&mut buffer, deadline).unwrap() {
                Some(_) => count += 1,
                None => return count,
            }
        }
    };
    for _ in 0..500 {
        sender.send_to(&[0; 1206], target).unwrap();
    }
    let arrived = drain(&mut source);
    // The kernel tells the count with the next datagram.
    sender.send_to(&[0; 1206], target).unwrap();
    assert_eq!(drain(&mut source), 1);
    let dropped = source.counters().kernel_drop;
    assert!(dropped > 0, "{arrived} arrived");
    assert_eq!(arrived + dropped, 500);
}
