//! `hachi top`: the live task table of a running service.

use std::io::{IsTerminal, Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::time::Duration;

use crate::cli::service::TopArguments;
use crate::exit::Failure;
use crate::interrupt::Cancelled;
use crate::service::web::Status;
use crate::{output, task_table};

const PATIENCE: Duration = Duration::from_secs(2);
/// From one table to the next, in tenths of a second.
const REFRESH_TENTHS: u32 = 10;
/// An answer is never longer: a table of 16 tasks has 10 kB.
const MOST_BYTES: u64 = 1 << 20;

/// Runs the command.
///
/// # Errors
/// No service answers there.
pub fn run(arguments: &TopArguments) -> Result<(), Failure> {
    if arguments.json {
        return output::json(&ask(arguments.address)?);
    }
    let live = std::io::stdout().is_terminal() && !arguments.once;
    if !live {
        return output::text(&task_table::text(&ask(arguments.address)?));
    }
    let cancelled = Cancelled::on_interrupt()?;
    while !cancelled.is_cancelled() {
        let status = ask(arguments.address)?;
        output::text(&task_table::on_screen(&status))?;
        for _ in 0..REFRESH_TENTHS {
            if cancelled.is_cancelled() {
                break;
            }
            std::thread::sleep(Duration::from_millis(100));
        }
    }
    Ok(())
}

/// What the service at an address says of itself.
///
/// # Errors
/// Nobody answers, or not a service of this version.
pub fn ask(address: SocketAddr) -> Result<Status, Failure> {
    let silent = |error: &dyn std::fmt::Display| {
        Failure::new(
            format_args!("no service answers at {address}: {error}"),
            "start `hachi run`, or give its service.listen with --address",
        )
    };
    let exchange = || -> std::io::Result<String> {
        let mut link = TcpStream::connect_timeout(&address, PATIENCE)?;
        link.set_read_timeout(Some(PATIENCE))?;
        link.set_write_timeout(Some(PATIENCE))?;
        link.write_all(b"GET /tasks HTTP/1.1\r\nHost: hachi\r\nConnection: close\r\n\r\n")?;
        let mut answer = String::new();
        link.take(MOST_BYTES).read_to_string(&mut answer)?;
        Ok(answer)
    };
    let answer = exchange().map_err(|error| silent(&error))?;
    let body = answer.split_once("\r\n\r\n").map(|(_, body)| body);
    serde_json::from_str(body.unwrap_or_default()).map_err(|error| silent(&error))
}
