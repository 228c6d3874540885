//! Length and width of an object, and its centre by what is seen of it.
//!
//! A radar sees the ends of a vehicle, in one scan the near one, in another both, and at times only
//! a part of its side, which slides along it as the vehicle passes. So the centre is not that of
//! the returns: it is half of the size behind the near end, or before the far one, or anywhere
//! between, each as likely as the aspect and the prediction say (probabilistic data association:
//! Bar-Shalom and Tse, "Tracking in a cluttered environment with probabilistic data association",
//! 1975). Length and width begin as those of a car and follow what is seen, while the end that is
//! seen stays where it is.

use std::f64::consts::TAU;

use nalgebra::{Matrix2, Point2, Rotation2, Vector2};

use crate::ObjectsConfig;
use crate::returns::Return;

/// Shares by which length and width approach what is seen in a scan, if that is more and if it is
/// less.
const GAIN: [f64; 2] = [0.3, 0.1];
/// Share of the size that is missing from which on only one end is seen, and says nothing about it.
const ONE_END: f64 = 0.35;
/// Shares of the scans in which neither end of an axis is seen, but something between: seen
/// end-on, and from the side, where a panel may outshine the corners.
const BETWEEN: [f64; 2] = [0.1, 0.4];
/// Share of the other scans in which the far end is seen and the near one is not, seen end-on.
const FAR: f64 = 0.1;
/// Cosine between the line of sight and an axis from which on the object is seen end-on.
const END_ON: f64 = 0.35;
/// Step and number of the turns to either side in which the heading of a box is searched: up to
/// half a right angle, beyond which its side looks like its end.
const TURN_STEP_RAD: f64 = TAU / 120.0;
const TURN_STEPS: i32 = 15;
/// Returns of an echo, which are not independent: it fills as many range cells.
const CELLS_OF_ECHO: f64 = 4.0;
/// Largest squared distance of a return from the outline, in variances: more is no part of it.
const LARGEST_MISFIT: f64 = 9.0;
/// Share of what has been shown of the length that is kept from scan to scan.
const KEPT: f64 = 0.7;

/// The length and the width.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Extent {
    /// Along the heading and across it, m.
    pub size_m: [f64; 2],
    /// Running mean of the length between the returns of a scan, m.
    shown_m: f64,
}

/// An object as a scan shows it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Outline {
    /// From one end to the other, along the heading and across it, relative to the centre as
    /// predicted, m.
    pub spans_m: [[f64; 2]; 2],
}

/// The centre of an object as measured.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Centre {
    /// Offset from the one that the outline is relative to, m.
    pub offset: Vector2<f64>,
    /// Covariance, m².
    pub noise: Matrix2<f64>,
    /// The logarithm of the likelihood of what is seen by what was predicted.
    evidence: f64,
}

/// The sight of an object.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sight {
    /// Heading of the object, a unit vector.
    pub heading: Vector2<f64>,
    /// Line of sight to it, a unit vector.
    pub direction: Vector2<f64>,
    /// Covariance of the predicted centre, m².
    pub predicted: Matrix2<f64>,
    /// Covariance of the place of an end, m².
    pub noise: Matrix2<f64>,
}

/// A place of the centre along an axis, relative to the prediction.
struct Choice {
    at_m: f64,
    /// The variance of it beyond that of an end, m².
    variance_m2: f64,
    /// The probability of it before it is compared with the prediction.
    prior: f64,
}

impl Extent {
    /// The size of a new object.
    pub fn new(config: &ObjectsConfig) -> Self {
        Self {
            size_m: config.usual_size_m,
            shown_m: config.smallest_size_m[0],
        }
    }

