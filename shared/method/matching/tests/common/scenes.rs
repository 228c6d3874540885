//! Generated point scans with exact truth: reflectors in the plane, seen by a moving sensor that
//! scans clockwise.

use gyre_geometry::{
    ComposedMotion, Pose, SparsePoint, pose,
    samples::{AllEvidence, Evidence, SensorConfigs, Witness},
};
use gyre_matching::{Refined, RefinementConfig, Refiner, Searched, Verdict};
use nalgebra::{Point2, Vector2, Vector3};

use super::Numbers;

/// Time of a sweep and from one scan to the next, s.
pub const SWEEP_S: f64 = 0.25;
/// Range of the sensor, m.
const VISIBLE_M: std::ops::RangeInclusive<f64> = 5.0..=95.0;
/// Capacity of a scan, points.
pub const CAPACITY: usize = 4096;

/// A line that gives a number of points to each scan, at other positions along it each time. A post
/// has no length.
#[derive(Debug, Clone, Copy)]
pub struct Reflector {
    pub from: Vector2<f64>,
    pub along: Vector2<f64>,
    pub points: usize,
}

/// Four walls about `middle`, turned, each with five points.
fn house(middle: Vector2<f64>, [length, width]: [f64; 2], yaw: f64) -> [Reflector; 4] {
    let pose = Pose::new(middle, yaw);
    let corner = |k: usize| {
        let (ahead, aside) = [(0.5, 0.5), (-0.5, 0.5), (-0.5, -0.5), (0.5, -0.5)][k % 4];
        (pose * Point2::new(ahead * length, aside * width)).coords
    };
    std::array::from_fn(|k| Reflector {
        from: corner(k),
        along: corner(k + 1) - corner(k),
        points: 5,
    })
}

pub fn wall(from: [f64; 2], to: [f64; 2], points: usize) -> Reflector {
    let from = Vector2::from(from);
    Reflector {
        from,
        along: Vector2::from(to) - from,
        points,
    }
}

pub fn post(at: [f64; 2]) -> Reflector {
    wall(at, at, 1)
}

/// Posts all over an area `[from, to]` of x and y, one on every `area_m2`.
pub fn posts([x, y]: [[f64; 2]; 2], area_m2: f64, seed: u64) -> Vec<Reflector> {
    let mut numbers = Numbers(seed);
    let count = ((x[1] - x[0]) * (y[1] - y[0]) / area_m2) as usize;
    let mut within = |[from, to]: [f64; 2]| from + (to - from) * numbers.next();
    (0..count).map(|_| post([within(x), within(y)])).collect()
}

/// Houses and posts all over an area: some 800 points a scan.
pub fn town(area: [[f64; 2]; 2], seed: u64) -> Vec<Reflector> {
    let mut numbers = Numbers(seed);
    let houses = posts(area, 1000.0, seed + 1).into_iter().flat_map(|place| {
        let size = [8.0 + 8.0 * numbers.next(), 6.0 + 4.0 * numbers.next()];
        house(place.from, size, numbers.within(0.3))
    });
    houses.chain(posts(area, 100.0, seed + 2)).collect()
}

/// A drive that accelerates or turns, not both.
#[derive(Debug, Clone, Copy)]
pub struct Drive {
    pub speed_mps: f64,
    pub acceleration_mps2: f64,
    pub yaw_rate_radps: f64,
    pub scans: usize,
}

impl Drive {
    pub fn steady(speed_mps: f64, yaw_rate_deg: f64, scans: usize) -> Self {
        Self {
            speed_mps,
            acceleration_mps2: 0.0,
            yaw_rate_radps: yaw_rate_deg.to_radians(),
            scans,
        }
    }

    pub fn speed(&self, time_s: f64) -> f64 {
        self.speed_mps + self.acceleration_mps2 * time_s
    }

    pub fn length_m(&self, time_s: f64) -> f64 {
        (self.speed_mps + 0.5 * self.acceleration_mps2 * time_s) * time_s
    }

