//! Compares pairs of simulated drives through one town, between which parked cars have come and
//! gone, and the changes that are found with the truth.
//!
//! ```sh
//! cargo run -p gyre-evaluation --example changes -- cts350x-oxford:31:dry:150 ras6:32:rain:150
//! ```
//!
//! A pair is a radar, a seed, the weather of the second drive (`dry`, or `rain` of 10 mm/h) and the
//! number of scans of the first one. The second drive has other traffic and noise, drives at
//! another pace, and beside the lane of the first one. `CHANGES_CACHE` names a folder that keeps
//! registered drives, `CHANGES_SHOW=1` prints each change that is missed or false.

use std::collections::BTreeMap;
use std::error::Error;
use std::path::{Path, PathBuf};
use std::{env, fmt, fs};

use gyre_datasets::write_tum;
use gyre_estimation::{Constraint, G2o};
use gyre_geometry::{Pose, pose};
use gyre_localisation::{DriveSearch, Localiser, LocaliserOptions, Map};
use gyre_mapping::{Change, ChangeKind, Changes, MapOptions, Survey, changes};
use gyre_odometry::{Odometry, OdometryConfig};
use gyre_radar::{OwnedScan, Trajectory};
use gyre_simulator::drive::{DriveConfig, DriveKind};
use gyre_simulator::town::ParkedCar;
use gyre_simulator::weather::WeatherConfig;
use gyre_simulator::{SimulatedDrive, SimulationConfig, Simulator};
use gyre_slam::{Keyframe, KeyframeBuilder, RecordLog, RecordReader, ScanPose};
use nalgebra::Point2;

type Outcome<T> = Result<T, Box<dyn Error>>;

/// Strongest echo of a car that is seen, counts: the threshold of the masks.
const SEEN_COUNTS: f64 = 60.0;
/// A place is within sight if both drives have so many scans within this range of it, m, in which a
/// car there is or would be seen.
const SIGHT_SCANS: usize = 5;
const SIGHT_M: f64 = 40.0;
/// Two cars whose centres are nearer than this are at one place, m.
const SAME_M: f64 = 1.0;
/// A change is that of a car if the centre of one is within the outline of the other, or so far
/// from it, m.
const BESIDE_M: f64 = 1.0;
/// A car that is paired with one change alone has its centre within this distance, m.
const PAIR_M: f64 = 3.0;
/// Bounds of the distances from the path at which recall is printed, m.
const BANDS_M: [f64; 4] = [0.0, 10.0, 20.0, SIGHT_M];

fn main() -> Outcome<()> {
    let show = env::var_os("CHANGES_SHOW").is_some();
    let mut all = Figures::default();
    for name in env::args().skip(1) {
        let pair = Pair::simulate(&name)?;
        let figures = pair.compare(show)?;
        println!("{name}: {figures}");
        all.add(&figures);
    }
    println!("all: {all}");
    Ok(())
}

/// Two drives in the frame of the first one's first keyframe, and the truth about both.
struct Pair {
    drives: [Simulator; 2],
    keyframes: [Vec<Keyframe>; 2],
}

/// A parked car of one of the drives.
struct Car<'a> {
    car: &'a ParkedCar,
    kind: ChangeKind,
    /// True if both drives have the place in sight.
    is_in_sight: bool,
    /// The least distance of the place from their paths.
    away_m: f64,
}

/// Cars and changes, and those that belong together.
#[derive(Clone, Debug, Default)]
struct Figures {
    /// Cars in sight that have come or gone, and those that were found, by their distance.
    wanted: [usize; BANDS_M.len() - 1],
    found: [usize; BANDS_M.len() - 1],
    /// Changes, and those that are changes of a car.
    changes: usize,
    right: usize,
    /// Cars in sight and changes that are paired one to one.
    paired: usize,
    /// The changes by their confidence in tenths from 0.5 on, and those that are right.
    confident: [[usize; 2]; 5],
}

