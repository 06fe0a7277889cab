//! Numbers for tables and sentences, where nobody reads more than four or five figures.

/// About four figures of a number: fixed point in the middle ("43.169", "12346"), a power of ten where that would be
/// long ("1.235e12"), a word for what is no number ("infinite").
pub fn number(value: f64) -> String {
    if value.is_nan() {
        return "undefined".to_owned();
    }
    if value.is_infinite() {
        return if value > 0.0 { "infinite".to_owned() } else { "-infinite".to_owned() };
    }
    match value.abs() {
        0.0 => "0".to_owned(),
        size if !(5e-4..1e6).contains(&size) => format!("{value:.3e}"),
        size if size < 100.0 => format!("{value:.3}"),
        size if size < 1000.0 => format!("{value:.2}"),
        size if size < 10_000.0 => format!("{value:.1}"),
        _ => format!("{value:.0}"),
    }
}

/// The same with its sign and two decimals, for what lies around zero.
pub fn signed(value: f64) -> String {
    if value.abs() < 1e5 { format!("{value:+.2}") } else { format!("{value:+.2e}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_number_is_long() {
        let cases = [
            (0.0, "0"),
            (0.05, "0.050"),
            (-43.1694, "-43.169"),
            (999.99, "999.99"),
            (12_345.6, "12346"),
            (2.5e150, "2.500e150"),
            (-1e-9, "-1.000e-9"),
            (f64::INFINITY, "infinite"),
            (f64::NEG_INFINITY, "-infinite"),
            (f64::NAN, "undefined"),
        ];
        for (value, text) in cases {
            assert_eq!(number(value), text);
        }
        assert_eq!([signed(0.8), signed(-3.0), signed(4e75)], ["+0.80", "-3.00", "+4.00e75"]);
    }

    proptest::proptest! {
        #[test]
        fn whatever_it_is(bits: u64) {
            let value = f64::from_bits(bits);
            proptest::prop_assert!(number(value).len() <= 12 && signed(value).len() <= 10);
        }
    }
}