    /// Returns the outline of the returns of a body, seen from a heading, relative to a centre.
    pub fn outline<'a>(
        body: impl Iterator<Item = &'a Return>,
        (centre, velocity): (&Point2<f64>, &Vector2<f64>),
        heading: &Vector2<f64>,
    ) -> Outline {
        let side = Vector2::new(-heading.y, heading.x);
        let mut spans_m = [[f64::INFINITY, f64::NEG_INFINITY]; 2];
        for found in body {
            let at = found.at_scan(velocity) - centre;
            for (span, at_m) in spans_m.iter_mut().zip([at.dot(heading), at.dot(&side)]) {
                *span = [span[0].min(at_m), span[1].max(at_m)];
            }
        }
        Outline { spans_m }
    }

    /// Returns the most likely centre.
    pub fn centre(&self, outline: &Outline, sight: &Sight) -> Centre {
        let mut found = Centre {
            offset: Vector2::zeros(),
            noise: sight.noise,
            evidence: 0.0,
        };
        for (axis, towards) in sight.axes().iter().enumerate() {
            let along = |matrix: &Matrix2<f64>| (towards.transpose() * matrix * towards)[0];
            let choices = self.choices(axis, outline, sight);
            let known_m2 = along(&sight.predicted) + along(&sight.noise);
            let (at_m, variance_m2, likelihood) = resolve(&choices, known_m2);
            found.offset += towards * at_m;
            found.noise += towards * towards.transpose() * variance_m2;
            found.evidence += likelihood.max(f64::MIN_POSITIVE).ln();
        }
        found
    }

    /// Returns by which angle the box is turned from the heading that is predicted, if that is
    /// normally distributed with a standard deviation, rad.
    pub fn turn<'a>(
        &self,
        body: impl Iterator<Item = &'a Return> + Clone,
        known: (&Point2<f64>, &Vector2<f64>),
        (sight, sigma_rad): (&Sight, f64),
    ) -> Turn {
        let fits: Vec<(f64, f64)> = (-TURN_STEPS..=TURN_STEPS)
            .map(|step| {
                let turn_rad = f64::from(step) * TURN_STEP_RAD;
                let sight = sight.turned(turn_rad);
                let fit = self.fit(body.clone(), known, &sight);
                (turn_rad, fit - 0.5 * (turn_rad / sigma_rad).powi(2))
            })
            .collect();
        let best = fits
            .iter()
            .map(|fit| fit.1)
            .fold(f64::NEG_INFINITY, f64::max);
        let weight = |fit: &(f64, f64)| (fit.1 - best).exp();
        let sum: f64 = fits.iter().map(weight).sum();
        let mean_rad = fits.iter().map(|fit| weight(fit) * fit.0).sum::<f64>() / sum;
        let squares = fits
            .iter()
            .map(|fit| weight(fit) * (fit.0 - mean_rad).powi(2));
        Turn {
            mean_rad,
            variance_rad2: squares.sum::<f64>() / sum + TURN_STEP_RAD.powi(2) / 12.0,
        }
    }

    /// Returns the logarithm of the likelihood of the returns of a body if they are on the outline
    /// of the box.
    fn fit<'a>(
        &self,
        body: impl Iterator<Item = &'a Return> + Clone,
        known: (&Point2<f64>, &Vector2<f64>),
        sight: &Sight,
    ) -> f64 {
        let outline = Self::outline(body.clone(), known, &sight.heading);
        let centre = self.centre(&outline, sight);
        let place = known.0 + centre.offset;
        let variance_m2 = 0.5 * sight.noise.trace();
        let [along, across] = sight.axes();
        let misfit = |found: &Return| {
            let at = found.at_scan(known.1) - place;
            let distance_m = self.distance_from_edge(at.dot(&along).abs(), at.dot(&across).abs());
            (distance_m.powi(2) / variance_m2).min(LARGEST_MISFIT)
        };
        let sum: f64 = body.map(misfit).sum();
        centre.evidence - 0.5 * sum / CELLS_OF_ECHO
    }

    /// The distance of a place from the nearest edge, m.
    fn distance_from_edge(&self, along_m: f64, across_m: f64) -> f64 {
        let [length_m, width_m] = self.size_m;
        let [ahead_m, aside_m] = [along_m - 0.5 * length_m, across_m - 0.5 * width_m];
        match ahead_m < 0.0 && aside_m < 0.0 {
            true => ahead_m.max(aside_m).abs(),
            false => ahead_m.max(0.0).hypot(aside_m.max(0.0)),
        }
    }

    /// The centre along an axis if its near end is seen, its far end, or neither.
    fn choices(&self, axis: usize, outline: &Outline, sight: &Sight) -> [Choice; 3] {
        let [low, high] = outline.spans_m[axis];
        let (middle, hidden_m) = (0.5 * (low + high), self.size_m[axis] - (high - low));
        let end_on = sight.end_on(axis);
        let away_m = 0.5 * hidden_m * end_on.signum();
        let between = BETWEEN[1] + (BETWEEN[0] - BETWEEN[1]) * end_on.abs();
        let far = (1.0 - between) * (0.5 + (FAR - 0.5) * end_on.abs());
        let choice = |at_m, variance_m2, prior| Choice {
            at_m,
            variance_m2,
            prior,
        };
        [
            choice(middle + away_m, 0.0, 1.0 - between - far),
            choice(middle - away_m, 0.0, far),
            choice(middle, hidden_m * hidden_m / 12.0, between),
        ]
    }

    /// Takes the size that a scan shows. Returns by how much the centre has moved by that, m: the
    /// end that is seen has not.
    pub fn update(
        &mut self,
        outline: &Outline,
        sight: &Sight,
        config: &ObjectsConfig,
    ) -> Vector2<f64> {
        let (smallest_m, largest_m) = (config.smallest_size_m, config.largest_size_m);
        let mut moved = Vector2::zeros();
        for (axis, towards) in sight.axes().iter().enumerate() {
            let [low, high] = outline.spans_m[axis];
            let before_m = self.size_m[axis];
            let excess_m = (high - low) - before_m;
            let gain = match excess_m / before_m {
                excess if excess > 0.0 => GAIN[0],
                excess if excess > -ONE_END => GAIN[1],
                _ => 0.0,
            };
            let size_m = before_m + gain * excess_m;
            self.size_m[axis] = size_m.clamp(smallest_m[axis], largest_m[axis]);
            moved += towards * (0.5 * (self.size_m[axis] - before_m) * sight.end_on(axis));
        }
        let [low, high] = outline.spans_m[0];
        self.shown_m = KEPT * self.shown_m + (1.0 - KEPT) * (high - low);
        moved
    }

    /// Returns whether what has been seen of it so far is shorter than any vehicle.
    pub fn is_an_end(&self, config: &ObjectsConfig) -> bool {
        self.shown_m < (1.0 - ONE_END) * config.smallest_size_m[0]
    }

    /// Takes a length that two ends show together. Returns whether a vehicle can be that long.
    pub fn lengthen(&mut self, length_m: f64, config: &ObjectsConfig) -> bool {
        let fits = (self.size_m[0]..=config.largest_size_m[0]).contains(&length_m);
        if fits {
            self.size_m[0] = length_m;
            self.shown_m = length_m;
        }
        fits
    }
}