impl Pair {
    /// Simulates and registers both drives: `RADAR:SEED:WEATHER:SCANS`.
    fn simulate(name: &str) -> Outcome<Self> {
        let parts: Vec<&str> = name.split(':').collect();
        let [radar, seed, weather, scans] = parts[..] else {
            return Err(format!("{name} is not RADAR:SEED:WEATHER:SCANS").into());
        };
        let (seed, scans): (u64, usize) = (seed.parse()?, scans.parse()?);
        let folder = tempfile::tempdir()?;
        let mut config = SimulationConfig {
            seed: 2 * seed,
            ..SimulationConfig::default()
        };
        let profile = toml::from_str::<BTreeMap<String, _>>(&format!("profile = \"{radar}\""))?;
        config.sensor.profile = profile["profile"];
        config.town.seed = Some(seed);
        let (files, pace) = trajectories(seed, scans, folder.path())?;
        config.town.streets = files.to_vec();
        config.drive = DriveConfig::along_file(files[0].clone());
        config.scans = Some(scans);
        let mut second = SimulationConfig {
            seed: 2 * seed + 1,
            scans: Some((scans as f64 / pace) as usize),
            drive: DriveConfig::along_file(files[1].clone()),
            ..config.clone()
        };
        second.town.changes_seed = Some(1000 + seed);
        if weather == "rain" {
            second.weather.push(WeatherConfig {
                rain_mm_h: 10.0,
                ..WeatherConfig::default()
            });
        }
        let drives = [SimulatedDrive::new(&config)?, SimulatedDrive::new(&second)?];
        let simulators = drives.each_ref().map(|drive| drive.simulator().clone());
        let keyframes = match cached(name)? {
            Some(keyframes) => keyframes,
            None => {
                let keyframes = placed([registered(&drives[0])?, registered(&drives[1])?])?;
                keep(name, &keyframes)?;
                keyframes
            }
        };
        Ok(Self {
            drives: simulators,
            keyframes,
        })
    }

    /// Finds the changes, and compares them with the cars that have come and gone.
    fn compare(&self, show: bool) -> Outcome<Figures> {
        let survey = |keyframes: &[Keyframe]| -> Outcome<Survey> {
            let mut survey = Survey::new(&MapOptions::default())?;
            for keyframe in keyframes {
                survey.add(keyframe, &keyframe.pose.motion);
            }
            Ok(survey)
        };
        let surveys = [survey(&self.keyframes[0])?, survey(&self.keyframes[1])?];
        let found: Changes = changes(&surveys[0], &surveys[1]);
        let found: Vec<Change> = found.changes.iter().map(|it| self.in_world(it)).collect();
        let cars = self.changed_cars();
        if show {
            let [median_m, worst_m] = self.placement_m();
            println!("  placed to {median_m:.2} m, {worst_m:.2} m at most");
            self.print_differences(&cars, &found);
        }
        Ok(Figures::of(&cars, &found))
    }

    /// A change in the world of the simulation: that of the keyframe of the first drive that is
    /// nearest to it.
    fn in_world(&self, change: &Change) -> Change {
        let place = Point2::new(change.x_m, change.y_m);
        let distance_m = |keyframe: &Keyframe| {
            let at = keyframe.pose.motion.translation.vector;
            (at - place.coords).norm()
        };
        let nearest = self.keyframes[0]
            .iter()
            .min_by(|a, b| distance_m(a).total_cmp(&distance_m(b)));
        let Some(nearest) = nearest else {
            return *change;
        };
        let truth = self.drives[0].pose(nearest.seq as usize);
        let world = truth * nearest.pose.motion.inverse();
        let moved = world * place;
        Change {
            x_m: moved.x,
            y_m: moved.y,
            yaw_rad: change.yaw_rad + world.rotation.angle(),
            ..*change
        }
    }

    /// The median and largest error of the later keyframes' places beside the nearest earlier one,
    /// m.
    fn placement_m(&self) -> [f64; 2] {
        let at = |it: &Keyframe| it.pose.motion.translation.vector;
        let error_m = |later: &Keyframe| {
            let distance_m = |it: &&Keyframe| (at(it) - at(later)).norm();
            let nearest = self.keyframes[0]
                .iter()
                .min_by(|a, b| distance_m(a).total_cmp(&distance_m(b)))?;
            let [first, second] = [(0, nearest), (1, later)]
                .map(|(drive, it)| self.drives[drive].pose(it.scan as usize));
            let found = nearest.pose.motion.inv_mul(&later.pose.motion);
            Some((first.inv_mul(&second).translation.vector - found.translation.vector).norm())
        };
        let mut errors: Vec<f64> = self.keyframes[1].iter().filter_map(error_m).collect();
        errors.sort_by(f64::total_cmp);
        [errors.len() / 2, errors.len().saturating_sub(1)]
            .map(|rank| errors.get(rank).copied().unwrap_or(f64::NAN))
    }

