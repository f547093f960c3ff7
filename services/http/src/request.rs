//! A request, from bytes that may be anything.
//!
//! In: what came so far. Out: the request once it is whole, nothing while it may become one, a
//! [`Refusal`] once it can't. Numbers of it are bounded: [`MOST_BYTES`], [`MOST_HEADERS`].

use crate::Refusal;

/// Bytes of a request, its head and its body together.
pub const MOST_BYTES: usize = 4096;
/// Headers of a request: browsers send about fifteen.
pub const MOST_HEADERS: usize = 48;

/// What a request wants.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Method {
    /// To be told something.
    Get,
    /// To change something.
    Post,
}

/// A whole request.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Request<'a> {
    /// What it wants.
    pub method: Method,
    /// Of what, with a query if it has one.
    pub path: &'a str,
    /// Whom it is addressed to, as the caller calls them.
    pub host: Option<&'a str>,
    /// The web page that sent it, as a browser says.
    pub origin: Option<&'a str>,
    /// What its body is.
    pub content_type: Option<&'a str>,
    /// Its body.
    pub body: &'a [u8],
}

/// The request that these bytes are; `None` while more may follow.
///
/// # Errors
/// It will never be one that is answered, whatever follows.
pub fn parse(bytes: &[u8]) -> Result<Option<Request<'_>>, Refusal> {
    if bytes.len() > MOST_BYTES {
        return Err(Refusal::TooLong { most: MOST_BYTES });
    }
    let mut headers = [httparse::EMPTY_HEADER; MOST_HEADERS];
    let mut head = httparse::Request::new(&mut headers);
    let length = match head.parse(bytes) {
        Ok(httparse::Status::Complete(length)) => length,
        // One that is full and not whole has a head that is too long.
        Ok(httparse::Status::Partial) if bytes.len() == MOST_BYTES => {
            return Err(Refusal::TooLong { most: MOST_BYTES });
        }
        Ok(httparse::Status::Partial) => return Ok(None),
        Err(httparse::Error::TooManyHeaders) => {
            return Err(Refusal::ManyHeaders { most: MOST_HEADERS });
        }
        Err(error) => return Err(Refusal::Malformed(error)),
    };
    let method = match head.method {
        Some("GET") => Method::Get,
        Some("POST") => Method::Post,
        _ => return Err(Refusal::Method),
    };
    let named = |name: &'static str| only(head.headers, name);
    if named("Transfer-Encoding")?.is_some() {
        return Err(Refusal::NoLength);
    }
    if named("Expect")?.is_some() {
        return Err(Refusal::Expect);
    }
    let announced = match (named("Content-Length")?, method) {
        (Some(digits), _) => number(digits).ok_or(Refusal::Length)?,
        (None, Method::Get) => 0,
        (None, Method::Post) => return Err(Refusal::NoLength),
    };
    let end = length.checked_add(announced);
    let end = end.filter(|end| *end <= MOST_BYTES);
    let end = end.ok_or(Refusal::TooLong { most: MOST_BYTES })?;
    let Some(body) = bytes.get(length..end) else {
        return Ok(None);
    };
    if bytes.len() > end {
        return Err(Refusal::Trailing(bytes.len() - end));
    }
    Ok(Some(Request {
        method,
        path: head.path.unwrap_or_default(),
        host: named("Host")?,
        origin: named("Origin")?,
        content_type: named("Content-Type")?,
        body,
    }))
}

/// The value of a header that may stand there once.
fn only<'a>(
    headers: &[httparse::Header<'a>],
    name: &'static str,
) -> Result<Option<&'a str>, Refusal> {
    let mut named = headers
        .iter()
        .filter(|header| header.name.eq_ignore_ascii_case(name));
    let Some(header) = named.next() else {
        return Ok(None);
    };
    if named.next().is_some() {
        return Err(Refusal::Twice(name));
    }
    match str::from_utf8(header.value) {
        Ok(value) if value.is_ascii() => Ok(Some(value.trim())),
        _ => Err(Refusal::NotText(name)),
    }
}

