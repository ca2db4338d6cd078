//! Numbers as people read them.

/// At most `digits` decimals, without trailing zeros.
pub(super) fn number(value: f64, digits: usize) -> String {
    let text = format!("{value:.digits$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

/// Exactly `digits` decimals, for columns; thousands grouped.
pub(super) fn decimals(value: f64, digits: usize) -> String {
    let text = format!("{value:.digits$}");
    let (whole, part) = text.split_once('.').unwrap_or((&text, ""));
    whole.parse().map_or_else(|_| text.clone(), |whole| format!("{}.{part}", thousands(whole)))
}

pub(super) fn significant(value: f64) -> String {
    let size = value.abs();
    if value == 0.0 || (0.001..1000.0).contains(&size) { number(value, 4) } else { format!("{value:.2e}") }
}

/// Digits in groups of three, with narrow no-break spaces.
pub(super) fn thousands(value: u64) -> String {
    let digits = value.to_string();
    let mut out = String::new();
    for (n, digit) in digits.chars().enumerate() {
        if n > 0 && (digits.len() - n).is_multiple_of(3) {
            out.push('\u{202f}');
        }
        out.push(digit);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_read_well() {
        assert_eq!(thousands(1_234_567), "1\u{202f}234\u{202f}567");
        assert_eq!([number(2.0, 3), number(0.25, 3), number(100.0, 0)], ["2", "0.25", "100"]);
        assert_eq!([decimals(24502.41, 1), decimals(0.0, 2), decimals(-1.5, 1)], ["24\u{202f}502.4", "0.00", "-1.5"]);
        assert_eq!([significant(8e-15), significant(0.0123), significant(0.0)], ["8.00e-15", "0.0123", "0"]);
    }
}
