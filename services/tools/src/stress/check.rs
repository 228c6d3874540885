//! The comparison of measured figures with their limits.

use serde::Serialize;

/// One figure beside its limit.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Check {
    /// The key of `[budget]`.
    pub key: &'static str,
    /// The measured figure; `None`: there is no figure, which misses the limit.
    pub measured: Option<f64>,
    pub limit: f64,
    /// True if the limit is kept.
    pub passed: bool,
}

impl Check {
    /// The measured figure must not be above the limit.
    pub fn at_most(key: &'static str, measured: Option<f64>, limit: f64) -> Self {
        Self {
            key,
            measured,
            limit,
            passed: measured.is_some_and(|measured| measured <= limit),
        }
    }

    /// The measured figure must not be below the limit.
    pub fn at_least(key: &'static str, measured: Option<f64>, limit: f64) -> Self {
        Self {
            passed: measured.is_some_and(|measured| measured >= limit),
            ..Self::at_most(key, measured, limit)
        }
    }

    /// Returns `p99_ms 312.4, limit 250`.
    pub fn sentence(&self) -> String {
        let measured = self.measured.map_or("not measured".to_owned(), |measured| {
            format!("{measured:.1}")
        });
        format!("{} {measured}, limit {}", self.key, self.limit)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_figure_on_its_limit_keeps_it_and_a_missing_one_does_not() {
        assert!(Check::at_most("p99_ms", Some(100.0), 100.0).passed);
        assert!(!Check::at_most("p99_ms", Some(100.1), 100.0).passed);
        assert!(!Check::at_most("p99_ms", None, 100.0).passed);
        assert!(Check::at_least("radars", Some(2.0), 2.0).passed);
        assert!(!Check::at_least("radars", Some(1.0), 2.0).passed);
        let sentence = Check::at_most("p99_ms", Some(312.44), 100.0).sentence();
        assert_eq!(sentence, "p99_ms 312.4, limit 100");
    }
}
