//! Quantiles of the chi-square distribution.

use std::f64::consts::PI;

/// The value that a chi-square variable of `dof` > 0 degrees of freedom stays below with probability `p` in (0, 1).
pub(crate) fn quantile(p: f64, dof: usize) -> f64 {
    let d = dof as f64;
    let ln_gamma = ln_gamma_half(dof + 2);
    // twenty standard deviations above the mean, and more where the distribution is skewed
    let (mut low, mut high) = (0.0, d + 20.0 * (2.0 * d).sqrt() + 40.0);
    while high - low > 1e-12 * high {
        let middle = 0.5 * (low + high);
        match cumulative(middle, d, ln_gamma) < p {
            true => low = middle,
            false => high = middle,
        }
    }
    0.5 * (low + high)
}

/// Probability of a value below `x` > 0: the regularised lower incomplete gamma function of (dof / 2, x / 2), by its power
/// series, whose terms are all positive. `ln_gamma` is ln gamma(dof / 2 + 1).
fn cumulative(x: f64, dof: f64, ln_gamma: f64) -> f64 {
    let (a, x) = (0.5 * dof, 0.5 * x);
    let (mut term, mut sum, mut n) = (1.0, 1.0, 1.0);
    while term > 1e-17 * sum {
        term *= x / (a + n);
        sum += term;
        n += 1.0;
    }
    (a * x.ln() - x - ln_gamma + f64::ln(sum)).exp()
}

/// ln gamma(n / 2), n > 0, by its recurrence.
fn ln_gamma_half(n: usize) -> f64 {
    let (first, start) = if n.is_multiple_of(2) {
        (2, 0.0)
    } else {
        (1, 0.5 * PI.ln())
    };
    start
        + (first..n)
            .step_by(2)
            .map(|k| (0.5 * k as f64).ln())
            .sum::<f64>()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_those_of_the_tables() {
        let table = [
            (0.95, 1, 3.841459),
            (0.95, 2, 5.991465),
            (0.95, 3, 7.814728),
            (0.025, 1, 0.000982069),
            (0.975, 10, 20.483177),
            (0.025, 100, 74.221927),
            (0.975, 100, 129.561197),
        ];
        for (p, dof, expected) in table {
            assert!(
                (quantile(p, dof) / expected - 1.0).abs() < 1e-6,
                "{p} {dof}: {}",
                quantile(p, dof)
            );
        }
    }

    #[test]
    fn many_degrees_of_freedom_come_near_to_the_normal_distribution() {
        let dof = 60_000.0f64;
        let expected = dof + 1.959964 * (2.0 * dof).sqrt();
        assert!((quantile(0.975, 60_000) - expected).abs() < 2.0);
    }
}
