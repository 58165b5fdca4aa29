//! Numbers for people: as many digits as tell something.

/// `x` with its sign and four significant digits.
pub fn signed(x: f64) -> String {
    let sign = if x < 0.0 { "-" } else { "+" };
    format!("{sign}{}", short(x.abs()))
}

/// `x` with four significant digits, or as many as stand before its point.
pub fn short(x: f64) -> String {
    rounded(x, decimals_for(x, 4))
}

/// Decimals after the point that show `digits` significant digits of `x`; below zero where the point comes later.
pub fn decimals_for(x: f64, digits: i32) -> i32 {
    if x == 0.0 || !x.is_finite() { 0 } else { digits - 1 - x.abs().log10().floor() as i32 }
}

/// `x` with so many decimals after the point; as a power of ten where that would be a row of zeros.
pub fn rounded(x: f64, decimals: i32) -> String {
    if decimals > 12 { format!("{x:.3e}") } else { format!("{x:.*}", decimals.max(0) as usize) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_show_what_is_known_of_them() {
        assert_eq!([1234.56, 0.012_345_6, 0.0, -5.0].map(short), ["1235", "0.01235", "0", "-5.000"]);
        assert_eq!(short(1e-20), "1.000e-20");
        assert_eq!([-0.0, 0.5, -0.000_012_34].map(signed), ["+0", "+0.5000", "-0.00001234"]);
    }
}