    pub fn pose(&self, k: usize) -> Pose {
        let time_s = k as f64 * SWEEP_S;
        arc(self.length_m(time_s), self.yaw_rate_radps * time_s)
    }
}

/// A vehicle that slows down from 10 m/s.
pub fn slower(scans: usize) -> Drive {
    Drive {
        acceleration_mps2: -0.2,
        ..Drive::steady(10.0, 0.0, scans)
    }
}

fn arc(length: f64, turn: f64) -> Pose {
    let (sin, cos) = turn.sin_cos();
    let [ahead, aside] = if turn.abs() < 1e-9 {
        [1.0, 0.5 * turn]
    } else {
        [sin / turn, (1.0 - cos) / turn]
    };
    Pose::new(Vector2::new(ahead, aside) * length, turn)
}

#[derive(Debug, Clone, Copy, Default)]
pub struct Sensor {
    pub noise_m: f64,
    /// Ranges are too short by this for each m/s of approach, s.
    pub doppler_s: f64,
    pub seed: u64,
}

/// Ranges that are noisy, and right in the mean.
pub const NOISY: Sensor = Sensor {
    noise_m: 0.1,
    doppler_s: 0.0,
    seed: 1,
};

pub const LITTLE_NOISE: Sensor = Sensor {
    noise_m: 0.05,
    ..NOISY
};

impl Sensor {
    /// Scan `k` of a drive. The velocity stays the same during the sweep.
    pub fn scan(&self, scene: &[Reflector], drive: &Drive, k: usize) -> Vec<SparsePoint> {
        let mut numbers = Numbers(self.seed << 32 | k as u64);
        let (pose, speed) = (drive.pose(k), drive.speed(k as f64 * SWEEP_S));
        let mut points = Vec::with_capacity(CAPACITY);
        for reflector in scene {
            for _ in 0..reflector.points {
                let place = reflector.from + reflector.along * numbers.next();
                let weight = 0.3 + 0.7 * numbers.next();
                // The sum of twelve uniform numbers is close to normal.
                let normal = (0..12).map(|_| numbers.next()).sum::<f64>() - 6.0;
                // The beam need not be followed to points far beyond the range.
                if (pose.translation.vector - place).norm() > 2.0 * VISIBLE_M.end() {
                    continue;
                }
                let sensor = |t: f64| pose * arc(speed * t, drive.yaw_rate_radps * t);
                let seen = |t: f64| sensor(t).inverse() * Point2::from(place);
                let Some(time_s) = swept(seen) else { continue };
                let at = seen(time_s).coords;
                if !VISIBLE_M.contains(&at.norm()) {
                    continue;
                }
                let approach = Vector2::new(speed, 0.0);
                let sight = at.normalize();
                let shift = self.noise_m * normal - self.doppler_s * sight.dot(&approach);
                let at = at + sight * shift;
                points.push(point([at.x, at.y, time_s, weight, self.doppler_s]));
            }
        }
        points
    }
}

pub fn point(values: [f64; 5]) -> SparsePoint {
    let [x_m, y_m, time_s, weight, doppler_s] = values.map(|v| v as f32);
    SparsePoint {
        x_m,
        y_m,
        time_s,
        weight,
        doppler_s,
    }
}

pub fn noise(seed: u64) -> Vec<SparsePoint> {
    let mut numbers = Numbers(seed);
    let mut place = || {
        [
            numbers.within(65.0),
            numbers.within(65.0),
            numbers.within(0.125),
        ]
    };
    let points = (0..900).map(|_| place());
    points
        .map(|[x, y, time]| point([x, y, time, 0.65, 0.0]))
        .collect()
}

/// The time when the beam, clockwise from straight ahead, meets a reflector that is `seen` at a
/// position at each time: s from the middle of the sweep. `None` if the reflector crosses the seam.
fn swept(seen: impl Fn(f64) -> Point2<f64>) -> Option<f64> {
    let meets = |t: f64| {
        let at = seen(t);
        let share = (-at.y).atan2(at.x).rem_euclid(std::f64::consts::TAU) / std::f64::consts::TAU;
        SWEEP_S * (share - 0.5)
    };
    let mut time_s = 0.0;
    for _ in 0..20 {
        let next_s = meets(time_s);
        if (next_s - time_s).abs() < 1e-12 {
            return Some(next_s);
        }
        time_s = next_s;
    }
    None
}

