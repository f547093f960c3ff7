//! Injects each fault of `docs/safety.md` that the gate answers for into a robot at full speed, as the
//! tests do, and prints how long it took until the velocity was zero:
//! `cargo run -p hachi-behaviour --example stop_times`.
#![allow(clippy::print_stdout, reason = "this is what it is for")]

#[path = "../tests/walk/mod.rs"]
mod walk;

use walk::faults::{FAULTS, measure_ms};
use walk::page::{STATED, row, time};

fn main() {
    println!("| fault | stated | measured |\n|---|---|---|");
    let mut last = None;
    for fault in FAULTS {
        if last.replace(fault.row) != Some(fault.row) {
            let page = row(fault.row);
            println!(
                "| {} | {} | {} |",
                page[0],
                page[STATED],
                time(measure_ms(fault.row))
            );
        }
    }
}
