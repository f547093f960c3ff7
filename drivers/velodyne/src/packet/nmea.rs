//! The two NMEA 0183 sentences that time receivers send: RMC (time, date, place, speed) and GGA
//! (time, place, height).
//!
//! In: one sentence, `$` to checksum, with or without its line end. Out: its fields in SI units and
//! degrees. Any talker is taken (`GP`, `GN`, ...). An empty field is `None`.

use hachi_hal::Stamp;

/// Why a sentence was not understood.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum NmeaError {
    /// No `$` at the start.
    #[error("a sentence starts with '$', this one with {got:#04x}")]
    Start {
        /// The first byte (0 for an empty sentence).
        got: u8,
    },
    /// No `*hh` at the end.
    #[error("no checksum within {len} bytes")]
    NoChecksum {
        /// Bytes of the sentence.
        len: usize,
    },
    /// The checksum does not fit.
    #[error("checksum is {computed:#04x}, the sentence says {stated:#04x}")]
    Checksum {
        /// Exclusive or of the bytes between `$` and `*`.
        computed: u8,
        /// What stands after `*`.
        stated: u8,
    },
    /// A sentence other than RMC and GGA.
    #[error("neither RMC nor GGA")]
    Kind,
    /// A field that cannot be read.
    #[error("field {index} cannot be read")]
    Field {
        /// Its index, the sentence's name being 0.
        index: usize,
    },
}

/// A time of day, as RMC and GGA carry it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TimeOfDay {
    /// Hours, 0 to 23.
    pub hour: u8,
    /// Minutes, 0 to 59.
    pub minute: u8,
    /// Seconds, 0 to 60 (a leap second).
    pub second: u8,
    /// Nanoseconds of the second.
    pub nanos: u32,
}

/// A calendar date, UTC.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Date {
    /// Year; the sentence's two digits are of this century.
    pub year: u16,
    /// Month, 1 to 12.
    pub month: u8,
    /// Day, 1 to 31.
    pub day: u8,
}

/// A place on the ellipsoid.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Place {
    /// Degrees, north positive.
    pub latitude_deg: f64,
    /// Degrees, east positive.
    pub longitude_deg: f64,
}

/// A sentence that was understood.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Sentence {
    /// Recommended minimum data.
    Rmc {
        /// UTC.
        time: Option<TimeOfDay>,
        /// Whether the receiver vouches for the data (`A`).
        valid: bool,
        /// Where.
        place: Option<Place>,
        /// Over ground, m/s.
        speed_m_s: Option<f64>,
        /// Over ground, degrees from north, clockwise.
        course_deg: Option<f64>,
        /// UTC.
        date: Option<Date>,
    },
    /// Fix data.
    Gga {
        /// UTC.
        time: Option<TimeOfDay>,
        /// Where.
        place: Option<Place>,
        /// 0 none, 1 GPS, 2 differential, 4 and 5 real-time kinematic.
        quality: u8,
        /// Satellites used.
        satellites: Option<u8>,
        /// Above mean sea level, metres.
        altitude_m: Option<f64>,
    },
}

/// Metres per second in a knot: 1852 m an hour.
const KNOT_M_S: f64 = 1852.0 / 3600.0;

impl Sentence {
    /// Reads one sentence; what follows its checksum is ignored.
    pub fn parse(text: &[u8]) -> Result<Self, NmeaError> {
        let body = checked_body(text)?;
        let fields = Fields(body);
        let name = fields.get(0);
        match name.len().checked_sub(3).map(|at| &name[at..]) {
            Some(b"RMC") => Ok(Self::Rmc {
                time: fields.read(1, time_of_day)?,
                valid: fields.get(2) == b"A",
                place: fields.place(3)?,
                speed_m_s: fields.read(7, decimal)?.map(|knots| knots * KNOT_M_S),
                course_deg: fields.read(8, decimal)?,
                date: fields.read(9, date)?,
            }),
            Some(b"GGA") => Ok(Self::Gga {
                time: fields.read(1, time_of_day)?,
                place: fields.place(2)?,
                quality: fields.read(6, small_number)?.unwrap_or(0),
                satellites: fields.read(7, small_number)?,
                altitude_m: fields.read(9, decimal)?,
            }),
            _ => Err(NmeaError::Kind),
        }
    }

    /// Whether the receiver has a fix and vouches for it.
    pub fn has_fix(&self) -> bool {
        match self {
            Self::Rmc { valid, .. } => *valid,
            Self::Gga { quality, .. } => *quality > 0,
        }
    }

    /// The UNIX time of the sentence, where it has a date and a time.
    pub fn unix_time(&self) -> Option<Stamp> {
        let Self::Rmc {
            time: Some(time),
            date: Some(date),
            ..
        } = self
        else {
            return None;
        };
        let day_s =
            i64::from(time.hour) * 3_600 + i64::from(time.minute) * 60 + i64::from(time.second);
        Stamp::from_secs_nanos(days_since_1970(date) * 86_400 + day_s, time.nanos)
    }
}

