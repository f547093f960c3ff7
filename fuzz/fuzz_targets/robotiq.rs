//! Any bytes on a gripper's line: answers and requests are refused or read, and the driver goes on.
#![no_main]

use std::cell::Cell;
use std::time::Duration;

use hachi_hal::{Clock, Gripper, GripperCommand, Stamp};
use hachi_robotiq::Robotiq;
use hachi_robotiq::device::{Line, LineError, RobotiqConfig};
use hachi_robotiq::frame::{Command, Request, State, checksum};
use hachi_robotiq::serve;
use libfuzzer_sys::fuzz_target;

/// A clock that moves with each look, so that waiting ends.
struct Ticking(Cell<i64>);

impl Clock for Ticking {
    fn now(&self) -> Stamp {
        self.0.set(self.0.get() + 10_000_000);
        Stamp::from_nanos(self.0.get())
    }
}

/// Gives the fuzzer's bytes, in pieces that they say the length of.
struct Noise<'a>(&'a [u8]);

impl Line for Noise<'_> {
    fn send(&mut self, _: &[u8]) -> Result<(), LineError> {
        Ok(())
    }
    fn receive(&mut self, buffer: &mut [u8], limit: Duration) -> Result<usize, LineError> {
        // Between frames the line is silent: what comes there is thrown away anyway.
        if limit.is_zero() {
            return Ok(0);
        }
        let Some((&len, rest)) = self.0.split_first() else {
            return Ok(0);
        };
        let len = usize::from(len % 16).min(rest.len()).min(buffer.len());
        buffer[..len].copy_from_slice(&rest[..len]);
        self.0 = &rest[len..];
        Ok(len)
    }
}

fn decode(bytes: &[u8]) {
    let mut sealed = bytes.to_vec();
    sealed.extend(checksum(bytes).to_le_bytes());
    for bytes in [bytes, &sealed] {
        for request in [Request::Read, Request::Write(Command::default())] {
            let _ = (request.answer_len(bytes), request.answer(9, bytes));
        }
        let address = bytes.first().copied().unwrap_or(0);
        if let Some(asked) = serve::request(address, bytes, Command::default()) {
            let answer = serve::answer(address, asked, &State::default());
            let (body, sum) = answer.split_last_chunk::<2>().unwrap();
            assert_eq!(checksum(body).to_le_bytes(), *sum);
        }
    }
}

fuzz_target!(|data: &[u8]| {
    decode(data);
    // Each request waits for the silence before it: short runs, and not every time.
    let Some((0x80.., noise)) = data.split_first() else {
        return;
    };
    let noise = Noise(&noise[..noise.len().min(64)]);
    let mut gripper = Robotiq::new(noise, Ticking(Cell::new(0)), RobotiqConfig::default());
    let _ = gripper.activate();
    for _ in 0..2 {
        let sample = gripper.read_gripper(Stamp::from_nanos(i64::MAX));
        if let Ok(Some(sample)) = sample {
            assert!((0.0..=gripper.stroke_m()).contains(&sample.opening_m));
        }
    }
    let _ = gripper.command(&GripperCommand {
        opening_m: 0.02,
        speed_m_s: 0.1,
        force_n: 40.0,
    });
});