pub struct Run {
    pub drive: Drive,
    /// Motion from scan k to k + 1.
    pub refined: Vec<Refined>,
}

#[derive(Debug, Clone, Copy)]
pub struct Errors {
    pub yaw_deg: f64,
    /// Distance from the true position at the end, m.
    pub shift_m: f64,
    pub worst_m: f64,
    pub worst_deg: f64,
}

impl Run {
    pub fn errors(&self) -> Errors {
        self.errors_from(0)
    }

    pub fn errors_from(&self, first: usize) -> Errors {
        let (mut pose, mut worst_m, mut worst_deg) = (self.drive.pose(first), 0.0_f64, 0.0_f64);
        for k in first..self.refined.len() {
            let motion = self.refined[k].motion.motion;
            let off = true_motion(&self.drive, k).inv_mul(&motion);
            worst_m = worst_m.max(off.translation.vector.norm());
            worst_deg = worst_deg.max(off.rotation.angle().to_degrees().abs());
            pose *= motion;
        }
        let off = self.drive.pose(self.refined.len()).inv_mul(&pose);
        let yaw_deg = off.rotation.angle().to_degrees();
        Errors {
            yaw_deg,
            shift_m: off.translation.vector.norm(),
            worst_m,
            worst_deg,
        }
    }
}

fn true_motion(drive: &Drive, k: usize) -> Pose {
    drive.pose(k).inv_mul(&drive.pose(k + 1))
}

/// The true motion to scan k + 1 with the errors of a search, up to a quarter of a metre and half a
/// degree.
pub fn searched(drive: &Drive, k: usize) -> Pose {
    let mut numbers = Numbers(0x5ea2c4 + k as u64);
    let off = Vector3::from_fn(|_, _| numbers.within(1.0));
    true_motion(drive, k) * Pose::new(off.xy() * 0.25, off.z * 0.5_f64.to_radians())
}

/// A search that finds any way from scan `inside` on.
pub fn search_until(inside: usize, drive: &Drive) -> impl FnMut(usize) -> Pose {
    let mut numbers = Numbers(7);
    move |k| match k < inside {
        true => searched(drive, k - 1),
        false => pose(2.0 + numbers.within(6.0), 0.0, 0.0),
    }
}

/// The numbers of the scans behind the motions for which `is_one` holds; the first motion leads to
/// scan 1.
pub fn scans_where(refined: &[Refined], is_one: impl Fn(&Refined) -> bool) -> Vec<usize> {
    let ones = (1..).zip(refined).filter(|(_, it)| is_one(it));
    ones.map(|(k, _)| k).collect()
}

/// The displacement over scans by the motions against the true one, and its standard deviation
/// ahead, m.
pub fn off(drive: &Drive, refined: &[Refined], over: std::ops::Range<usize>) -> (Pose, f64) {
    let mut composed = ComposedMotion::of(&refined[over.start].motion);
    for refined in &refined[over.start + 1..over.end] {
        composed = composed.then(&refined.motion);
    }
    let truth = drive.pose(over.start).inv_mul(&drive.pose(over.end));
    let motion = composed.motion;
    (
        truth.inv_mul(&motion.motion),
        motion.covariance[(0, 0)].sqrt(),
    )
}

pub fn scans(scene: &[Reflector], drive: &Drive, sensor: &Sensor) -> Vec<Vec<SparsePoint>> {
    (0..drive.scans)
        .map(|k| sensor.scan(scene, drive, k))
        .collect()
}

pub fn refiner() -> Refiner {
    refiner_with(&SensorConfigs::default())
}

