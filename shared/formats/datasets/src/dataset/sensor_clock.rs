//! Reconstruction of the uniform sensor clock from the times of receipt at the host.

/// Maximum time from the first scan, ns: a century. It prevents overflow for absurd frame numbers.
const MAX_NS: i64 = 3_155_760_000_000_000_000;

/// A time that lies further below the series of the others is wrong, ns. In recordings a time that
/// is left out lies up to 0.018 s below.
const EARLY_NS: f64 = 30_000_000.0;
/// A time that lies less above a series is one that it is fitted to, ns: rounding.
const TOUCHING_NS: f64 = 1_000.0;
/// Minimum share of times that lie as closely above a series that leaves out early ones.
const PROMPT_SHARE: f64 = 0.25;
/// One time in so many may be early, and one more.
const TIMES_PER_EARLY: usize = 30;
const MIN_TIMES: usize = 8;

/// The number of a scan, and when it was received, ns.
type Receipt = (i64, i64);

/// Scan `number` starts at `start_ns + period_ns * number`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct SensorClock {
    origin_ns: i64,
    /// From `origin_ns`, ns.
    start: f64,
    pub(crate) period: f64,
}

impl SensorClock {
    /// Fits the uniform series that is closest to the times of receipt from below: a host is late,
    /// never early.
    ///
    /// `received` holds (scan number, ns) with increasing numbers; `period` bounds the period, ns.
    /// Minimises `sum(received - start - period * number)` such that no term is negative: a linear
    /// programme in two unknowns, whose optimum is the edge of the lower convex hull of the points
    /// at their mean number. `None` without points.
    pub(crate) fn below(
        received: &[(i64, i64)],
        period: std::ops::RangeInclusive<f64>,
    ) -> Option<Self> {
        let &(first_number, origin_ns) = received.first()?;
        let point = |(number, ns): &Receipt| {
            let number = *number as f64 - first_number as f64;
            (number, (ns - origin_ns) as f64)
        };
        let points: Vec<(f64, f64)> = received.iter().map(point).collect();
        let mean = points.iter().map(|p| p.0).sum::<f64>() / points.len() as f64;
        let slope =
            slope_over(&lower_hull(&points), mean).unwrap_or((period.start() + period.end()) / 2.0);
        let slope = slope.clamp(*period.start(), *period.end());
        let starts = points.iter().map(|(number, ns)| ns - slope * number);
        let start = starts.fold(f64::INFINITY, f64::min);
        Some(Self {
            origin_ns,
            start: start - slope * first_number as f64,
            period: slope,
        })
    }

    /// Fits as [`SensorClock::below`], but without a few times that are early: a single early time
    /// would bend the whole series. Returns these too.
    pub(crate) fn below_most(
        received: &[Receipt],
        period: std::ops::RangeInclusive<f64>,
    ) -> Option<(Self, Vec<Receipt>)> {
        let all = Self::below(received, period.clone())?;
        let most = 1 + received.len() / TIMES_PER_EARLY;
        let (mut clock, mut rest) = (all, received.to_vec());
        for _ in 0..=most {
            let (near, others) = clock.split_touching(&rest, most);
            let Some(next) = Self::below(&others, period.clone()) else {
                break;
            };
            if others.len() < MIN_TIMES || !near.iter().any(|time| next.is_early(*time)) {
                break;
            }
            (clock, rest) = (next, others);
        }
        let is_early = |time: &Receipt| clock.is_early(*time);
        let (early, times): (Vec<_>, Vec<_>) = received.iter().copied().partition(is_early);
        let is_prompt = |time: &&Receipt| clock.after_ns(**time) <= EARLY_NS;
        let prompt = times.iter().filter(is_prompt).count();
        match prompt as f64 >= PROMPT_SHARE * times.len() as f64 && early.len() <= most {
            true => Some((Self::below(&times, period)?, early)),
            false => Some((all, Vec::new())),
        }
    }

    /// Divides times into those that the series touches, with as many beside them as may be early
    /// together, and the others.
    fn split_touching(&self, times: &[Receipt], most: usize) -> (Vec<Receipt>, Vec<Receipt>) {
        let beside = most.min(3) - 1;
        let mut is_near = vec![false; times.len()];
        for (index, time) in times.iter().enumerate() {
            if self.after_ns(*time) < TOUCHING_NS {
                let end = (index + beside + 1).min(times.len());
                is_near[index.saturating_sub(beside)..end].fill(true);
            }
        }
        let of = |near: bool| {
            let times = times.iter().zip(&is_near);
            let times = times.filter(|(_, is_near)| **is_near == near);
            times.map(|(time, _)| *time).collect()
        };
        (of(true), of(false))
    }

    /// Time of receipt after the start of the sweep, ns.
    pub(crate) fn after_ns(&self, (number, ns): (i64, i64)) -> f64 {
        (ns - self.start_ns(number)) as f64
    }

