//! Numeric order of file names: `scan_2` before `scan_10`.

use std::cmp::Ordering;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};

use hachi_hal::Stamp;

/// Sorts paths by their names, runs of digits as numbers, everything else as text.
pub(crate) fn sort_naturally(paths: &mut [PathBuf]) {
    paths.sort_by(|a, b| compare(&name(a), &name(b)).then_with(|| a.cmp(b)));
}

fn name(path: &Path) -> std::borrow::Cow<'_, str> {
    path.file_stem().unwrap_or(OsStr::new("")).to_string_lossy()
}

fn compare(a: &str, b: &str) -> Ordering {
    let (mut a, mut b) = (a.as_bytes(), b.as_bytes());
    loop {
        let (Some(&first_a), Some(&first_b)) = (a.first(), b.first()) else {
            return a.len().cmp(&b.len());
        };
        let order;
        if first_a.is_ascii_digit() && first_b.is_ascii_digit() {
            let (number_a, rest_a) = leading_number(a);
            let (number_b, rest_b) = leading_number(b);
            // Without leading zeros, the longer number is the larger.
            order = number_a
                .len()
                .cmp(&number_b.len())
                .then_with(|| number_a.cmp(number_b));
            (a, b) = (rest_a, rest_b);
        } else {
            order = first_a.cmp(&first_b);
            (a, b) = (&a[1..], &b[1..]);
        }
        if order.is_ne() {
            return order;
        }
    }
}

/// The digits in front, without leading zeros, and what follows them.
fn leading_number(text: &[u8]) -> (&[u8], &[u8]) {
    let digits = text.iter().take_while(|byte| byte.is_ascii_digit()).count();
    let zeros = text[..digits].iter().take_while(|&&b| b == b'0').count();
    (&text[zeros..digits], &text[digits..])
}

/// The stamp that a name of nineteen digits is: UNIX nanoseconds, as exporters of ROS clouds name
/// their files.
pub(crate) fn stamp_of(path: &Path) -> Option<Stamp> {
    const DIGITS: usize = 19;
    let name = path.file_stem()?.to_str()?;
    let is_stamp = name.len() == DIGITS && name.bytes().all(|byte| byte.is_ascii_digit());
    is_stamp.then(|| name.parse().ok().map(Stamp::from_nanos))?
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_ordered_by_their_numbers() {
        let mut names = [
            "scan_10.pcd",
            "scan_9.pcd",
            "b2.pcd",
            "b.pcd",
            "0002.pcd",
            "1.pcd",
            "10.pcd",
            "99999999999999999999.pcd",
            "100000000000000000000.pcd",
        ]
        .map(PathBuf::from);
        sort_naturally(&mut names);
        let sorted = [
            "1.pcd",
            "0002.pcd",
            "10.pcd",
            "99999999999999999999.pcd",
            "100000000000000000000.pcd",
            "b.pcd",
            "b2.pcd",
            "scan_9.pcd",
            "scan_10.pcd",
        ]
        .map(PathBuf::from);
        assert_eq!(names, sorted);
    }

    #[test]
    fn only_nineteen_digits_are_a_stamp() {
        let stamp = |name: &str| stamp_of(Path::new(name)).map(Stamp::as_nanos);
        assert_eq!(
            stamp("1673400472138016708.pcd"),
            Some(1_673_400_472_138_016_708)
        );
        assert_eq!(stamp("000001.pcd"), None);
        assert_eq!(stamp("9999999999999999999.pcd"), None);
        assert_eq!(stamp("167340047213801670a.pcd"), None);
    }
}
