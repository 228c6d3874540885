//! Gaps of the ground truth: pauses that are longer than its own steps.

/// A gap is longer than the usual step by more than this factor: stamps jitter.
const JITTER: f64 = 1.5;
/// The longest pause that slow steps make no gap, ns: over a longer one a vehicle does not keep to
/// a straight line.
const LONGEST_NS: i64 = 3_000_000_000;

/// Returns the longest pause between two stamps that is no gap, ns: `least_ns`, or one and a half
/// of the trajectory's own steps (their median), but no more than 3 s, if that is longer. Stamps
/// that are equal are no steps.
pub fn max_gap_ns(stamps_ns: &[i64], least_ns: i64) -> i64 {
    let steps = stamps_ns.windows(2).map(|w| w[1].abs_diff(w[0]));
    let mut steps: Vec<u64> = steps.filter(|step| *step > 0).collect();
    if steps.is_empty() {
        return least_ns;
    }
    let middle = steps.len() / 2;
    let (_, usual, _) = steps.select_nth_unstable(middle);
    least_ns.max(LONGEST_NS.min((JITTER * *usual as f64) as i64))
}

#[cfg(test)]
mod tests {
    use super::*;

    const SECOND: i64 = 1_000_000_000;

    #[test]
    fn a_gap_is_longer_than_the_own_steps() {
        let jittering = [0, 1_001, 1_999, 3_000, 4_001].map(|ms| ms * 1_000_000);
        assert_eq!(max_gap_ns(&jittering, SECOND), 1_501_500_000);
        // A hole in a fast truth is one, whatever its length.
        let fast = [0, 50, 100, 3_000, 3_050, 3_100].map(|ms| ms * 1_000_000);
        assert_eq!(max_gap_ns(&fast, SECOND), SECOND);
        for few in [&[][..], &[7], &[7, 7]] {
            assert_eq!(max_gap_ns(few, SECOND), SECOND);
        }
        // Keyframes are too far apart to be joined by straight lines.
        let keyframes = [0, 10, 20, 30].map(|s| s * SECOND);
        assert_eq!(max_gap_ns(&keyframes, SECOND), 3 * SECOND);
        assert_eq!(max_gap_ns(&keyframes, 20 * SECOND), 20 * SECOND);
        assert_eq!(max_gap_ns(&[i64::MIN, i64::MAX], SECOND), 3 * SECOND);
    }
}
