//! Powell's dogleg: a Gauss-Newton step within a trust radius.

use nalgebra::DVector;

use super::system::System;

/// The steps from one linearisation. Lengths are over all poses, in m and rad.
pub(super) struct Dogleg {
    /// Half the steepest decrease of the cost.
    gradient: DVector<f64>,
    /// Down the gradient to the lowest predicted cost.
    cauchy: DVector<f64>,
    /// To the lowest predicted cost.
    gauss_newton: DVector<f64>,
}

impl Dogleg {
    /// Solves the factorised equations of `system` with the right-hand side `gradient`.
    pub fn new(system: &System, gradient: DVector<f64>) -> Self {
        let mut gauss_newton = gradient.clone();
        system.solve(&mut gauss_newton);
        let curvature = system.quadratic_form(&gradient);
        let length = if curvature > 0.0 {
            gradient.norm_squared() / curvature
        } else {
            0.0
        };
        Self {
            cauchy: length * &gradient,
            gradient,
            gauss_newton,
        }
    }

    pub fn full_length(&self) -> f64 {
        self.gauss_newton.norm()
    }

    /// Returns the step of a length of at most `radius`: along the path from here over the Cauchy
    /// point to the Gauss-Newton step.
    pub fn within(&self, radius: f64) -> DVector<f64> {
        if self.full_length() <= radius {
            return self.gauss_newton.clone();
        }
        let down = self.cauchy.norm();
        if down >= radius {
            return radius / down * &self.cauchy;
        }
        // |cauchy + share along| = radius
        let along = &self.gauss_newton - &self.cauchy;
        let a = along.norm_squared();
        let b = self.cauchy.dot(&along);
        let c = down * down - radius * radius;
        let share = -c / (b + (b * b - a * c).sqrt());
        &self.cauchy + share * along
    }

    pub fn predicted(&self, system: &System, step: &DVector<f64>) -> f64 {
        2.0 * self.gradient.dot(step) - system.quadratic_form(step)
    }
}
