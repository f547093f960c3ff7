//! Any bytes as a data base of places, or as one place: read, written and read again, and asked.
#![no_main]

use hachi_place::{Database, Descriptor};

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    if let Ok(descriptor) = Descriptor::from_bytes(bytes) {
        assert_eq!(descriptor.to_bytes(), bytes);
        let mut database = Database::default();
        let mut matches = Vec::new();
        database
            .insert(7, &descriptor)
            .expect("the first decides the layout");
        database
            .query(std::slice::from_ref(&descriptor), |_| true, 3, &mut matches)
            .expect("one layout");
        assert!(
            matches
                .iter()
                .all(|m| m.similarity.is_finite() && m.yaw_rad.is_finite())
        );
    }
    let Ok(mut database) = Database::from_bytes(bytes) else {
        return;
    };
    let written = database.to_bytes();
    let again = Database::from_bytes(&written).expect("what was written can be read");
    assert_eq!(again.to_bytes(), written);
    // Any place of the usual layout: taken up, or refused because the data base has another.
    let place = Descriptor::default();
    let mut matches = Vec::new();
    let _ = database.query(std::slice::from_ref(&place), |_| true, 3, &mut matches);
    let _ = database.insert(u64::MAX, &place);
});
