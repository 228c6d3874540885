//! Clusters of returns.

use nalgebra::{Point2, Vector2};

use crate::returns::Return;

/// Largest distance along the beam between neighbouring returns of one object, m: the two ends of a
/// van, with nothing between them.
const ALONG_M: f64 = 5.0;
/// Largest distance across the beam near the sensor, m,
const ACROSS_M: f64 = 2.5;
/// and its growth with the range, radians: two azimuths of 0.9 degrees.
const ACROSS_RAD: f64 = 0.031;

/// Some returns, by their numbers in the scan.
pub(crate) type Members = Vec<u32>;

/// Merges neighbouring returns, of those in `from`, to clusters. Both are by the numbers of the
/// returns; the clusters are in the order of their first returns.
pub(crate) fn clusters(returns: &[Return], from: &[u32]) -> Vec<Members> {
    let mut free: Vec<u32> = from.to_vec();
    let mut found = Vec::new();
    while !free.is_empty() {
        let mut members = vec![free.remove(0)];
        let mut next = 0;
        while let Some(&member) = members.get(next) {
            let seed = &returns[member as usize];
            let joins = |other: &u32| are_neighbours(seed, &returns[*other as usize]);
            let (near, far) = free.into_iter().partition::<Vec<u32>, _>(joins);
            members.extend(near);
            free = far;
            next += 1;
        }
        found.push(members);
    }
    found
}

fn are_neighbours(a: &Return, b: &Return) -> bool {
    let apart = b.at - a.at;
    let along_m = apart.dot(&a.direction);
    let across_m = apart.perp(&a.direction);
    let across = ACROSS_M + ACROSS_RAD * a.range_m;
    (along_m / ALONG_M).powi(2) + (across_m / across).powi(2) <= 1.0
}

/// A cluster as one measurement.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Measurement {
    /// Weighted means over the returns: position, m,
    pub at: Point2<f64>,
    /// time relative to the scan's, s,
    pub time_s: f64,
    /// lengthening of the range for each m/s away from the sensor, m,
    pub doppler_s: f64,
    /// and direction from the sensor, a unit vector.
    pub direction: Vector2<f64>,
    /// Range, m.
    pub range_m: f64,
    /// Sum of the weights of the returns,
    pub weight: f64,
    /// and their number.
    pub returns: usize,
}

impl Measurement {
    /// Averages some returns, of which there is one at least.
    pub fn of(returns: &[Return], members: &[u32]) -> Self {
        let mut sum = [0.0; 6];
        for found in members.iter().map(|member| &returns[*member as usize]) {
            let (weight, at) = (found.weight, found.at);
            let values = [
                1.0,
                at.x,
                at.y,
                found.time_s,
                found.doppler_s,
                found.range_m,
            ];
            sum.iter_mut()
                .zip(values)
                .for_each(|(sum, value)| *sum += weight * value);
        }
        let [weight, x, y, time_s, doppler_s, range_m] = sum;
        let first = members.first().map(|member| &returns[*member as usize]);
        let mean = members.iter().fold(Vector2::zeros(), |sum, member| {
            let found = &returns[*member as usize];
            sum + found.direction * found.weight
        });
        let direction = mean
            .try_normalize(1e-9)
            .or(first.map(|found| found.direction))
            .unwrap_or_else(Vector2::x);
        let centroid = Point2::new(x, y) / weight;
        let at = centroid + middle(returns, members, &centroid, &direction);
        Self {
            at,
            time_s: time_s / weight,
            doppler_s: doppler_s / weight,
            direction,
            range_m: range_m / weight,
            weight,
            returns: members.len(),
        }
    }
}

/// Returns how far the middle between the ends of some returns, along the line of sight and across
/// it, is from a place: it depends less than their mean on which of them are strong.
fn middle(
    returns: &[Return],
    members: &[u32],
    place: &Point2<f64>,
    direction: &Vector2<f64>,
) -> Vector2<f64> {
    let side = Vector2::new(-direction.y, direction.x);
    let middle = |axis: &Vector2<f64>| {
        let along = members
            .iter()
            .map(|member| (returns[*member as usize].at - place).dot(axis));
        let (low, high) = along.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), at| {
            (low.min(at), high.max(at))
        });
        axis * (0.5 * (low + high))
    };
    middle(direction) + middle(&side)
}
