//! The program: reads the command line, runs one command, turns its outcome into an exit status.
use std::process::ExitCode;

fn main() -> ExitCode {
    hachi::run(std::env::args_os())
}
