//! The system calls below [`super::UdpSource`]: a socket that gives the kernel's receive stamp and
//! drop count with each datagram.
//!
//! `std` and `socket2` receive without control messages, and the stamp and the drop count come in
//! no other way; so `recvmsg` and `ppoll` are called here directly. This is the only module of the
//! crate with `unsafe`.
#![allow(unsafe_code)]

use std::io;
use std::mem::{self, MaybeUninit};
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr, UdpSocket};
use std::os::fd::AsRawFd;
use std::time::Duration;

use socket2::{Domain, Protocol, Type};

use super::UdpError;

/// One datagram as the kernel hands it over.
pub(super) struct Datagram {
    /// Its real length, also where the buffer was shorter.
    pub(super) len: usize,
    pub(super) sender: Option<IpAddr>,
    /// When the kernel took it in, UNIX time.
    pub(super) unix_ns: Option<i64>,
    /// Datagrams that the kernel dropped since the last one, for want of buffer.
    pub(super) newly_dropped: u32,
}

#[derive(Debug)]
pub(super) struct Socket {
    inner: UdpSocket,
    pub(super) port: u16,
    pub(super) granted_bytes: usize,
    /// The kernel's running drop count, as last seen.
    dropped: u32,
}

impl Socket {
    pub(super) fn bind(address: SocketAddr, buffer_bytes: usize) -> Result<Self, UdpError> {
        let failed = |source| UdpError::Bind { address, source };
        let socket = socket2::Socket::new(
            Domain::for_address(address),
            Type::DGRAM,
            Some(Protocol::UDP),
        )
        .map_err(failed)?;
        // The kernel cuts what it does not grant, so a refusal here is only a smaller buffer. The
        // forced variant goes past the system's limit where the program has the right.
        let wanted = libc::c_int::try_from(buffer_bytes).unwrap_or(libc::c_int::MAX);
        if set_option(&socket, libc::SO_RCVBUFFORCE, wanted).is_err() {
            let _ = set_option(&socket, libc::SO_RCVBUF, wanted);
        }
        socket.set_nonblocking(true).map_err(failed)?;
        socket.bind(&address.into()).map_err(failed)?;
        let granted_bytes = socket.recv_buffer_size().unwrap_or(0);
        let inner = UdpSocket::from(socket);
        let port = inner.local_addr().map_err(failed)?.port();
        for (name, option) in [
            ("SO_TIMESTAMPNS", libc::SO_TIMESTAMPNS),
            ("SO_RXQ_OVFL", libc::SO_RXQ_OVFL),
        ] {
            set_option(&inner, option, 1).map_err(|source| UdpError::Option {
                option: name,
                port,
                source,
            })?;
        }
        Ok(Self {
            inner,
            port,
            granted_bytes,
            dropped: 0,
        })
    }

    pub(super) fn poll_entry(&self) -> libc::pollfd {
        libc::pollfd {
            fd: self.inner.as_raw_fd(),
            events: libc::POLLIN,
            revents: 0,
        }
    }

    pub(super) fn send(&self, payload: &[u8], to: SocketAddr) -> Result<(), UdpError> {
        loop {
            // A datagram goes whole or not at all.
            match self.inner.send_to(payload, to) {
                Ok(_) => return Ok(()),
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                Err(source) => return Err(UdpError::Send { to, source }),
            }
        }
    }

    /// The next datagram if one is there. What does not fit in `buffer` is cut off; `len` tells.
    pub(super) fn receive(&mut self, buffer: &mut [u8]) -> Result<Option<Datagram>, UdpError> {
        loop {
            match receive_message(self.inner.as_raw_fd(), buffer) {
                Ok((mut datagram, dropped)) => {
                    // The count is the socket's total and wraps with its 32 bits.
                    datagram.newly_dropped = dropped.map_or(0, |total| {
                        let new = total.wrapping_sub(self.dropped);
                        self.dropped = total;
                        new
                    });
                    return Ok(Some(datagram));
                }
                Err(error) => match error.kind() {
                    io::ErrorKind::WouldBlock => return Ok(None),
                    io::ErrorKind::Interrupted => {}
                    _ => {
                        return Err(UdpError::Receive {
                            port: self.port,
                            source: error,
                        });
                    }
                },
            }
        }
    }
}

/// Waits until one of the sockets has something, or for `limit`. Being woken early is no error.
pub(super) fn wait(sockets: &mut [libc::pollfd], limit: Duration) -> Result<(), UdpError> {
    // An hour at a time: `time_t` has 32 bits on some of the boards this runs on.
    let limit = limit.min(Duration::from_secs(3_600));
    let timeout = libc::timespec {
        tv_sec: limit.as_secs() as libc::time_t,
        tv_nsec: limit.subsec_nanos() as libc::c_long,
    };
    // SAFETY: `sockets` is a slice of initialised `pollfd`s whose length is passed with it, the
    // timeout outlives the call, and a null signal mask leaves the mask as it is.
    let ready = unsafe {
        libc::ppoll(
            sockets.as_mut_ptr(),
            sockets.len() as libc::nfds_t,
            &timeout,
            std::ptr::null(),
        )
    };
    if ready >= 0 {
        return Ok(());
    }
    match io::Error::last_os_error() {
        error if error.kind() == io::ErrorKind::Interrupted => Ok(()),
        source => Err(UdpError::Wait { source }),
    }
}