/// A length: digits alone, no sign.
fn number(digits: &str) -> Option<usize> {
    let all = !digits.is_empty() && digits.bytes().all(|digit| digit.is_ascii_digit());
    // More digits than a usize has are no length either.
    all.then(|| digits.parse().unwrap_or(usize::MAX))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// As `curl -d` sends it.
    const ORDER: &[u8] = b"POST /people/pick HTTP/1.1\r\nHost: 127.0.0.1:9470\r\n\
        User-Agent: curl/8.5.0\r\nAccept: */*\r\nContent-Type: application/json\r\n\
        Content-Length: 11\r\n\r\n{\"track\":3}";

    fn refused(text: &str) -> Refusal {
        parse(text.as_bytes()).unwrap_err()
    }

    #[test]
    fn an_order_is_read_as_it_was_sent() {
        let expected = Request {
            method: Method::Post,
            path: "/people/pick",
            host: Some("127.0.0.1:9470"),
            origin: None,
            content_type: Some("application/json"),
            body: b"{\"track\":3}",
        };
        assert_eq!(parse(ORDER), Ok(Some(expected)));
    }

    #[test]
    fn whatever_is_missing_is_waited_for() {
        for length in 0..ORDER.len() {
            assert_eq!(parse(&ORDER[..length]), Ok(None), "{length}");
        }
        let more = [ORDER, b"GET"].concat();
        assert_eq!(parse(&more), Err(Refusal::Trailing(3)));
    }

    #[test]
    fn each_mistake_has_its_status() {
        let long = format!("GET /{} HTTP/1.1\r\n\r\n", "a".repeat(5000));
        let headers = "A: b\r\n".repeat(MOST_HEADERS + 1);
        let cases = [
            ("\u{1}\r\n\r\n".to_owned(), 400),
            ("GET / HTTP/2.7\r\n\r\n".to_owned(), 400),
            ("DELETE /people HTTP/1.1\r\n\r\n".to_owned(), 405),
            (long, 413),
            (format!("GET / HTTP/1.1\r\n{headers}\r\n"), 431),
            ("POST / HTTP/1.1\r\n\r\n".to_owned(), 411),
            (
                "POST / HTTP/1.1\r\nTransfer-Encoding: chunked\r\n\r\n".to_owned(),
                411,
            ),
            (
                "POST / HTTP/1.1\r\nContent-Length: 4096\r\n\r\n".to_owned(),
                413,
            ),
            (
                format!("POST / HTTP/1.1\r\nContent-Length: 1{:030}\r\n\r\n", 0),
                413,
            ),
            (
                "POST / HTTP/1.1\r\nContent-Length: -1\r\n\r\n".to_owned(),
                400,
            ),
            (
                "POST / HTTP/1.1\r\nContent-Length: 1\r\nContent-length: 2\r\n\r\n".to_owned(),
                400,
            ),
            (
                "GET / HTTP/1.1\r\nHost: a\r\nHost: b\r\n\r\n".to_owned(),
                400,
            ),
            ("GET / HTTP/1.1\r\nHost: \u{e4}\r\n\r\n".to_owned(), 400),
            (
                "POST / HTTP/1.1\r\nExpect: 100-continue\r\nContent-Length: 1\r\n\r\n".to_owned(),
                417,
            ),
        ];
        for (text, status) in cases {
            let refusal = refused(&text);
            assert_eq!(refusal.status(), status, "{refusal}: {text:.60}");
        }
    }

    proptest! {
        #[test]
        fn any_bytes_are_a_request_or_refused_or_may_become_one(
            bytes in proptest::collection::vec(any::<u8>(), 0..5000),
        ) {
            if let Ok(Some(request)) = parse(&bytes) {
                prop_assert!(request.body.len() <= MOST_BYTES);
            }
        }
    }
}