/// What stands between `$` and `*`, after its checksum was found right.
fn checked_body(text: &[u8]) -> Result<&[u8], NmeaError> {
    let got = text.first().copied().unwrap_or(0);
    if got != b'$' {
        return Err(NmeaError::Start { got });
    }
    let no_checksum = NmeaError::NoChecksum { len: text.len() };
    let star = text.iter().position(|&b| b == b'*').ok_or(no_checksum)?;
    let stated = match text.get(star + 1..star + 3) {
        Some(&[high, low]) => hex(high)
            .zip(hex(low))
            .map(|(high, low)| high << 4 | low)
            .ok_or(no_checksum)?,
        _ => return Err(no_checksum),
    };
    let body = &text[1..star];
    let computed = body.iter().fold(0, |sum, byte| sum ^ byte);
    if computed == stated {
        Ok(body)
    } else {
        Err(NmeaError::Checksum { computed, stated })
    }
}

fn hex(digit: u8) -> Option<u8> {
    char::from(digit).to_digit(16).map(|value| value as u8)
}

/// The comma-separated fields of a sentence.
struct Fields<'a>(&'a [u8]);

impl<'a> Fields<'a> {
    /// A field, empty if the sentence has not so many.
    fn get(&self, index: usize) -> &'a [u8] {
        self.0.split(|&b| b == b',').nth(index).unwrap_or(&[])
    }

    /// Reads a field; `None` if it is empty.
    fn read<T>(&self, index: usize, read: fn(&[u8]) -> Option<T>) -> Result<Option<T>, NmeaError> {
        match self.get(index) {
            [] => Ok(None),
            field => read(field).map(Some).ok_or(NmeaError::Field { index }),
        }
    }

    /// Latitude, hemisphere, longitude, hemisphere from field `at` on.
    fn place(&self, at: usize) -> Result<Option<Place>, NmeaError> {
        let latitude = self.read(at, degrees_minutes)?;
        let longitude = self.read(at + 2, degrees_minutes)?;
        let (Some(latitude), Some(longitude)) = (latitude, longitude) else {
            return Ok(None);
        };
        let signed = |index: usize, value: f64, positive: u8, negative: u8| match self.get(index) {
            [letter] if *letter == positive => Ok(value),
            [letter] if *letter == negative => Ok(-value),
            _ => Err(NmeaError::Field { index }),
        };
        if latitude > 90.0 {
            return Err(NmeaError::Field { index: at });
        }
        if longitude > 180.0 {
            return Err(NmeaError::Field { index: at + 2 });
        }
        Ok(Some(Place {
            latitude_deg: signed(at + 1, latitude, b'N', b'S')?,
            longitude_deg: signed(at + 3, longitude, b'E', b'W')?,
        }))
    }
}

fn digits(field: &[u8]) -> Option<u32> {
    (!field.is_empty() && field.len() <= 9).then_some(())?;
    field.iter().try_fold(0, |value, byte| {
        byte.is_ascii_digit()
            .then(|| value * 10 + u32::from(byte - b'0'))
    })
}

fn small_number(field: &[u8]) -> Option<u8> {
    digits(field)?.try_into().ok()
}

/// Decimal digits with an optional sign and point.
fn decimal(field: &[u8]) -> Option<f64> {
    let plain = field
        .iter()
        .all(|b| b.is_ascii_digit() || matches!(b, b'.' | b'-' | b'+'));
    core::str::from_utf8(field)
        .ok()
        .filter(|_| plain)?
        .parse()
        .ok()
        .filter(|value: &f64| value.is_finite())
}

/// `dddmm.mmmm`: whole degrees, then minutes.
fn degrees_minutes(field: &[u8]) -> Option<f64> {
    let value = decimal(field).filter(|value| *value >= 0.0)?;
    let degrees = libm::floor(value / 100.0);
    let minutes = value - degrees * 100.0;
    (minutes < 60.0).then_some(degrees + minutes / 60.0)
}

/// `hhmmss` and an optional fraction.
fn time_of_day(field: &[u8]) -> Option<TimeOfDay> {
    let two = |at: usize| small_number(field.get(at..at + 2)?);
    let time = TimeOfDay {
        hour: two(0)?,
        minute: two(2)?,
        second: two(4)?,
        nanos: match field.get(6..)? {
            [] | [b'.'] => 0,
            [b'.', fraction @ ..] => {
                // Nanoseconds are nine digits; further ones are below what a receiver knows.
                let kept = &fraction[..fraction.len().min(9)];
                digits(kept)? * 10_u32.pow(9 - kept.len() as u32)
            }
            _ => return None,
        },
    };
    (time.hour < 24 && time.minute < 60 && time.second <= 60).then_some(time)
}

/// `ddmmyy`.
fn date(field: &[u8]) -> Option<Date> {
    let two = |at: usize| small_number(field.get(at..at + 2)?);
    let date = Date {
        day: two(0)?,
        month: two(2)?,
        year: 2000 + u16::from(two(4)?),
    };
    let fits = field.len() == 6 && (1..=12).contains(&date.month) && (1..=31).contains(&date.day);
    fits.then_some(date)
}

/// Days from 1970-01-01 to a date of the Gregorian calendar, counted in years that start in March
/// so that the leap day is the last of its year.
fn days_since_1970(date: &Date) -> i64 {
    /// Days from March of year 0 to 1970-01-01.
    const EPOCH: i64 = 719_468;
    let (year, month) = match date.month {
        1 | 2 => (i64::from(date.year) - 1, i64::from(date.month) + 9),
        _ => (i64::from(date.year), i64::from(date.month) - 3),
    };
    let day_of_year = (153 * month + 2) / 5 + i64::from(date.day) - 1;
    365 * year + year / 4 - year / 100 + year / 400 + day_of_year - EPOCH
}
