//! Any bytes as an HTTP request, and as an answer.
#![no_main]

use hachi_http::request::{MOST_BYTES, parse};
use hachi_http::{Method, guard, response};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    let _ = response::parse(bytes);
    match parse(bytes) {
        Ok(Some(request)) => {
            assert!(bytes.len() <= MOST_BYTES && bytes.ends_with(request.body));
            // Whole already: more bytes are another request, and one byte fewer is none yet, unless the
            // missing one is an end of line that may be left out.
            let more = [bytes, b"x"].concat();
            assert!(parse(&more).is_err());
            if !request.body.is_empty() {
                assert_eq!(parse(&bytes[..bytes.len() - 1]), Ok(None));
            }
            if guard::check(&request).is_ok() {
                assert!(request.host.is_some());
                let kind = request
                    .content_type
                    .unwrap_or_default()
                    .to_ascii_lowercase();
                assert!(request.method == Method::Get || kind.starts_with("application/json"));
            }
        }
        Ok(None) => assert!(bytes.len() < MOST_BYTES || bytes.is_empty()),
        Err(refusal) => assert!((400..500).contains(&refusal.status())),
    }
});