pub fn refine(drive: &Drive, scans: &[Vec<SparsePoint>]) -> Run {
    let mut refiner = refiner();
    Run {
        drive: *drive,
        refined: refine_on(&mut refiner, drive, scans, 0..scans.len() - 1),
    }
}

/// The motions from each scan `k` of a range to the one after.
pub fn refine_on(
    refiner: &mut Refiner,
    drive: &Drive,
    scans: &[Vec<SparsePoint>],
    range: std::ops::Range<usize>,
) -> Vec<Refined> {
    range
        .map(|k| {
            refiner.refine(&Searched::by_radar(
                k as u64 + 1,
                &scans[k + 1],
                &scans[k],
                &searched(drive, k),
                SWEEP_S,
            ))
        })
        .collect()
}

/// Refines the motions to each scan but the first, with the evidence that comes with each scan and
/// the searched motion.
pub fn refine_aided(
    refiner: &mut Refiner,
    scans: &[Vec<SparsePoint>],
    evidence: impl Fn(usize) -> AllEvidence,
    mut search: impl FnMut(usize) -> Pose,
) -> Vec<Refined> {
    let evidence: Vec<AllEvidence> = (0..scans.len()).map(evidence).collect();
    let mut refine = |k: usize| {
        refiner.refine(&Searched {
            evidence: [&evidence[k - 1], &evidence[k]],
            ..Searched::by_radar(k as u64, &scans[k], &scans[k - 1], &search(k), SWEEP_S)
        })
    };
    (1..scans.len()).map(&mut refine).collect()
}

pub fn refiner_with(sensors: &SensorConfigs) -> Refiner {
    let config = RefinementConfig {
        reach_m: VISIBLE_M.end() + 10.0,
        ..RefinementConfig::default()
    };
    Refiner::new(&config, sensors, CAPACITY).unwrap()
}

pub fn evidence_of(kind: Witness, evidence: Option<Evidence>) -> AllEvidence {
    let mut all = AllEvidence::default();
    all[kind as usize] = evidence.unwrap_or_default();
    all
}

/// The scans where a sensor has this verdict.
pub fn judged(refined: &[Refined], kind: Witness, verdict: Verdict) -> Vec<usize> {
    scans_where(refined, |it| {
        it.witnesses[kind as usize].is_some_and(|it| it.verdict == verdict)
    })
}

/// The distance to a scan by wheels that show it times a factor.
pub fn by_wheels(drive: &Drive, k: usize, factor: f64) -> Evidence {
    let [from_m, to_m] = [k.saturating_sub(1), k].map(|k| drive.length_m(k as f64 * SWEEP_S));
    Evidence {
        samples: 1,
        interval_s: SWEEP_S,
        value: [factor * (to_m - from_m), 0.0],
        covariance: [1e-4, 0.0, 1e-4],
    }
}

/// The turn to a scan by a gyro whose rate is off by so much.
pub fn by_gyro(drive: &Drive, off_radps: f64) -> Evidence {
    let rate_radps = drive.yaw_rate_radps + off_radps;
    Evidence {
        samples: 1,
        interval_s: SWEEP_S,
        value: [rate_radps * SWEEP_S, rate_radps],
        covariance: [1e-9, 0.0, 0.0],
    }
}

/// The scans of a vehicle that leaves a town for a tunnel, with more beside its walls. At every
/// place of a wall is another point in each scan: speckle.
pub fn into_a_tunnel(drive: &Drive, more: Vec<Reflector>) -> Vec<Vec<SparsePoint>> {
    let mut scene = town([[-110.0, -10.0], [-60.0, 60.0]], 1);
    scene.extend(posts([[-110.0, 0.0], [-60.0, 60.0]], 20.0, 4));
    scene.extend([3.0, -6.5].map(|y| wall([0.0, y], [400.0, y], 2500)));
    scene.extend(more);
    scans(&scene, drive, &LITTLE_NOISE)
}

pub fn run(scene: &[Reflector], drive: &Drive, sensor: &Sensor) -> Run {
    refine(drive, &scans(scene, drive, sensor))
}
