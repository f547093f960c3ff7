//! Whether a caller on this computer is a program that means this service, and no web page in the
//! operator's browser.
//!
//! A page from anywhere may have a browser send requests to loopback. It can't choose their headers: a
//! form is sent as text or form data, a script's JSON is asked about first (a preflight, which is
//! refused), a browser says in `Origin` whose page it is, and a name that is pointed here to get around
//! that (DNS rebinding) stands in `Host`. After the Fetch standard (whatwg.org).

use std::net::IpAddr;

use crate::{Method, Refusal, Request};

/// Refuses what a web page from elsewhere may have sent; of orders also what is not said to be JSON.
///
/// # Errors
/// Which of the three headers is not as it has to be.
pub fn check(request: &Request<'_>) -> Result<(), Refusal> {
    let host = request.host.ok_or(Refusal::Host)?;
    if !is_this_computer(host) {
        return Err(Refusal::Host);
    }
    if let Some(origin) = request.origin {
        let own = origin
            .strip_prefix("http://")
            .is_some_and(|place| place.eq_ignore_ascii_case(host));
        if !own {
            return Err(Refusal::Origin);
        }
    }
    match request.method {
        Method::Get => Ok(()),
        Method::Post => is_json(request.content_type)
            .then_some(())
            .ok_or(Refusal::ContentType),
    }
}

/// Whether a `Host` is a loopback address or `localhost`, with a port or without.
fn is_this_computer(host: &str) -> bool {
    let (name, port) = match host.strip_prefix('[') {
        Some(rest) => match rest.split_once(']') {
            Some((address, after)) => (address, after.strip_prefix(':').or(Some(after))),
            None => return false,
        },
        None => match host.split_once(':') {
            Some((name, port)) => (name, Some(port)),
            None => (host, None),
        },
    };
    let port = port.unwrap_or_default();
    let is_port = port.is_empty() || port.parse::<u16>().is_ok();
    let loopback = |address: IpAddr| address.is_loopback();
    is_port && (name.eq_ignore_ascii_case("localhost") || name.parse().is_ok_and(loopback))
}

/// `application/json`, with parameters or without.
fn is_json(content_type: Option<&str>) -> bool {
    let kind = content_type.and_then(|text| text.split(';').next());
    kind.is_some_and(|kind| kind.trim().eq_ignore_ascii_case("application/json"))
}

#[cfg(test)]
mod tests {
    use super::*;

    const ORDER: Request<'static> = Request {
        method: Method::Post,
        path: "/people/release",
        host: Some("127.0.0.1:9470"),
        origin: None,
        content_type: Some("application/json"),
        body: b"{}",
    };

    fn with(change: impl Fn(&mut Request<'static>)) -> Result<(), Refusal> {
        let mut request = ORDER;
        change(&mut request);
        check(&request)
    }

    #[test]
    fn programs_and_the_service_s_own_page_pass() {
        assert_eq!(check(&ORDER), Ok(()));
        for host in [
            "localhost",
            "LOCALHOST:80",
            "[::1]:9470",
            "[::1]",
            "127.8.8.8",
        ] {
            assert_eq!(with(|r| r.host = Some(host)), Ok(()), "{host}");
        }
        assert_eq!(with(|r| r.origin = Some("http://127.0.0.1:9470")), Ok(()));
        let kind = "Application/JSON; charset=utf-8";
        assert_eq!(with(|r| r.content_type = Some(kind)), Ok(()));
    }

    #[test]
    fn what_a_foreign_page_can_send_does_not() {
        for host in [
            None,
            Some("evil.example"),
            Some("localhost.evil.example"),
            Some("127.0.0.1.evil.example:9470"),
            Some("127.0.0.1:evil"),
            Some("192.168.123.10:9470"),
            Some("[::1"),
            Some("[fe80::1]:9470"),
            Some(""),
        ] {
            assert_eq!(with(|r| r.host = host), Err(Refusal::Host), "{host:?}");
        }
        for origin in [
            "http://evil.example",
            "null",
            "https://127.0.0.1:9470",
            "http://127.0.0.1:8080",
            "http://localhost:9470",
        ] {
            let refused = with(|r| r.origin = Some(origin));
            assert_eq!(refused, Err(Refusal::Origin), "{origin}");
        }
        for kind in [
            None,
            Some("text/plain"),
            Some("application/x-www-form-urlencoded"),
            Some("text/plain; application/json"),
        ] {
            let refused = with(|r| r.content_type = kind);
            assert_eq!(refused, Err(Refusal::ContentType), "{kind:?}");
        }
    }
}