/// The angle of a box from the heading that was predicted.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Turn {
    /// Mean, rad.
    pub mean_rad: f64,
    /// Variance, rad².
    pub variance_rad2: f64,
}

impl Sight {
    /// The sight of what is turned by an angle.
    pub fn turned(&self, turn_rad: f64) -> Self {
        Self {
            heading: Rotation2::new(turn_rad) * self.heading,
            ..*self
        }
    }

    /// Along the heading and across it, unit vectors.
    fn axes(&self) -> [Vector2<f64>; 2] {
        [self.heading, Vector2::new(-self.heading.y, self.heading.x)]
    }

    /// Returns how much an axis is seen end-on: 0 from the side, 1 if it points away from the
    /// sensor, -1 towards it.
    fn end_on(&self, axis: usize) -> f64 {
        (self.axes()[axis].dot(&self.direction) / END_ON).clamp(-1.0, 1.0)
    }
}

/// Returns mean and variance of the choices, each weighed by how well it fits a prediction of zero
/// with a variance `known_m2`, and the likelihood of them all.
fn resolve(choices: &[Choice], known_m2: f64) -> (f64, f64, f64) {
    let weight = |choice: &Choice| {
        let variance_m2 = known_m2 + choice.variance_m2;
        choice.prior * (-0.5 * choice.at_m.powi(2) / variance_m2).exp() / variance_m2.sqrt()
    };
    // No choice fits what is far from the prediction: then it is as if nothing was predicted.
    let fits: Vec<f64> = choices.iter().map(weight).collect();
    let sum: f64 = fits.iter().sum();
    let share = |index: usize| match sum > f64::MIN_POSITIVE {
        true => fits[index] / sum,
        false => choices[index].prior,
    };
    let mean = |of: &dyn Fn(&Choice) -> f64| -> f64 {
        let weighed = choices.iter().enumerate();
        weighed
            .map(|(index, choice)| share(index) * of(choice))
            .sum()
    };
    let at_m = mean(&|choice| choice.at_m);
    (
        at_m,
        mean(&|choice| choice.variance_m2 + (choice.at_m - at_m).powi(2)),
        sum,
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    const HALF_M: [f64; 2] = [2.2, 0.95];

    fn at(place: Vector2<f64>) -> Return {
        Return {
            at: place.into(),
            direction: Vector2::x(),
            range_m: 30.0,
            time_s: 0.0,
            doppler_s: 0.0,
            weight: 1.0,
            stands_out: true,
            share: 0.0,
        }
    }

    fn sight(direction: Vector2<f64>) -> Sight {
        Sight {
            heading: Vector2::x(),
            direction,
            predicted: Matrix2::identity(),
            noise: Matrix2::identity() * 0.01,
        }
    }

    /// The centre of what is seen of a car at the origin, if it is predicted elsewhere.
    fn centre(
        seen: &[Return],
        sight: &Sight,
        predicted: Vector2<f64>,
    ) -> (Vector2<f64>, Matrix2<f64>) {
        let known = (&predicted.into(), &Vector2::zeros());
        let outline = Extent::outline(seen.iter(), known, &sight.heading);
        let centre = Extent::new(&ObjectsConfig::default()).centre(&outline, sight);
        (predicted + centre.offset, centre.noise)
    }

    #[test]
    fn a_box_seen_from_all_sides_has_the_same_centre() {
        for step in 0..72 {
            let angle = TAU * f64::from(step) / 72.0;
            let direction = Vector2::new(angle.cos(), angle.sin());
            let mut seen = Vec::new();
            for (axis, other) in [(0, 1), (1, 0)] {
                // The face of each axis that looks towards the sensor.
                let sign = -direction[axis].signum();
                if direction[axis].abs() > 0.05 {
                    for share in [-1.0, -0.5, 0.0, 0.5, 1.0] {
                        let mut place = Vector2::zeros();
                        place[axis] = sign * HALF_M[axis];
                        place[other] = share * HALF_M[other];
                        seen.push(at(place));
                    }
                }
            }
            let (found, _) = centre(&seen, &sight(direction), Vector2::new(0.3, -0.2));
            assert!(found.norm() < 0.25, "{found} from {angle}");
        }
    }

    #[test]
    fn a_highlight_that_slides_along_the_side_leaves_the_centre_and_says_little() {
        for step in -10..=10 {
            let along_m = 0.2 * f64::from(step);
            let highlight = at(Vector2::new(along_m, -HALF_M[1]));
            let (found, noise) = centre(&[highlight], &sight(Vector2::y()), Vector2::zeros());
            assert!(found.norm() < 0.5, "{found} by {along_m}");
            let gain = 1.0 / (1.0 + noise[(0, 0)]);
            assert!((gain * found.x).abs() < 0.2, "{found} by {along_m}");
        }
    }

    /// The corners of a car at the origin, each an echo of four cells, and turned by an angle.
    fn corners(turn_rad: f64) -> Vec<Return> {
        let echo = |(along, across): (f64, f64)| {
            let corner = Vector2::new(along * HALF_M[0], across * HALF_M[1]);
            let place = Rotation2::new(turn_rad) * corner;
            (0..4).map(move |_| at(place))
        };
        let all = [(-1.0, -1.0), (-1.0, 1.0), (1.0, -1.0), (1.0, 1.0)];
        all.into_iter().flat_map(echo).collect()
    }

    /// The turn that some returns show of a car predicted at the origin and ahead.
    fn turn(seen: &[Return], sigma_rad: f64) -> Turn {
        let known = (&Point2::origin(), &Vector2::zeros());
        let sight = Sight {
            noise: Matrix2::identity() * 0.1,
            ..sight(Vector2::new(0.9, 0.4).normalize())
        };
        Extent::new(&ObjectsConfig::default()).turn(seen.iter(), known, (&sight, sigma_rad))
    }

    #[test]
    fn corners_show_by_which_angle_a_box_is_turned_whatever_the_angle_is() {
        for step in -6..=6 {
            let turned_rad = 0.1 * f64::from(step);
            let found = turn(&corners(turned_rad), 0.5);
            let sigma_rad = found.variance_rad2.sqrt();
            assert!(sigma_rad < 0.2, "{found:?} at {turned_rad}");
            let error_rad = found.mean_rad - turned_rad;
            assert!(
                error_rad.abs() < 2.0 * sigma_rad,
                "{found:?} at {turned_rad}"
            );
        }
    }

    #[test]
    fn a_single_echo_shows_no_turn_and_leaves_the_prediction() {
        for sigma_rad in [0.05, 0.2] {
            let found = turn(&corners(0.0)[..4], sigma_rad);
            assert!(found.mean_rad.abs() < 0.5 * sigma_rad, "{found:?}");
            assert!(found.variance_rad2.sqrt() > 0.7 * sigma_rad, "{found:?}");
        }
    }

    #[test]
    fn while_the_size_grows_the_end_that_is_seen_stays() {
        let config = ObjectsConfig::default();
        let mut extent = Extent::new(&config);
        let away = sight(Vector2::x());
        let mut centre = Vector2::zeros();
        for _ in 0..20 {
            // A lorry of 9 m, whose rear end is at -2.2 m.
            let outline = Outline {
                spans_m: [[-2.2 - centre.x, 6.8 - centre.x], [-0.95, 0.95]],
            };
            centre += extent.update(&outline, &away, &config);
            assert!((centre.x - 0.5 * extent.size_m[0] + 2.2).abs() < 1e-9);
        }
        assert!((extent.size_m[0] - 9.0).abs() < 0.05 && centre.y == 0.0);
        assert!(!extent.is_an_end(&config));
    }
}
