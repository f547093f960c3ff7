//! HTTP/1 as far as a service on a robot needs it: one small request, one answer, and the line is closed.
//!
//! In: bytes of callers whom nobody trusts. Out: a [`Request`], or a [`Refusal`] with the status that
//! says why. Elsewhere: sockets and time limits, what a path means (`hachi`'s `service::web`), and the
//! syntax of HTTP itself (`httparse`).
//!
//! | module | holds |
//! |---|---|
//! | [`request`] | bytes to a request |
//! | [`guard`] | whether a request may give orders: not where a web page may have sent it |
//! | [`refusal`] | why there is no request, as a status |
//! | [`response`] | answers, both ways |

pub mod guard;
pub mod refusal;
pub mod request;
pub mod response;

pub use refusal::Refusal;
pub use request::{Method, Request};
pub use response::Response;
