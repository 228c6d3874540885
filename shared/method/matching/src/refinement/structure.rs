//! The direction that standing structure leaves undetermined: along the walls of a tunnel, which
//! look the same everywhere.
//!
//! The information matrix of an alignment does not show it. Speckle gives each keyframe gradients
//! of its own. Some of them remain in the mean of all keyframes, and their squares count as
//! information. But the speckle gradients of different keyframes are independent, while standing
//! structure gives all keyframes the same gradients. So the products of gradients of different
//! keyframes are the information by structure, since speckle contributes zero in the mean.

use gyre_geometry::Pose;
use nalgebra::{Matrix2, Matrix3, SymmetricEigen, UnitVector2, Vector2, Vector3};

use super::{alignment::Alignment, local_map::LocalMap, points::DeskewedPoints};

/// The least number of keyframes that distinguish structure from speckle.
const MIN_KEYFRAMES: usize = 4;
/// Share of the information along a direction that is by structure, below which the direction is
/// undetermined: most of what seems to determine it is speckle.
const MIN_SHARE: f64 = 0.5;
/// The information by structure along the weakest direction, relative to the strongest, below which
/// the direction is undetermined: the match is then often metres away from the true place.
const MIN_RATIO: f64 = 0.2;
/// The same, below which another sensor that contradicts is right, and below which a direction
/// stays undetermined.
const SAFE_RATIO: f64 = 0.4;
const POINTS: usize = 400;

/// The direction with the least information by structure about the place of a scan.
#[derive(Debug, Clone, Copy)]
pub(super) struct WeakestDirection {
    pub along: UnitVector2<f64>,
    share: f64,
    ratio: f64,
}

impl WeakestDirection {
    /// Finds it for a scan that is aligned with the map; `None` with too few keyframes for a
    /// decision, or if there is so much information in all directions that it is not examined,
    /// which saves the time.
    pub fn of(map: &LocalMap, points: &DeskewedPoints, alignment: &Alignment) -> Option<Self> {
        let all = SymmetricEigen::new(of_place(&alignment.normal.information)?).eigenvalues;
        if map.len() < MIN_KEYFRAMES || all.min() >= SAFE_RATIO * all.max() {
            return None;
        }
        Self::at(map, points, &alignment.pose, |_| Vector2::zeros())
    }

    /// Finds it for a scan placed by the search, in a map whose keyframes are placed by the search:
    /// the scan is [`Keyframe::ahead_m`](super::Keyframe::ahead_m) beyond them.
    pub fn by_search(
        map: &LocalMap,
        points: &DeskewedPoints,
        pose: &Pose,
        ahead_m: Vector2<f64>,
    ) -> Option<Self> {
        if map.len() < MIN_KEYFRAMES {
            return None;
        }
        Self::at(map, points, pose, |of_keyframe| ahead_m - of_keyframe)
    }

    fn at(
        map: &LocalMap,
        points: &DeskewedPoints,
        pose: &Pose,
        beyond_m: impl Fn(Vector2<f64>) -> Vector2<f64>,
    ) -> Option<Self> {
        let informations = Informations::of(map, points, pose, beyond_m);
        let (whole, structure) = (of_place(&informations.whole)?, informations.by_structure()?);
        let eigen = SymmetricEigen::new(structure);
        let (weakest, strongest) = (eigen.eigenvalues.imin(), eigen.eigenvalues.max());
        let along = eigen.eigenvectors.column(weakest).into_owned();
        let whole = (along.transpose() * whole * along)[0];
        Some(Self {
            along: UnitVector2::new_normalize(along),
            share: eigen.eigenvalues[weakest] / whole,
            ratio: eigen.eigenvalues[weakest] / strongest,
        })
    }

    /// Returns whether nothing that stands still determines the place along it. A scan without
    /// structure gives a value that is not a number, and is undetermined.
    pub fn is_undetermined(&self) -> bool {
        self.share < MIN_SHARE || self.ratio < MIN_RATIO
    }

    /// Returns whether the match can be wrong along it: another sensor contradicts it, or the scan
    /// before was undetermined.
    pub fn is_doubtful(&self) -> bool {
        self.is_undetermined() || self.ratio < SAFE_RATIO
    }
}

/// The information about the place in a matrix over place and heading, with the heading's
/// uncertainty from the scan.
fn of_place(information: &Matrix3<f64>) -> Option<Matrix2<f64>> {
    without_heading(information, information[(2, 2)])
}

fn without_heading(information: &Matrix3<f64>, heading: f64) -> Option<Matrix2<f64>> {
    let across = information.fixed_view::<2, 1>(0, 2);
    let place = information.fixed_view::<2, 2>(0, 0) - across * across.transpose() / heading;
    place.iter().all(|it| it.is_finite()).then_some(place)
}

/// The information over (x, y, yaw) by the mean of the keyframes, as in
/// [`super::normal_equations`], from some of the points.
struct Informations {
    whole: Matrix3<f64>,
    /// The part that is of squares of the gradients of single keyframes.
    of_squares: Matrix3<f64>,
    keyframes: f64,
}

impl Informations {
    fn of(
        map: &LocalMap,
        points: &DeskewedPoints,
        pose: &Pose,
        beyond_m: impl Fn(Vector2<f64>) -> Vector2<f64>,
    ) -> Self {
        let (mut whole, mut of_squares) = (Matrix3::zeros(), Matrix3::zeros());
        let keyframes = map.len() as f64;
        let places = points.x_m.iter().zip(&points.y_m).zip(&points.weight);
        let step = points.x_m.len().div_ceil(POINTS).max(1);
        for ((x_m, y_m), weight) in places.step_by(step) {
            let arm = pose.rotation * Vector2::new(f64::from(*x_m), f64::from(*y_m));
            let place = pose.translation.vector + arm;
            let (mut sum, mut squares) = (Vector3::zeros(), Matrix3::zeros());
            for (image, ahead_m) in map.fine_images() {
                let slope = image.slope(place + beyond_m(ahead_m));
                let gradient = Vector3::new(slope.x, slope.y, arm.x * slope.y - arm.y * slope.x);
                sum += gradient;
                squares += gradient * gradient.transpose();
            }
            let weight = f64::from(*weight) / (keyframes * keyframes);
            whole += sum * sum.transpose() * weight;
            of_squares += squares * weight;
        }
        Self {
            whole,
            of_squares,
            keyframes,
        }
    }

    /// The information about the place by products of gradients of different keyframes: as much as
    /// if all products were of these.
    fn by_structure(&self) -> Option<Matrix2<f64>> {
        let shared = (self.whole - self.of_squares) * (self.keyframes / (self.keyframes - 1.0));
        // The heading is known, because the walls determine it.
        without_heading(&shared, self.whole[(2, 2)])
    }
}