fn set_option(socket: &impl AsRawFd, option: libc::c_int, value: libc::c_int) -> io::Result<()> {
    // SAFETY: the pointer and length describe `value`, which outlives the call; the kernel only
    // reads it.
    let result = unsafe {
        libc::setsockopt(
            socket.as_raw_fd(),
            libc::SOL_SOCKET,
            option,
            (&raw const value).cast(),
            size_of_val(&value) as libc::socklen_t,
        )
    };
    if result == 0 {
        Ok(())
    } else {
        Err(io::Error::last_os_error())
    }
}

/// Room for the control messages asked for (a `timespec` and a `u32`, each with its header) with
/// as much again to spare, aligned as `cmsghdr` needs it.
#[repr(C, align(8))]
struct ControlBuffer([u8; 128]);

/// One `recvmsg` without blocking: the datagram and the socket's drop count, if it was sent along.
fn receive_message(fd: libc::c_int, buffer: &mut [u8]) -> io::Result<(Datagram, Option<u32>)> {
    let mut sender = MaybeUninit::<libc::sockaddr_storage>::zeroed();
    let mut control = ControlBuffer([0; 128]);
    let mut part = libc::iovec {
        iov_base: buffer.as_mut_ptr().cast(),
        iov_len: buffer.len(),
    };
    // SAFETY: `msghdr` is plain data for which all zeroes is a valid value.
    let mut message: libc::msghdr = unsafe { mem::zeroed() };
    message.msg_name = sender.as_mut_ptr().cast();
    message.msg_namelen = size_of::<libc::sockaddr_storage>() as libc::socklen_t;
    message.msg_iov = &raw mut part;
    message.msg_iovlen = 1;
    message.msg_control = control.0.as_mut_ptr().cast();
    message.msg_controllen = control.0.len() as _;
    // MSG_TRUNC makes the result the datagram's real length.
    let flags = libc::MSG_DONTWAIT | libc::MSG_TRUNC;
    // SAFETY: every pointer in `message` is to a live local or to `buffer`, each with its length,
    // and none is kept by the kernel after the call.
    let len = unsafe { libc::recvmsg(fd, &raw mut message, flags) };
    let len = usize::try_from(len).map_err(|_| io::Error::last_os_error())?;
    // SAFETY: the storage was zeroed, which is a valid value, and written only by the kernel.
    let sender = sender_address(unsafe { sender.assume_init_ref() });
    let mut datagram = Datagram {
        len,
        sender,
        unix_ns: None,
        newly_dropped: 0,
    };
    let mut dropped = None;
    for (kind, data) in control_messages(&message) {
        match kind {
            libc::SCM_TIMESTAMPNS => datagram.unix_ns = timespec_ns(data),
            libc::SO_RXQ_OVFL => dropped = data.first_chunk().map(|b| u32::from_ne_bytes(*b)),
            _ => {}
        }
    }
    Ok((datagram, dropped))
}

/// Kind and data of each control message of the socket level.
fn control_messages(message: &libc::msghdr) -> impl Iterator<Item = (libc::c_int, &[u8])> {
    // SAFETY: `message` was filled by a successful `recvmsg`, so its control pointer and length
    // describe well-formed messages in a buffer that lives as long as the borrow.
    let mut next = unsafe { libc::CMSG_FIRSTHDR(message) };
    std::iter::from_fn(move || {
        while !next.is_null() {
            let current = next;
            // SAFETY: `current` is a header that the CMSG macros found within the control buffer,
            // which they also bound the next one by; its data follows it, as long as its length
            // says less the header.
            let (level, kind, data) = unsafe {
                next = libc::CMSG_NXTHDR(message, current);
                let header_len = libc::CMSG_LEN(0) as usize;
                let data_len = ((*current).cmsg_len as usize).saturating_sub(header_len);
                let data = std::slice::from_raw_parts(libc::CMSG_DATA(current), data_len);
                ((*current).cmsg_level, (*current).cmsg_type, data)
            };
            if level == libc::SOL_SOCKET {
                return Some((kind, data));
            }
        }
        None
    })
}

/// Seconds and nanoseconds, each a C `long` of the platform, as UNIX nanoseconds.
fn timespec_ns(data: &[u8]) -> Option<i64> {
    const WORD: usize = size_of::<libc::c_long>();
    let word = |at: usize| {
        let bytes = data.get(at * WORD..(at + 1) * WORD)?;
        Some(libc::c_long::from_ne_bytes(bytes.try_into().ok()?))
    };
    #[allow(
        clippy::useless_conversion,
        reason = "`long` has 32 bits on some boards"
    )]
    let (seconds, nanos) = (i64::from(word(0)?), i64::from(word(1)?));
    seconds.checked_mul(1_000_000_000)?.checked_add(nanos)
}

fn sender_address(storage: &libc::sockaddr_storage) -> Option<IpAddr> {
    match libc::c_int::from(storage.ss_family) {
        libc::AF_INET => {
            // SAFETY: the family says that the storage, which is larger and at least as aligned,
            // holds a `sockaddr_in`.
            let v4 = unsafe { &*(&raw const *storage).cast::<libc::sockaddr_in>() };
            Some(Ipv4Addr::from(u32::from_be(v4.sin_addr.s_addr)).into())
        }
        libc::AF_INET6 => {
            // SAFETY: as above, for `sockaddr_in6`.
            let v6 = unsafe { &*(&raw const *storage).cast::<libc::sockaddr_in6>() };
            Some(IpAddr::V6(Ipv6Addr::from(v6.sin6_addr.s6_addr)).to_canonical())
        }
        _ => None,
    }
}
