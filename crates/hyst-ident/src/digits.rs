//! Formatting of numbers with significant digits.

/// Formats `x` with its sign and four significant digits.
pub fn signed(x: f64) -> String {
    let sign = if x < 0.0 { "-" } else { "+" };
    format!("{sign}{}", short(x.abs()))
}

/// Formats `x` with four significant digits, or with all digits before the decimal point.
pub fn short(x: f64) -> String {
    rounded(x, decimals_for(x, 4))
}

/// Returns the number of decimals for `digits` significant digits of `x`.
///
/// It is negative if `x` has more digits before the decimal point.
pub fn decimals_for(x: f64, digits: i32) -> i32 {
    if x == 0.0 || !x.is_finite() { 0 } else { digits - 1 - x.abs().log10().floor() as i32 }
}

/// Formats `x` with this number of decimals; in scientific notation if there are more than 12.
pub fn rounded(x: f64, decimals: i32) -> String {
    if decimals > 12 { format!("{x:.3e}") } else { format!("{x:.*}", decimals.max(0) as usize) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_four_significant_digits() {
        assert_eq!([1234.56, 0.012_345_6, 0.0, -5.0].map(short), ["1235", "0.01235", "0", "-5.000"]);
        assert_eq!(short(1e-20), "1.000e-20");
        assert_eq!([-0.0, 0.5, -0.000_012_34].map(signed), ["+0", "+0.5000", "-0.00001234"]);
    }
}