    /// The least distance of a place from the paths of both drives, m.
    fn away_m(&self, place: &Point2<f64>) -> f64 {
        let scans = self
            .drives
            .iter()
            .flat_map(|drive| (0..drive.scans()).map(|scan| drive.pose(scan)));
        scans
            .map(|pose| (pose.translation.vector - place.coords).norm())
            .fold(f64::INFINITY, f64::min)
    }

    fn print_differences(&self, cars: &[Car<'_>], found: &[Change]) {
        for car in cars.iter().filter(|car| car.is_in_sight) {
            if !found.iter().any(|change| car.is(change)) {
                let (at, away_m) = (car.centre(), car.away_m);
                println!(
                    "  missed: {} at {:.1} {:.1}, {away_m:.1} m away",
                    car.kind, at.x, at.y
                );
            }
        }
        for it in found {
            let near = cars.iter().map(|car| (car.centre() - centre(it)).norm());
            let near_m = near.fold(f64::INFINITY, f64::min);
            let is_right = cars.iter().any(|car| car.is(it));
            let away_m = self.away_m(&centre(it));
            println!(
                "  {}: {} at {:.1} {:.1}, {away_m:.1} m away, {:.1} x {:.1} m, {:.1} m2, share {:.3}, {:.3}, a car {near_m:.1} m from it",
                if is_right { "right" } else { "false" },
                it.kind,
                it.x_m,
                it.y_m,
                it.length_m,
                it.width_m,
                it.area_m2,
                it.share,
                it.confidence
            );
        }
    }

    /// The parked cars of one drive where the other one has none.
    fn changed_cars(&self) -> Vec<Car<'_>> {
        let kinds = [ChangeKind::Gone, ChangeKind::Appeared];
        let mut cars = Vec::new();
        for (which, kind) in kinds.into_iter().enumerate() {
            let others = self.drives[1 - which].parked_cars();
            for car in self.drives[which].parked_cars() {
                let apart_m = |other: &ParkedCar| {
                    (other.pose.translation.vector - car.pose.translation.vector).norm()
                };
                if others.iter().all(|other| apart_m(other) > SAME_M) {
                    cars.push(self.seen(car, kind));
                }
            }
        }
        cars
    }

    /// A car with what both drives could see of it.
    fn seen<'a>(&self, car: &'a ParkedCar, kind: ChangeKind) -> Car<'a> {
        let mut away_m = f64::INFINITY;
        let is_in_sight = self.drives.each_ref().map(|drive| {
            let place = car.pose.translation.vector;
            let range_m = |scan: usize| (drive.pose(scan).translation.vector - place).norm();
            let near = (0..drive.scans()).filter(|scan| range_m(*scan) <= SIGHT_M);
            let near: Vec<usize> = near.collect();
            away_m = near
                .iter()
                .map(|scan| range_m(*scan))
                .fold(away_m, f64::min);
            let is_seen = |scan: &&usize| drive.parked_counts(car, **scan) >= SEEN_COUNTS;
            near.iter().filter(is_seen).count() >= SIGHT_SCANS
        });
        Car {
            car,
            kind,
            is_in_sight: is_in_sight == [true; 2],
            away_m,
        }
    }
}

/// Writes the trajectories of both drives through the town of a seed, the first one of at least so
/// many scans, and returns the pace of the second one over that of the first one.
fn trajectories(seed: u64, scans: usize, folder: &Path) -> Outcome<([PathBuf; 2], f64)> {
    let drive = DriveConfig {
        kind: DriveKind::Town,
        length_m: (4.0 * scans as f64).max(300.0),
        ..DriveConfig::default()
    };
    let path = drive.path(seed, None)?;
    // Up to half a metre to either side of the first one, at 0.8 to 1.2 times its pace.
    let [aside_m, pace] = match seed % 4 {
        0 => [0.5, 0.8],
        1 => [-0.5, 1.2],
        2 => [0.3, 1.1],
        _ => [-0.3, 0.9],
    };
    let write = |name: &str, aside_m: f64, pace: f64| -> Outcome<PathBuf> {
        let file = folder.join(name);
        let steps = 0..(10.0 * path.duration_s()) as i64;
        let stamp_ns = |step: i64| (step as f64 * 1e8 / pace) as i64;
        let at = |step: i64| path.pose(0.1 * step as f64) * pose(0.0, aside_m, 0.0);
        let trajectory = Trajectory {
            stamp_ns: Some(steps.clone().map(stamp_ns).collect()),
            poses: steps.map(at).collect(),
        };
        let mut text = Vec::new();
        write_tum(&trajectory, &mut text)?;
        fs::write(&file, text)?;
        Ok(file)
    };
    let first = write("first.tum", 0.0, 1.0)?;
    Ok(([first, write("second.tum", aside_m, pace)?], pace))
}

