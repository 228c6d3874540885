//! Clusters of returns.

use nalgebra::{Point2, Vector2};

use crate::ObjectsConfig;
use crate::returns::Return;

/// Growth with the range of the largest distance across the beam between neighbouring returns of
/// one object, radians: two azimuths of 0.9 degrees.
const ACROSS_RAD: f64 = 0.031;

/// Some returns, by their numbers in the scan.
pub(crate) type Members = Vec<u32>;

/// Merges neighbouring returns, of those in `from`, to clusters, in the order of their first
/// returns.
pub(crate) fn clusters(returns: &[Return], from: &[u32], config: &ObjectsConfig) -> Vec<Cluster> {
    let mut free: Vec<u32> = from.to_vec();
    let mut found = Vec::new();
    while !free.is_empty() {
        let mut members = vec![free.remove(0)];
        let mut next = 0;
        while let Some(&member) = members.get(next) {
            let seed = &returns[member as usize];
            let joins = |other: &u32| are_neighbours(seed, &returns[*other as usize], config);
            let (near, far) = free.into_iter().partition::<Vec<u32>, _>(joins);
            members.extend(near);
            free = far;
            next += 1;
        }
        found.extend(Cluster::of(returns, members, config));
    }
    found
}

fn are_neighbours(a: &Return, b: &Return, config: &ObjectsConfig) -> bool {
    let apart = b.at - a.at;
    let along_m = apart.dot(&a.direction);
    let across_m = apart.perp(&a.direction);
    let across = config.cluster_across_m + ACROSS_RAD * a.range_m;
    (along_m / config.cluster_along_m).powi(2) + (across_m / across).powi(2) <= 1.0
}

/// Some returns of a scan with what they measure.
#[derive(Clone, Debug)]
pub(crate) struct Cluster {
    pub members: Members,
    /// The members that are not skirts of stronger ones.
    body: Members,
    pub measured: Measurement,
}

impl Cluster {
    /// Measures some returns; `None` without any.
    pub fn of(returns: &[Return], members: Members, config: &ObjectsConfig) -> Option<Self> {
        let weight = |member: &u32| returns[*member as usize].weight;
        let strongest = members.iter().map(weight).fold(0.0, f64::max);
        let is_of_body = |member: &u32| weight(member) >= strongest - config.skirt_weight;
        let body: Members = members.iter().copied().filter(is_of_body).collect();
        let measured = Measurement {
            weight: members.iter().map(weight).sum(),
            returns: members.len(),
            ..Measurement::of(body.iter().map(|member| &returns[*member as usize]))?
        };
        Some(Self {
            members,
            body,
            measured,
        })
    }

    /// The returns that are not skirts of stronger ones.
    pub fn body<'a>(&'a self, returns: &'a [Return]) -> impl Iterator<Item = &'a Return> + Clone {
        self.body.iter().map(|member| &returns[*member as usize])
    }
}

/// A cluster as one measurement: of its near end, which all aspects of an object show, and which
/// does not move along it while its other returns come and go.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Measurement {
    /// Position, m: of the near end along the line of sight, of the middle across it.
    pub at: Point2<f64>,
    /// Time of the near end relative to the scan's, s: straight ahead the two sides of an object
    /// are seen a whole sweep apart.
    pub time_s: f64,
    /// Lengthening of the range for each m/s away from the sensor, m.
    pub doppler_s: f64,
    /// Direction from the sensor, a unit vector.
    pub direction: Vector2<f64>,
    /// Range, m.
    pub range_m: f64,
    /// Sum of the weights of the returns,
    pub weight: f64,
    /// and their number.
    pub returns: usize,
}

impl Measurement {
    fn of<'a>(body: impl Iterator<Item = &'a Return> + Clone) -> Option<Self> {
        let weight = body.clone().map(|found| found.weight).sum();
        let mean = body.clone().fold(Vector2::zeros(), |sum, found| {
            sum + found.direction * found.weight
        });
        let nearer = |a: &&Return, b: &&Return| a.range_m.total_cmp(&b.range_m);
        let near = body.clone().min_by(nearer)?;
        let direction = mean.try_normalize(1e-9).unwrap_or(near.direction);
        let side = Vector2::new(-direction.y, direction.x);
        let returns = body.clone().count();
        let across = body.map(|found| (found.at - near.at).dot(&side));
        let (low, high) = across.fold((0.0, 0.0), |(low, high): (f64, f64), at_m| {
            (low.min(at_m), high.max(at_m))
        });
        Some(Self {
            at: near.at + side * (0.5 * (low + high)),
            time_s: near.time_s,
            doppler_s: near.doppler_s,
            direction,
            range_m: near.range_m,
            weight,
            returns,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(x: f64, y: f64, weight: f64) -> Return {
        let place = Point2::new(x, y);
        Return {
            at: place,
            direction: place.coords.normalize(),
            range_m: place.coords.norm(),
            time_s: 0.001 * x,
            doppler_s: 0.0,
            weight,
            stands_out: true,
            share: 0.0,
        }
    }

    fn cluster(returns: &[Return]) -> Cluster {
        let members = (0..returns.len() as u32).collect();
        Cluster::of(returns, members, &ObjectsConfig::default()).expect("there are returns")
    }

    #[test]
    fn the_near_end_is_measured_at_its_own_time_and_is_the_same_without_the_far_end() {
        let near = [at(20.0, -0.9, 0.6), at(20.1, 0.9, 0.9)];
        let all = [near.as_slice(), &[at(24.3, -0.9, 1.0), at(24.3, 0.9, 0.8)]].concat();
        let (near, all) = (cluster(&near).measured, cluster(&all).measured);
        assert!((near.at - all.at).norm() < 0.1, "{near:?} {all:?}");
        assert!((all.at - Point2::new(20.0, 0.0)).norm() < 0.2, "{all:?}");
        assert!((all.time_s - 0.02).abs() < 2e-4);
        assert_eq!((near.returns, all.returns), (2, 4));
    }

    #[test]
    fn skirts_of_a_strong_echo_are_not_of_the_body() {
        let returns = [at(18.5, 0.0, 0.3), at(20.0, 0.0, 1.0), at(21.5, 0.2, 0.6)];
        let cluster = cluster(&returns);
        assert_eq!(cluster.body(&returns).count(), 2);
        assert!((cluster.measured.range_m - 20.0).abs() < 1e-9);
        assert!((cluster.measured.weight - 1.9).abs() < 1e-9);
    }
}
