//! The distribution of a duration.

use hdrhistogram::Histogram;

use crate::latency::Percentiles;

const DIGITS: u8 = 3;
/// The longest distinguished duration, ns: an hour.
const LONGEST_NS: u64 = 3_600_000_000_000;

#[derive(Debug, Default)]
pub struct Durations(Option<Histogram<u64>>);

impl Durations {
    /// Adds a duration. One below zero counts as zero, one above an hour as an hour.
    pub fn add(&mut self, duration_ns: i64) {
        if self.0.is_none() {
            // Fails for more than 5 digits alone.
            self.0 = Histogram::new_with_max(LONGEST_NS, DIGITS).ok();
        }
        if let Some(histogram) = &mut self.0 {
            histogram.saturating_record(u64::try_from(duration_ns).unwrap_or(0));
        }
    }

    pub fn count(&self) -> u64 {
        self.0.as_ref().map_or(0, Histogram::len)
    }

    /// Returns the duration, ns, that this share (0 to 1) of all does not exceed; `None` if there
    /// is no duration.
    pub fn at(&self, share: f64) -> Option<u64> {
        let histogram = self.0.as_ref()?;
        Some(histogram.value_at_quantile(share))
    }

    pub fn percentiles(&self) -> Percentiles {
        self.percentiles_if_any().unwrap_or_default()
    }

    /// Returns the percentiles; `None` if there is no duration.
    pub fn percentiles_if_any(&self) -> Option<Percentiles> {
        let histogram = self.0.as_ref()?;
        let at = |share| histogram.value_at_quantile(share) as f64 * 1e-3;
        Some(Percentiles {
            p50_us: at(0.5),
            p90_us: at(0.9),
            p99_us: at(0.99),
            max_us: histogram.max() as f64 * 1e-3,
        })
    }
}
