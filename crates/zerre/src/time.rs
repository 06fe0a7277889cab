//! Instants and spans as integer nanoseconds: exact, ordered, hashable. Seconds exist inside models only.

use crate::error::{Error, Result};
use serde::{Deserialize, Serialize};
use std::fmt;
use std::ops::{Add, Sub};

const NANOS_PER_SEC: i64 = 1_000_000_000;

/// An instant: nanoseconds since an epoch that the source of the data chooses (UNIX, midnight, start of the
/// recording). Two instants of different epochs must not meet; nothing here can tell.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug, Default, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Time(i64);

/// A signed length of time in nanoseconds.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug, Default, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Span(i64);

impl Time {
    /// The epoch itself.
    pub const ZERO: Time = Time(0);

    /// The instant `nanos` nanoseconds after the epoch.
    pub const fn from_nanos(nanos: i64) -> Time {
        Time(nanos)
    }

    /// Nanoseconds since the epoch.
    pub const fn nanos(self) -> i64 {
        self.0
    }

    /// The instant `secs` seconds after the epoch, rounded to a nanosecond; for scenarios and tests. Text of a
    /// recording goes through [`Time::parse_secs`], which never passes through floating point.
    pub fn from_secs(secs: f64) -> Time {
        Time(Span::from_secs(secs).0)
    }

    /// Seconds since the epoch, rounded to the nearest `f64`; for models that depend on absolute time.
    pub fn secs(self) -> f64 {
        Span(self.0).secs()
    }

    /// Reads decimal seconds (`"1626098398.996"`, `"-0.5"`, `"12"`) exactly. More than nine decimals are
    /// rounded half away from zero.
    ///
    /// # Errors
    /// [`Error::BadTime`] if the text is not a plain decimal number or lies outside about 292 years.
    pub fn parse_secs(text: &str) -> Result<Time> {
        let bad = || Error::BadTime { text: text.to_owned() };
        let (negative, digits) = match text.as_bytes().first() {
            Some(b'-') => (true, &text[1..]),
            Some(b'+') => (false, &text[1..]),
            _ => (false, text),
        };
        let (whole, fraction) = digits.split_once('.').unwrap_or((digits, ""));
        if whole.is_empty() && fraction.is_empty() {
            return Err(bad());
        }
        if !whole.bytes().chain(fraction.bytes()).all(|b| b.is_ascii_digit()) {
            return Err(bad());
        }
        let mut nanos: i128 = 0;
        for b in whole.bytes() {
            nanos = nanos * 10 + i128::from(b - b'0');
            if nanos > i128::from(i64::MAX) {
                return Err(bad());
            }
        }
        nanos *= i128::from(NANOS_PER_SEC);
        let mut unit = i128::from(NANOS_PER_SEC) / 10;
        for b in fraction.bytes().take(9) {
            nanos += i128::from(b - b'0') * unit;
            unit /= 10;
        }
        if fraction.len() > 9 && fraction.as_bytes()[9] >= b'5' {
            nanos += 1;
        }
        i64::try_from(if negative { -nanos } else { nanos }).map(Time).map_err(|_| bad())
    }
}

impl Span {
    /// No time at all.
    pub const ZERO: Span = Span(0);

    /// A span of `nanos` nanoseconds.
    pub const fn from_nanos(nanos: i64) -> Span {
        Span(nanos)
    }

    /// Length in nanoseconds.
    pub const fn nanos(self) -> i64 {
        self.0
    }

    /// A span of `secs` seconds, rounded to a nanosecond; saturates far outside the range, NaN gives zero.
    pub fn from_secs(secs: f64) -> Span {
        Span((secs * NANOS_PER_SEC as f64).round() as i64)
    }

    /// Length in seconds.
    pub fn secs(self) -> f64 {
        // Whole and fraction apart: exact for whole seconds, one rounding otherwise.
        let (whole, rest) = (self.0 / NANOS_PER_SEC, self.0 % NANOS_PER_SEC);
        whole as f64 + rest as f64 / NANOS_PER_SEC as f64
    }
}

impl Sub for Time {
    type Output = Span;
    fn sub(self, earlier: Time) -> Span {
        Span(self.0.saturating_sub(earlier.0))
    }
}

impl Add<Span> for Time {
    type Output = Time;
    fn add(self, span: Span) -> Time {
        Time(self.0.saturating_add(span.0))
    }
}

/// Decimal seconds with as many of the nine decimals as are needed; reads back to the same instant.
impl fmt::Display for Time {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let magnitude = self.0.unsigned_abs();
        let (whole, rest) = (magnitude / NANOS_PER_SEC as u64, magnitude % NANOS_PER_SEC as u64);
        let sign = if self.0 < 0 { "-" } else { "" };
        if rest == 0 {
            write!(f, "{sign}{whole}")
        } else {
            let decimals = format!("{rest:09}");
            write!(f, "{sign}{whole}.{}", decimals.trim_end_matches('0'))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use proptest::test_runner::RngSeed;

    #[test]
    fn decimal_text_is_exact() {
        assert_eq!(Time::parse_secs("1626098398.996").unwrap().nanos(), 1_626_098_398_996_000_000);
        assert_eq!(Time::parse_secs("-0.000000001").unwrap().nanos(), -1);
        assert_eq!(Time::parse_secs(".5").unwrap().nanos(), 500_000_000);
        assert_eq!(Time::parse_secs("1.0000000005").unwrap().nanos(), 1_000_000_001);
        for bad in ["", ".", "-", "1e5", "NaN", "inf", "1.2.3", "99999999999999999999", "1 ", "−1"] {
            assert!(Time::parse_secs(bad).is_err(), "{bad:?}");
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig {
            rng_seed: RngSeed::Fixed(5),
            failure_persistence: None,
            ..ProptestConfig::default()
        })]

        #[test]
        fn text_reads_back(nanos in any::<i64>()) {
            prop_assume!(nanos != i64::MIN);
            let t = Time::from_nanos(nanos);
            prop_assert_eq!(Time::parse_secs(&t.to_string()).unwrap(), t);
        }
    }
}
