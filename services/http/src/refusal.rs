//! Why a request is not answered.

/// What is wrong with a request; each has a status and says what to do.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum Refusal {
    /// It is no HTTP.
    #[error("this is no HTTP/1 request ({0}): send one line, headers, an empty line")]
    Malformed(httparse::Error),
    /// It has more headers than anybody needs.
    #[error("it has more than {most} headers: send fewer")]
    ManyHeaders {
        /// How many there may be.
        most: usize,
    },
    /// It has more bytes than anybody needs.
    #[error("it has more than {most} bytes: send less")]
    TooLong {
        /// How many there may be.
        most: usize,
    },
    /// It came too slowly.
    #[error("it was not whole after {limit_ms} ms: send it at once")]
    Late {
        /// How long a request may take.
        limit_ms: u64,
    },
    /// The line was closed before it was whole.
    #[error("it ends too early: send all of it")]
    CutShort,
    /// Bytes follow that it did not announce.
    #[error("{0} bytes follow its end: send one request, with its Content-Length")]
    Trailing(usize),
    /// Nothing here is asked for in this way.
    #[error("only GET and POST are answered")]
    Method,
    /// A header stands there twice, so that two readers could take it for two things.
    #[error("{0} stands there twice: send it once")]
    Twice(&'static str),
    /// A header is no text.
    #[error("{0} is no ASCII text")]
    NotText(&'static str),
    /// It says how long it is in no way that is understood.
    #[error("the Content-Length is no number")]
    Length,
    /// It does not say how long it is.
    #[error("it does not say how long it is: send a Content-Length, nothing in pieces")]
    NoLength,
    /// It waits to be invited.
    #[error("nothing is answered before the whole request is there: send no Expect")]
    Expect,
    /// An order that is no JSON, which is what a web form could send.
    #[error("orders are JSON: send Content-Type: application/json")]
    ContentType,
    /// It is meant for another host: a web page whose name points here.
    #[error(
        "it is not addressed to this computer by itself: ask for 127.0.0.1, [::1] or localhost"
    )]
    Host,
    /// A web page of another place sent it.
    #[error("a web page from elsewhere sent it, and gives no orders here")]
    Origin,
}

impl Refusal {
    /// The status of the answer.
    pub fn status(&self) -> u16 {
        match self {
            Self::Malformed(_)
            | Self::CutShort
            | Self::Trailing(_)
            | Self::Twice(_)
            | Self::NotText(_)
            | Self::Length => 400,
            Self::Host | Self::Origin => 403,
            Self::Method => 405,
            Self::Late { .. } => 408,
            Self::NoLength => 411,
            Self::TooLong { .. } => 413,
            Self::ContentType => 415,
            Self::Expect => 417,
            Self::ManyHeaders { .. } => 431,
        }
    }
}
