//! Decimal numbers as text. `core`'s own parser would bring tables of 10 KB and a path that panics into the image.

/// More digits than an `f32` tells apart are no mistake, but more than these are no number of a person.
const MOST_DIGITS: u32 = 24;
/// Of the exponent: beyond, every number is zero or infinite.
const FAR: i32 = 99;

/// Returns the number that the whole text is: digits with sign, point and exponent, `nan`, `inf`. Within two units in the last place.
pub(super) fn parse(text: &[u8]) -> Option<f32> {
    let (is_negative, text) = sign(text);
    let magnitude = match text {
        text if text.eq_ignore_ascii_case(b"nan") => f32::NAN,
        text if text.eq_ignore_ascii_case(b"inf") => f32::INFINITY,
        text => decimal(text)?,
    };
    Some(if is_negative { -magnitude } else { magnitude })
}

/// Returns the number of a parameter: up to three digits.
pub(super) fn index(text: &[u8]) -> Option<usize> {
    if text.is_empty() || text.len() > 3 {
        return None;
    }
    let mut number = 0_usize;
    for byte in text {
        let digit = byte.checked_sub(b'0').filter(|digit| *digit < 10)?;
        number = number * 10 + usize::from(digit);
    }
    Some(number)
}

const fn sign(text: &[u8]) -> (bool, &[u8]) {
    match text {
        [b'-', rest @ ..] => (true, rest),
        [b'+', rest @ ..] => (false, rest),
        _ => (false, text),
    }
}

fn decimal(text: &[u8]) -> Option<f32> {
    let mut halves = text.splitn(2, |byte| byte.eq_ignore_ascii_case(&b'e'));
    let mantissa = halves.next()?;
    let mut exponent = match halves.next() {
        Some(text) => exponent(text)?,
        None => 0,
    };
    let (mut value, mut digits, mut is_fraction) = (0_u32, 0_u32, false);
    for byte in mantissa {
        if *byte == b'.' && !is_fraction {
            is_fraction = true;
            continue;
        }
        let digit = byte.checked_sub(b'0').filter(|digit| *digit < 10)?;
        digits += 1;
        // What nine digits cannot hold only shifts the point.
        let next = value.checked_mul(10).and_then(|value| value.checked_add(u32::from(digit)));
        match next {
            Some(next) => {
                value = next;
                exponent -= i32::from(is_fraction);
            }
            None => exponent += i32::from(!is_fraction),
        }
        if digits > MOST_DIGITS {
            return None;
        }
    }
    (digits > 0).then(|| scaled(value as f32, exponent))
}

fn exponent(text: &[u8]) -> Option<i32> {
    let (is_negative, digits) = sign(text);
    let number = i32::try_from(index(digits)?).ok()?.min(FAR);
    Some(if is_negative { -number } else { number })
}

/// Returns `value` times a power of ten, in steps that `f32` holds exactly: one rounding for up to ten digits.
fn scaled(mut value: f32, mut exponent: i32) -> f32 {
    const POWERS: [f32; 11] = [1.0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10];
    while exponent != 0 && value > 0.0 && value.is_finite() {
        let step = exponent.unsigned_abs().min(10);
        let power = POWERS.get(step as usize).copied().unwrap_or(1e10);
        if exponent < 0 {
            value /= power;
            exponent += step.cast_signed();
        } else {
            value *= power;
            exponent -= step.cast_signed();
        }
    }
    value
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::format;

    #[test]
    fn numbers_of_people_are_those_that_the_compiler_reads() {
        for (text, value) in [
            ("0", 0.0_f32),
            ("-0", -0.0),
            ("1", 1.0),
            ("+1.5", 1.5),
            (".25", 0.25),
            ("7.", 7.0),
            ("0.1", 0.1),
            ("-3.25159", -3.25159),
            ("2e3", 2e3),
            ("1E-3", 1e-3),
            ("0000012", 12.0),
            ("16777217", 16_777_216.0),
        ] {
            let parsed = parse(text.as_bytes()).unwrap();
            assert_eq!(parsed.to_bits(), value.to_bits(), "{text}: {parsed}");
        }
        assert_eq!(parse(b"1e50"), Some(f32::INFINITY));
        assert_eq!(parse(b"1e-99"), Some(0.0));
        assert_eq!(parse(b"-INF"), Some(f32::NEG_INFINITY));
        assert!(parse(b"nan").is_some_and(f32::is_nan));
    }

    #[test]
    fn text_that_is_no_number_is_none() {
        for text in [
            "", "-", ".", "1.2.3", "e5", "1e", "1e+", "1e1.5", "1,5", "0x10", "1_000", "--1",
            "1 2", "infinity", "1e9999",
        ] {
            assert_eq!(parse(text.as_bytes()), None, "{text}");
        }
        assert_eq!(parse(&[b'1'; 25]), None);
        assert_eq!(
            (index(b"12"), index(b""), index(b"1234"), index(b"-1")),
            (Some(12), None, None, None)
        );
    }

    proptest! {
        #[test]
        fn any_number_comes_back_within_two_units_in_the_last_place(value in -1e7_f32..1e7, decimals in 0..9_usize) {
            let text = format!("{value:.decimals$}");
            let exact: f32 = text.parse().unwrap();
            let parsed = parse(text.as_bytes()).unwrap();
            prop_assert!(parsed.to_bits().abs_diff(exact.to_bits()) <= 2, "{} {} {}", text, parsed, exact);
        }
    }
}
