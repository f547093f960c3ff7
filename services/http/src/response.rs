//! Answers: as bytes, and from bytes.

/// Headers of an answer that is read: ours has six.
const MOST_HEADERS: usize = 32;

/// An answer.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Response {
    /// What came of the request.
    pub status: u16,
    /// What the body is.
    pub content_type: &'static str,
    /// The body.
    pub body: String,
}

impl Response {
    /// A JSON answer.
    pub fn json(status: u16, body: String) -> Self {
        Self {
            status,
            content_type: "application/json",
            body,
        }
    }

    /// Lines of text.
    pub fn text(status: u16, body: impl Into<String>) -> Self {
        Self {
            status,
            content_type: "text/plain",
            body: body.into(),
        }
    }

    /// All of it as it goes over the line, which is closed after it. What it says of a moment is kept by
    /// nobody on the way.
    pub fn to_bytes(&self) -> Vec<u8> {
        let Self {
            status,
            content_type,
            body,
        } = self;
        format!(
            "HTTP/1.1 {status} {}\r\nContent-Type: {content_type}\r\nContent-Length: {}\r\n\
             Cache-Control: no-store\r\nX-Content-Type-Options: nosniff\r\nConnection: close\r\n\r\n\
             {body}",
            reason(*status),
            body.len()
        )
        .into_bytes()
    }
}

/// The words for a status (RFC 9110, section 15).
fn reason(status: u16) -> &'static str {
    match status {
        200 => "OK",
        202 => "Accepted",
        400 => "Bad Request",
        403 => "Forbidden",
        404 => "Not Found",
        405 => "Method Not Allowed",
        408 => "Request Timeout",
        409 => "Conflict",
        411 => "Length Required",
        413 => "Content Too Large",
        415 => "Unsupported Media Type",
        417 => "Expectation Failed",
        422 => "Unprocessable Content",
        429 => "Too Many Requests",
        431 => "Request Header Fields Too Large",
        503 => "Service Unavailable",
        _ => "Internal Server Error",
    }
}

/// Status and body of an answer, read to the end of the line; `None` if it is none, or not whole.
pub fn parse(bytes: &[u8]) -> Option<(u16, &[u8])> {
    let mut headers = [httparse::EMPTY_HEADER; MOST_HEADERS];
    let mut head = httparse::Response::new(&mut headers);
    let httparse::Status::Complete(length) = head.parse(bytes).ok()? else {
        return None;
    };
    let announced = head
        .headers
        .iter()
        .find(|header| header.name.eq_ignore_ascii_case("Content-Length"))?;
    let announced: usize = str::from_utf8(announced.value).ok()?.parse().ok()?;
    let body = bytes.get(length..length.checked_add(announced)?)?;
    Some((head.code?, body))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_answer_is_read_as_it_was_written_and_one_cut_short_is_none() {
        let answer = Response::json(409, "{\"error\":\"nobody\"}".to_owned()).to_bytes();
        assert!(answer.starts_with(b"HTTP/1.1 409 Conflict\r\n"));
        assert_eq!(parse(&answer), Some((409, &b"{\"error\":\"nobody\"}"[..])));
        for length in 0..answer.len() {
            assert_eq!(parse(&answer[..length]), None);
        }
    }
}