/// Registers a drive by odometry, and returns its keyframes.
fn registered(drive: &SimulatedDrive) -> Outcome<Vec<Keyframe>> {
    let options = drive.dataset_options();
    let mut dataset = gyre_datasets::open_source(Box::new(drive.renderer()), &options)?;
    let mut odometry = Odometry::new(&OdometryConfig::default())?;
    let mut builder = KeyframeBuilder::new(&Default::default());
    let mut scan = OwnedScan::with_limits(dataset.limits());
    let mut keyframes = Vec::new();
    for index in 0..dataset.len() {
        scan.geometry = dataset.read(index, scan.slot())?;
        let registered = odometry.register(&scan.view(), &[])?;
        let keyframe = builder.next(&ScanPose {
            seq: registered.seq,
            scan: index as u64,
            stamp_ns: scan.geometry.stamp_ns,
            pose: registered.pose,
            motion: registered.motion,
            interval_s: registered.interval_ns as f64 * 1e-9,
        });
        keyframes.extend(keyframe.map(|keyframe| Keyframe {
            points: odometry.points().to_vec(),
            ..keyframe
        }));
    }
    Ok(keyframes)
}

/// Finds the second drive in the map of the first one, and returns the keyframes of both in its
/// frame.
fn placed([first, second]: [Vec<Keyframe>; 2]) -> Outcome<[Vec<Keyframe>; 2]> {
    let config = OdometryConfig::default();
    let mut localiser = Localiser::new(
        Map::new(first)?,
        LocaliserOptions::default(),
        &config.refinement,
        config.points.capacity,
    )?;
    let mut search = DriveSearch::default();
    for keyframe in &second {
        search.add(&mut localiser, keyframe);
    }
    let motions = second.iter().skip(1).enumerate();
    let drive = G2o {
        poses: second.iter().map(|it| it.pose.motion).collect(),
        constraints: motions
            .map(|(last, it)| Constraint::odometry(last, it.motion))
            .collect(),
    };
    let placed = search
        .place(&drive)?
        .ok_or("the second drive is not on the first one")?;
    let second = second.into_iter().zip(&placed.poses).enumerate();
    let second = second.filter(|(index, _)| placed.is_near_fix(*index));
    let second = second.map(|(_, (mut keyframe, pose))| {
        keyframe.pose.motion = *pose;
        keyframe
    });
    Ok([localiser.map().keyframes().to_vec(), second.collect()])
}

impl Car<'_> {
    fn centre(&self) -> Point2<f64> {
        Point2::from(self.car.pose.translation.vector)
    }

    /// Returns whether a change is that of this car.
    fn is(&self, change: &Change) -> bool {
        let of_change = Pose::new(
            nalgebra::Vector2::new(change.x_m, change.y_m),
            change.yaw_rad,
        );
        let of_car = self.car.pose;
        self.kind == change.kind
            && (is_within(
                &of_change,
                [change.length_m, change.width_m],
                &self.centre(),
            ) || is_within(&of_car, self.car.size_m(), &centre(change)))
    }
}

fn centre(change: &Change) -> Point2<f64> {
    Point2::new(change.x_m, change.y_m)
}

/// Returns whether a place is in a rectangle or just beside it.
fn is_within(pose: &Pose, [length_m, width_m]: [f64; 2], place: &Point2<f64>) -> bool {
    let at = pose.inverse() * place;
    at.x.abs() <= 0.5 * length_m + BESIDE_M && at.y.abs() <= 0.5 * width_m + BESIDE_M
}

