//! Two scans of one place: their relative pose, and the slope of their overlap by the facts.

use gyre_geometry::Pose;
use nalgebra::{Matrix3, Rotation2, SMatrix, SVector, Vector2, Vector3};

use crate::{
    drive::{Drive, Track},
    facts::{FACTS, FactVector, displacements},
    image::Image,
};

const ITERATIONS: usize = 12;
const MIN_STEP: [f64; 3] = [2e-4, 2e-4, 4e-6];
/// The displacement of a point by each fact, by x and y.
type Displacement = SMatrix<f64, 2, FACTS>;

/// A scan deskewed under assumed facts, with its images.
pub(crate) struct View {
    velocity_mps: Vector2<f64>,
    points: Vec<Seen>,
    /// The image of all points; if chirps alternate, first of rising chirps, then of falling ones.
    images: Vec<Image>,
}

struct Seen {
    at: Vector2<f64>,
    weight: f64,
    /// The sign of its Doppler shift: 1, or the chirp's sign if chirps alternate.
    chirp: f64,
    displacement: Displacement,
}

/// Two views at the relative pose where they overlap best.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PairSlope {
    /// The pose of the first view in the frame of the second one.
    pub pose: Pose,
    /// The derivative of the overlap by the facts, for points of weight 1 in all: where they are
    /// right it vanishes.
    pub slope: FactVector,
    pub overlap: f64,
}

impl View {
    pub fn new(drive: &Drive, scan: usize, track: &Track) -> Self {
        let points = drive.points(scan, &track.change);
        let twist = &track.twists[scan];
        let refinement = &drive.config().refinement;
        let points: Vec<Seen> = points
            .iter()
            .filter(|point| point.weight > 0.0)
            .map(|point| {
                let at = point.deskewed(twist).coords;
                let chirp = match drive.alternates {
                    true => f64::from(point.doppler_s).signum(),
                    false => 1.0,
                };
                Seen {
                    at,
                    weight: f64::from(point.weight.min(1.0)),
                    chirp,
                    displacement: displacements(at, chirp, &twist.linear_mps(), drive.sense),
                }
            })
            .collect();
        let draw = |chirp: f64| {
            let drawn = points.iter().filter(|point| point.chirp == chirp);
            let drawn: Vec<[f64; 3]> = drawn.map(|p| [p.at.x, p.at.y, p.weight]).collect();
            Image::draw(&drawn, refinement.cell_m, refinement.reach_m)
        };
        let chirps = &[1.0, -1.0][..1 + usize::from(drive.alternates)];
        Self {
            velocity_mps: twist.linear_mps(),
            images: chirps.iter().map(|chirp| draw(*chirp)).collect(),
            points,
        }
    }

    /// The image to compare with a point of another view, and the sign of its Doppler shifts. If
    /// chirps alternate, the image is of the opposite chirp, which a wrong Doppler coefficient
    /// moves the other way. Images of one chirp would coincide with any coefficient.
    fn image_for(&self, point: &Seen) -> (&Image, f64) {
        match self.images.as_slice() {
            [rising, _] if point.chirp < 0.0 => (rising, 1.0),
            [_, falling] => (falling, -1.0),
            images => (&images[0], 1.0),
        }
    }
}

#[derive(Default)]
struct Sums {
    cost: f64,
    weight: f64,
    gradient: Vector3<f64>,
    information: Matrix3<f64>,
    slope: FactVector,
}

/// Aligns two views, each with the image of the other, and returns the slopes of their overlap by
/// the facts.
pub(crate) fn compare(drive: &Drive, a: &View, b: &View, initial: &Pose) -> Option<PairSlope> {
    let mut pose = *initial;
    let mut sums = sum(drive, a, b, &pose, false);
    let mut damping = 1e-3;
    for _ in 0..ITERATIONS {
        let mut damped = sums.information;
        (0..3).for_each(|k| damped[(k, k)] *= 1.0 + damping);
        let step = damped.cholesky()?.solve(&sums.gradient);
        let next = Pose::new(
            pose.translation.vector + step.xy(),
            pose.rotation.angle() + step.z,
        );
        let there = sum(drive, a, b, &next, false);
        if there.cost < sums.cost {
            (pose, sums) = (next, there);
            damping = (damping * 0.3).max(1e-4);
        } else {
            damping *= 8.0;
            if damping > 1e4 {
                break;
            }
        }
        if step.iter().zip(MIN_STEP).all(|(s, min)| s.abs() < min) {
            break;
        }
    }
    let sums = sum(drive, a, b, &pose, true);
    (sums.weight > 0.0).then(|| PairSlope {
        pose,
        slope: sums.slope / sums.weight,
        overlap: 1.0 - sums.cost / sums.weight,
    })
}

fn sum(drive: &Drive, a: &View, b: &View, pose: &Pose, facts: bool) -> Sums {
    let mut sums = Sums::default();
    let rotation = Rotation2::new(pose.rotation.angle());
    let translation = pose.translation.vector;
    let quarter = |v: Vector2<f64>| Vector2::new(-v.y, v.x);
    for point in &a.points {
        let turned = rotation * point.at;
        let at = turned + translation;
        let along =
            SMatrix::<f64, 2, 3>::from_columns(&[Vector2::x(), Vector2::y(), quarter(turned)]);
        sums.add(drive, point, b, at, &along, facts.then_some(&rotation));
    }
    let back = rotation.inverse();
    for point in &b.points {
        let at = back * (point.at - translation);
        let along = SMatrix::<f64, 2, 3>::from_columns(&[
            -(back * Vector2::x()),
            -(back * Vector2::y()),
            -quarter(at),
        ]);
        sums.add(drive, point, a, at, &along, facts.then_some(&back));
    }
    sums
}

impl Sums {
    /// Adds a point that lies `at` a place of a view and moves `along`; with its `turn` into the
    /// view also the slopes by the facts.
    fn add(
        &mut self,
        drive: &Drive,
        point: &Seen,
        view: &View,
        at: Vector2<f64>,
        along: &SMatrix<f64, 2, 3>,
        turn: Option<&Rotation2<f64>>,
    ) {
        self.weight += point.weight;
        let (image, chirp) = view.image_for(point);
        let Some(reading) = image.read(at) else {
            self.cost += point.weight;
            return;
        };
        let missing = 1.0 - reading.value;
        let j: SVector<f64, 3> = along.transpose() * reading.slope;
        self.cost += point.weight * missing * missing;
        self.gradient += j * (point.weight * missing);
        self.information += j * j.transpose() * point.weight;
        if let Some(turn) = turn {
            let displaced = displacements(at, chirp, &view.velocity_mps, drive.sense);
            let relative = *turn * point.displacement - displaced;
            self.slope += relative.transpose() * reading.slope * (point.weight * missing);
        }
    }
}
