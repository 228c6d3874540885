//! Time formats of datasets: integers of s, ms, us or ns since 1970, and decimal seconds.

use gyre_radar::median;

pub(crate) const SECOND_NS: i64 = 1_000_000_000;

/// 2015-01-01 and 2041-01-01, s since 1970: the range of plausible times.
const YEARS_S: std::ops::Range<i64> = 1_420_070_400..2_240_611_200;

/// Times are accepted up to 146 years from 1970, so that no difference overflows.
pub(crate) const MAX_NS: i64 = i64::MAX / 2;
/// Plausible durations of a turn, ns; others are gaps or errors.
pub(crate) const TURN_NS: std::ops::Range<i64> = 10_000_000..10_000_000_000;
/// Default duration of a turn, ns: Navtech radars turn four times per second.
pub const DEFAULT_TURN_NS: i64 = 250_000_000;

/// Returns whether a time in ns is in the years 2015 to 2040.
pub(crate) fn plausible(stamp_ns: i64) -> bool {
    YEARS_S.contains(&stamp_ns.div_euclid(SECOND_NS))
}

/// Converts a stamp of unknown unit to ns: the years 2015 to 2040 do not overlap in s, ms, us and
/// ns.
pub fn to_ns(raw: i64) -> Option<i64> {
    let units = [1, 1_000, 1_000_000, SECOND_NS].into_iter();
    let mut times = units.filter_map(|unit| raw.checked_mul(unit));
    times.find(|ns| plausible(*ns))
}

/// Parses decimal seconds to ns, exactly: `12.5` is 12,500,000,000. Values with an exponent are
/// rounded to `f64`.
pub fn parse_seconds(text: &str) -> Option<i64> {
    let (whole, fraction) = text.split_once('.').unwrap_or((text, ""));
    let digits = |t: &str| t.bytes().all(|b| b.is_ascii_digit());
    let unsigned = whole.strip_prefix('-').unwrap_or(whole);
    if unsigned.is_empty() || !digits(unsigned) || !digits(fraction) {
        let ns = text.parse::<f64>().ok()? * 1e9;
        return (ns.abs() <= MAX_NS as f64).then_some(ns.round() as i64);
    }
    let sign = if whole.starts_with('-') { -1 } else { 1 };
    let seconds: i64 = unsigned.parse().ok()?;
    let nanoseconds = format!("{fraction:0<9}").get(..9)?.parse::<i64>().ok()?;
    let ns = seconds.checked_mul(SECOND_NS)?.checked_add(nanoseconds)?;
    (ns <= MAX_NS).then_some(sign * ns)
}

/// Duration of a turn, ns: the median time between consecutive scans without those that span a gap,
/// which are half as long again as the shortest tenth, or longer. `None` if no time can be a turn.
pub fn turn_ns(stamps: impl Iterator<Item = i64>) -> Option<i64> {
    let stamps: Vec<i64> = stamps.collect();
    let times = stamps.windows(2).map(|w| w[1] - w[0]);
    let mut times: Vec<i64> = times.filter(|ns| TURN_NS.contains(ns)).collect();
    times.sort_unstable();
    let short_ns = *times.get(times.len() / 10)?;
    let one_turn = times.iter().filter(|ns| **ns < short_ns * 3 / 2);
    // A turn in ns is exact in f64.
    median(one_turn.map(|ns| *ns as f64)).map(|ns| ns as i64)
}

/// Returns the mean of two times, ns: the time of a scan from the times of its first and last row.
pub fn middle_ns(first_ns: i64, last_ns: i64) -> i64 {
    // Saturating, since times that a radar sends may be any.
    first_ns.saturating_add(last_ns.saturating_sub(first_ns) / 2)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_unit_follows_from_the_size() {
        for unit in [1, 1_000, 1_000_000, SECOND_NS] {
            let found = to_ns(1_547_131_046 * unit);
            assert_eq!(found, Some(1_547_131_046 * SECOND_NS), "{unit}");
        }
        for raw in [0, -1, 586, 1_000_000_000, i64::MAX, i64::MIN] {
            assert_eq!(to_ns(raw), None, "{raw}");
        }
    }

    #[test]
    fn gaps_do_not_lengthen_the_turn() {
        let turn_of = |times: &[i64]| {
            let ends = times.iter().scan(0, |now, time| {
                *now += time;
                Some(*now)
            });
            turn_ns(std::iter::once(0).chain(ends))
        };
        let (turn, gap) = (249_595_334, 1_997_738_586);
        assert_eq!(turn_of(&[turn, gap]), Some(turn));
        assert_eq!(turn_of(&[gap, turn, gap]), Some(turn));
        assert_eq!(turn_of(&[turn, turn - 9, turn + 9, gap]), Some(turn));
        // One time in thirty that is far too short is no turn.
        let times = [&[turn / 4][..], &[turn; 29]].concat();
        assert_eq!(turn_of(&times), Some(turn));
        assert_eq!(turn_of(&[]), None);
    }

    #[test]
    fn decimal_seconds_keep_every_nanosecond() {
        for (text, ns) in [
            ("1549986606.800100001", 1_549_986_606_800_100_001),
            ("0", 0),
            ("-1.5", -1_500_000_000),
            ("1.5e3", 1_500_000_000_000),
            ("1.1234567899", 1_123_456_789),
        ] {
            assert_eq!(parse_seconds(text), Some(ns), "{text}");
        }
        for bad in " nan inf 1.2.3 x 1e300 9999999999 -9999999999 1e10".split(' ') {
            assert_eq!(parse_seconds(bad), None, "{bad}");
        }
    }
}