    fn is_early(&self, time: (i64, i64)) -> bool {
        self.after_ns(time) < -EARLY_NS
    }

    pub(crate) fn start_ns(&self, number: i64) -> i64 {
        let after = (self.start + self.period * number as f64).round() as i64;
        self.origin_ns + after.clamp(-MAX_NS, MAX_NS)
    }
}

/// Lower convex hull of points that are sorted by their first coordinate (Andrew's monotone chain).
fn lower_hull(points: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let mut hull: Vec<(f64, f64)> = Vec::new();
    for &p in points {
        while let [.., a, b] = hull[..] {
            if (b.0 - a.0) * (p.1 - a.1) > (b.1 - a.1) * (p.0 - a.0) {
                break;
            }
            hull.pop();
        }
        hull.push(p);
    }
    hull
}

/// Slope of the edge of the hull at `x`.
fn slope_over(hull: &[(f64, f64)], x: f64) -> Option<f64> {
    let edge = hull.windows(2).find(|edge| edge[1].0 >= x)?;
    Some((edge[1].1 - edge[0].1) / (edge[1].0 - edge[0].0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const BOUNDS: std::ops::RangeInclusive<f64> = 0.2e9..=0.3e9;

    /// By brute force: the best start for each period of a grid.
    fn slack_of_grid(received: &[(i64, i64)]) -> f64 {
        let slack = |period: f64| {
            let late = received
                .iter()
                .map(|(k, ns)| *ns as f64 - period * *k as f64);
            let late: Vec<f64> = late.collect();
            let start = late.iter().copied().fold(f64::INFINITY, f64::min);
            late.iter().map(|l| l - start).sum::<f64>()
        };
        let slacks = (20_000..=30_000).map(|p| slack(f64::from(p) * 1e4));
        slacks.fold(f64::INFINITY, f64::min)
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]
        #[test]
        fn no_grid_search_finds_a_closer_series(late_ms in prop::collection::vec(0_i64..400, 1..60)) {
            let received: Vec<(i64, i64)> =
                late_ms.iter().enumerate().map(|(k, l)| (k as i64 + 242, k as i64 * 250_000_000 + l * 1_000_000)).collect();
            let clock = SensorClock::below(&received, BOUNDS).unwrap();
            let slack: Vec<i64> = received.iter().map(|(k, ns)| ns - clock.start_ns(*k)).collect();
            prop_assert!(slack.iter().all(|s| *s >= -2), "the series lies above a time of receipt");
            prop_assert!(slack.iter().sum::<i64>() as f64 <= slack_of_grid(&received) + 1e3);
        }
    }

    #[test]
    fn one_scan_gives_the_middle_of_the_bounds() {
        let clock = SensorClock::below(&[(7, 1_000)], BOUNDS).unwrap();
        assert_eq!((clock.start_ns(7), clock.period), (1_000, 0.25e9));
    }

    /// Times of 100 scans of a host that is 0 to 20 ms late, and stalls once.
    fn times() -> Vec<(i64, i64)> {
        let late_ms = |k: i64| match k {
            60..66 => 1_400 - (k - 60) * 230,
            _ => k * 7 % 21,
        };
        let ns = |k| 1_549_986_607_000_000_000 + k * 250_020_000 + late_ms(k) * 1_000_000;
        (0..100).map(|k| (k, ns(k))).collect()
    }

    #[test]
    fn times_that_are_early_bend_nothing_and_are_returned() {
        let (good, none) = SensorClock::below_most(&times(), BOUNDS).unwrap();
        assert_eq!(Some(good), SensorClock::below(&times(), BOUNDS));
        assert!(none.is_empty());
        for early in [
            &[0][..],
            &[50],
            &[99],
            &[20, 80],
            &[40, 41],
            &[63],
            &[9, 30, 31, 90],
        ] {
            for by_ms in [60, 700, 5_000] {
                let mut received = times();
                // Of a scan that is received late, a time that is early by so much.
                for k in early {
                    received[*k].1 = good.start_ns(*k as i64) - by_ms * 1_000_000;
                }
                let expected: Vec<_> = early.iter().map(|k| received[*k]).collect();
                let (clock, found) = SensorClock::below_most(&received, BOUNDS).unwrap();
                assert_eq!(found, expected, "{early:?} by {by_ms} ms");
                let errors = (0..100).map(|k| (clock.start_ns(k) - good.start_ns(k)).abs());
                let error = errors.max();
                assert!(
                    error < Some(2_000_000),
                    "{early:?} by {by_ms} ms: {error:?}"
                );
            }
        }
    }

    #[test]
    fn a_host_that_is_late_most_of_the_time_makes_no_time_early() {
        let mut received = times();
        for (k, ns) in received.iter_mut().skip(20) {
            *ns += 300_000_000 + *k * 37 % 11 * 50_000_000;
        }
        let (_, early) = SensorClock::below_most(&received, BOUNDS).unwrap();
        assert!(early.is_empty(), "{early:?}");
    }
}
