//! Robust kernels: how much a loop counts that disagrees with the rest.

/// A robust kernel of the chi-square of a loop.
/// The cost of a loop is half of a concave function of its chi-square c; the derivative of this
/// function is the loop's weight.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Kernel {
    /// Plain least squares: every loop that passed the gate has weight 1. One wrong loop bends the
    /// whole trajectory.
    None,
    /// Geman and McClure, 1987: weight (s / (s + c))^2. Right loops lose some weight too: 0.71 at
    /// c = 3 for s = 16.
    GemanMcClure {
        /// The chi-square s where the weight is 1/4.
        scale: f64,
    },
    /// Dynamic covariance scaling (Agarwal et al., ICRA 2013): weight 1 up to c = phi, then (2 phi
    /// / (phi + c))^2.
    DynamicCovarianceScaling {
        /// A loop keeps its weight up to this chi-square.
        phi: f64,
    },
}

impl Kernel {
    pub fn cost(&self, chi_square: f64) -> f64 {
        match *self {
            Self::None => chi_square,
            Self::GemanMcClure { scale } => scale * chi_square / (scale + chi_square),
            Self::DynamicCovarianceScaling { phi } if chi_square <= phi => chi_square,
            Self::DynamicCovarianceScaling { phi } => {
                phi * (3.0 * chi_square - phi) / (chi_square + phi)
            }
        }
    }

    /// Returns the weight of a loop, from 0 to 1: the derivative of the cost.
    pub fn weight(&self, chi_square: f64) -> f64 {
        let share: f64 = match *self {
            Self::None => 1.0,
            Self::GemanMcClure { scale } => scale / (scale + chi_square),
            Self::DynamicCovarianceScaling { phi } => (2.0 * phi / (phi + chi_square)).min(1.0),
        };
        share * share
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const KERNELS: [Kernel; 3] = [
        Kernel::None,
        Kernel::GemanMcClure { scale: 16.0 },
        Kernel::DynamicCovarianceScaling { phi: 4.0 },
    ];

    #[test]
    fn weights_are_the_derivatives_of_the_cost() {
        for kernel in KERNELS {
            assert_eq!((kernel.cost(0.0), kernel.weight(0.0)), (0.0, 1.0));
            for chi_square in [0.1, 3.0, 4.0, 4.1, 16.0, 100.0, 1e4] {
                let slope =
                    (kernel.cost(chi_square + 1e-4) - kernel.cost(chi_square - 1e-4)) / 2e-4;
                let weight = kernel.weight(chi_square);
                assert!((slope - weight).abs() < 1e-5, "{kernel:?} {chi_square}");
            }
        }
    }

    #[test]
    fn weights_at_known_points() {
        assert_eq!(KERNELS[1].weight(16.0), 0.25);
        assert_eq!(KERNELS[2].weight(4.0), 1.0);
        assert_eq!(KERNELS[2].weight(12.0), 0.25);
    }
}
