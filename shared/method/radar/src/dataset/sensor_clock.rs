//! Reconstruction of the uniform sensor clock from the times of receipt at the host.

/// Maximum time from the first scan, ns: a century. It prevents overflow for absurd frame numbers.
const MAX_NS: i64 = 3_155_760_000_000_000_000;

/// Scan `number` starts at `start_ns + period_ns * number`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct SensorClock {
    origin_ns: i64,
    /// From `origin_ns`, ns.
    start: f64,
    /// ns.
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
        let points: Vec<(f64, f64)> = received
            .iter()
            .map(|(number, ns)| {
                (
                    *number as f64 - first_number as f64,
                    (ns - origin_ns) as f64,
                )
            })
            .collect();
        let mean = points.iter().map(|p| p.0).sum::<f64>() / points.len() as f64;
        let slope =
            slope_over(&lower_hull(&points), mean).unwrap_or((period.start() + period.end()) / 2.0);
        let slope = slope.clamp(*period.start(), *period.end());
        let start = points
            .iter()
            .map(|(number, ns)| ns - slope * number)
            .fold(f64::INFINITY, f64::min);
        Some(Self {
            origin_ns,
            start: start - slope * first_number as f64,
            period: slope,
        })
    }

    /// Start of the sweep of a scan, ns since 1970.
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
    #![allow(clippy::unwrap_used)]
    use super::*;
    use proptest::prelude::*;

    const BOUNDS: std::ops::RangeInclusive<f64> = 0.2e9..=0.3e9;

    /// By brute force: the best start for each period of a grid.
    fn slack_of_grid(received: &[(i64, i64)]) -> f64 {
        let slack = |period: f64| {
            let late: Vec<f64> = received
                .iter()
                .map(|(k, ns)| *ns as f64 - period * *k as f64)
                .collect();
            let start = late.iter().copied().fold(f64::INFINITY, f64::min);
            late.iter().map(|l| l - start).sum::<f64>()
        };
        (20_000..=30_000)
            .map(|p| slack(f64::from(p) * 1e4))
            .fold(f64::INFINITY, f64::min)
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
    fn a_uniform_clock_is_found_through_stalls() {
        let late = |k: i64| {
            if (30..36).contains(&k) {
                1_400 - (k - 30) * 230
            } else {
                k * 7 % 5
            }
        };
        let received: Vec<_> = (0..100)
            .map(|k| {
                (
                    k,
                    1_549_986_607_000_000_000 + k * 250_020_000 + late(k) * 1_000_000,
                )
            })
            .collect();
        let clock = SensorClock::below(&received, BOUNDS).unwrap();
        assert!(
            (clock.period - 250_020_000.0).abs() < 20_000.0,
            "{}",
            clock.period
        );
        assert!((clock.start_ns(33) - received[0].1 - 33 * 250_020_000).abs() < 1_000_000);
    }

    #[test]
    fn one_scan_gives_the_middle_of_the_bounds() {
        let clock = SensorClock::below(&[(7, 1_000)], BOUNDS).unwrap();
        assert_eq!((clock.start_ns(7), clock.period), (1_000, 0.25e9));
    }
}
