//! Numbers as people read them.

/// A number to six digits, which print without the tail that binary fractions leave: a tenth of a nanometre of 99 um.
///
/// # Example
/// ```
/// use hysteron_table::short;
/// assert_eq!(short(0.65 * 20.0 - 0.15 * 20.0 - 8.7).to_string(), "1.3");
/// assert_eq!(short(1.0 / 20.3e-6).to_string(), "49261.1");
/// ```
pub fn short(value: f64) -> f64 {
    // What is printed this way is read back, infinities and NaN too.
    format!("{value:.5e}").parse().unwrap_or(value)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn val_six_digits_are_left() {
        for (value, said) in [
            (1.300_000_000_000_000_3, "1.3"),
            (-0.1 - 0.2, "-0.3"),
            (199.996_948_242, "199.997"),
            (0.000_012_345_678, "0.0000123457"),
            (50_000.000_000_1, "50000"),
            (1e7, "10000000"),
            (0.0, "0"),
            (f64::NAN, "NaN"),
            (f64::INFINITY, "inf"),
        ] {
            assert_eq!(short(value).to_string(), said);
        }
    }
}
