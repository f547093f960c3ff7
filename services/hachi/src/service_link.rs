//! A running service, as the commands ask it over HTTP.
//!
//! In: a path, an order. Out: what it answered, as a value; failures say what to do. Elsewhere: what it
//! answers ([`service::web`](crate::service::web)).

use std::fmt::Display;
use std::io::{Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::time::Duration;

use hachi_http::response;
use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::exit::Failure;
use crate::service::web::shapes::ErrorStatus;

/// Longer than any order is waited for.
const PATIENCE: Duration = Duration::from_secs(6);
/// An answer is never longer: a table of 16 tasks has 10 kB, a thousand people have 200 kB.
const MOST_BYTES: u64 = 1 << 20;

/// A service by its address.
#[derive(Debug, Clone, Copy)]
pub struct ServiceLink(pub SocketAddr);

impl ServiceLink {
    /// What the service tells at a path.
    ///
    /// # Errors
    /// Nobody answers, not a service of this version, or it says why not.
    pub fn get<T: DeserializeOwned>(self, path: &str) -> Result<T, Failure> {
        let Self(address) = self;
        self.ask(&format!(
            "GET {path} HTTP/1.1\r\nHost: {address}\r\nConnection: close\r\n\r\n"
        ))
    }

    /// What becomes of an order.
    ///
    /// # Errors
    /// As [`get`](Self::get).
    pub fn post<T: DeserializeOwned>(
        self,
        path: &str,
        order: &impl Serialize,
    ) -> Result<T, Failure> {
        let Self(address) = self;
        let body = serde_json::to_string(order).map_err(|error| self.silent(&error))?;
        self.ask(&format!(
            "POST {path} HTTP/1.1\r\nHost: {address}\r\nContent-Type: application/json\r\n\
             Content-Length: {}\r\nConnection: close\r\n\r\n{body}",
            body.len()
        ))
    }

    fn ask<T: DeserializeOwned>(self, request: &str) -> Result<T, Failure> {
        let Self(address) = self;
        let exchange = || -> std::io::Result<Vec<u8>> {
            let mut link = TcpStream::connect_timeout(&address, PATIENCE)?;
            link.set_read_timeout(Some(PATIENCE))?;
            link.set_write_timeout(Some(PATIENCE))?;
            link.write_all(request.as_bytes())?;
            let mut answer = Vec::new();
            link.take(MOST_BYTES).read_to_end(&mut answer)?;
            Ok(answer)
        };
        let answer = exchange().map_err(|error| self.silent(&error))?;
        let whole = response::parse(&answer);
        let (status, body) = whole.ok_or_else(|| self.silent(&"its answer is not whole"))?;
        if status >= 400
            && let Ok(refused) = serde_json::from_slice::<ErrorStatus>(body)
        {
            return Err(Failure::said(refused.error));
        }
        serde_json::from_slice(body).map_err(|error| self.silent(&error))
    }

    fn silent(self, error: &dyn Display) -> Failure {
        let Self(address) = self;
        Failure::new(
            format_args!("no service answers at {address}: {error}"),
            "start `hachi run`, or give its service.listen with --address",
        )
    }
}
