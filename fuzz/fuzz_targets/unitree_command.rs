//! Any bytes as commands to a robot: refused, or contents that are sent again as they came, unless
//! a number in them is none, which is never sent.
#![no_main]

use hachi_unitree::frame::{CheckForm, HighCmd, Layout, LowCmd};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    let Some((&switches, bytes)) = data.split_first() else {
        return;
    };
    let layout = if switches & 1 == 0 {
        Layout::GO1
    } else {
        Layout::B1
    };
    if let Ok((command, form)) = HighCmd::decode(&layout, bytes) {
        match command.encode(&layout, form) {
            Ok(again) => assert_eq!(again.as_bytes(), bytes),
            Err(_) => assert!(command.check_finite().is_err()),
        }
    }
    if let Ok((command, _)) = LowCmd::decode(&layout, bytes)
        && let Ok((again, saturation)) = command.encode(&layout, CheckForm::Plain)
    {
        // What came in counts goes out in the same counts.
        assert!(!saturation.any());
        let (back, _) = LowCmd::decode(&layout, again.as_bytes()).unwrap();
        assert_eq!(back, command);
    }
});