impl Figures {
    fn of(cars: &[Car<'_>], found: &[Change]) -> Self {
        let mut figures = Self {
            changes: found.len(),
            paired: paired(cars, found),
            ..Self::default()
        };
        for car in cars.iter().filter(|car| car.is_in_sight) {
            let band = BANDS_M.windows(2).position(|band| car.away_m < band[1]);
            let band = band.unwrap_or(BANDS_M.len() - 2);
            figures.wanted[band] += 1;
            figures.found[band] += usize::from(found.iter().any(|change| car.is(change)));
        }
        for change in found {
            let is_right = cars.iter().any(|car| car.is(change));
            figures.right += usize::from(is_right);
            let tenth = ((10.0 * change.confidence) as usize).clamp(5, 9) - 5;
            figures.confident[tenth][0] += 1;
            figures.confident[tenth][1] += usize::from(is_right);
        }
        figures
    }

    fn add(&mut self, other: &Self) {
        let add = |sum: &mut [usize], more: &[usize]| {
            sum.iter_mut()
                .zip(more)
                .for_each(|(sum, more)| *sum += more);
        };
        add(&mut self.wanted, &other.wanted);
        add(&mut self.found, &other.found);
        self.changes += other.changes;
        self.right += other.right;
        self.paired += other.paired;
        add(
            self.confident.as_flattened_mut(),
            other.confident.as_flattened(),
        );
    }
}

/// Counts the cars in sight that are paired with a change of their own, the nearest ones first.
fn paired(cars: &[Car<'_>], found: &[Change]) -> usize {
    let mut pairs: Vec<(f64, usize, usize)> = Vec::new();
    for (c, car) in cars.iter().enumerate().filter(|(_, car)| car.is_in_sight) {
        for (f, change) in found.iter().enumerate() {
            let apart_m = (car.centre() - centre(change)).norm();
            if apart_m <= PAIR_M && car.kind == change.kind {
                pairs.push((apart_m, c, f));
            }
        }
    }
    pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut taken: Vec<(usize, usize)> = Vec::new();
    for (_, c, f) in pairs {
        if taken.iter().all(|(car, change)| *car != c && *change != f) {
            taken.push((c, f));
        }
    }
    taken.len()
}

impl fmt::Display for Figures {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let share = |part: usize, whole: usize| 100.0 * part as f64 / whole.max(1) as f64;
        let [wanted, found] = [&self.wanted, &self.found].map(|it| it.iter().sum::<usize>());
        write!(
            f,
            "recall {:.1} % ({found} of {wanted}), precision {:.1} % ({} of {}); one to one {:.1} %",
            share(found, wanted),
            share(self.right, self.changes),
            self.right,
            self.changes,
            share(self.paired, wanted)
        )?;
        for (band, (found, wanted)) in self.found.iter().zip(&self.wanted).enumerate() {
            let [from, to] = [BANDS_M[band], BANDS_M[band + 1]];
            write!(f, "; {from:.0}-{to:.0} m {found}/{wanted}")?;
        }
        let tenths = self.confident.map(|[all, right]| format!("{right}/{all}"));
        write!(f, "; by confidence from 0.5 on {}", tenths.join(" "))
    }
}

/// The files of a pair that is kept.
fn cache(name: &str) -> Option<[PathBuf; 2]> {
    let folder = PathBuf::from(env::var_os("CHANGES_CACHE")?);
    let name = name.replace(':', "-");
    Some(["first", "second"].map(|which| folder.join(format!("{name}-{which}.log"))))
}

fn cached(name: &str) -> Outcome<Option<[Vec<Keyframe>; 2]>> {
    let Some(files) = cache(name).filter(|files| files.iter().all(|file| file.exists())) else {
        return Ok(None);
    };
    let read = |file: &Path| -> Outcome<Vec<Keyframe>> {
        let mut reader = RecordReader::<Keyframe>::open_file(file)?;
        (0..reader.len())
            .map(|index| Ok(reader.read(index)?))
            .collect()
    };
    Ok(Some([read(&files[0])?, read(&files[1])?]))
}

fn keep(name: &str, keyframes: &[Vec<Keyframe>; 2]) -> Outcome<()> {
    let Some(files) = cache(name) else {
        return Ok(());
    };
    for (file, keyframes) in files.iter().zip(keyframes) {
        let mut log = RecordLog::<Keyframe>::open_file(file)?;
        log.cut(0)?;
        for keyframe in keyframes {
            log.append(keyframe)?;
        }
        log.end()?;
    }
    Ok(())
}
