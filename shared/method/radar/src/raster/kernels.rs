//! The loops over bins and cells, compiled for each vector unit. They are plain Rust without fused
//! multiply-add, so every variant gives the same bits.

pub(super) mod locate;
pub(crate) mod window;

/// The integer below `value`; at an integer, that or the previous one, which interpolates alike.
/// Valid in `[0, 2^22]`, and in `[0, 2^23)` for any input. A cast takes ten times longer, since it
/// handles overflow and NaN.
#[inline(always)]
pub(crate) fn integer_below(value: f32) -> i32 {
    const MANTISSA: u32 = (1 << 23) - 1;
    let rounded = (value - 0.5).max(0.0) + (1 << 23) as f32;
    (rounded.to_bits() & MANTISSA) as i32
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn integers_below_are_within_one(value in 0.0..4e6f32) {
            let past = value - integer_below(value) as f32;
            prop_assert!((0.0..=1.0).contains(&past));
        }
    }

    #[test]
    fn integer_below_is_defined_for_all_floats() {
        for value in [
            0.0,
            0.25,
            -1.0,
            f32::NAN,
            f32::INFINITY,
            f32::NEG_INFINITY,
            f32::MAX,
        ] {
            assert!((0..1 << 23).contains(&integer_below(value)));
        }
    }
}
