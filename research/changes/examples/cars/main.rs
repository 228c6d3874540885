//! Compares pairs of simulated drives through one town, between which parked cars have come and
//! gone, and the changes that are found with the truth.
//!
//! ```sh
//! cargo run --manifest-path research/Cargo.toml -p gyre-changes --example cars -- cts350x-oxford:31:dry:150 ras6:32:rain:150
//! ```
//!
//! A pair is a radar, a seed, the weather of the second drive (`dry`, or `rain` of 10 mm/h) and the
//! number of scans of the first one. The second drive has other traffic and noise, drives at
//! another pace, and beside the lane of the first one. `CHANGES_CACHE` names a folder that keeps
//! registered drives, `CHANGES_SHOW=1` prints each change that is missed or false. `CHANGES_PLANES`
//! names a folder into which pairs are written to train the network with, and not compared.

mod cars;
mod drives;
mod figures;
mod planes;

use std::env;
use std::error::Error;
use std::path::PathBuf;

use gyre_changes::{Change, Changes, Survey, changes};
use gyre_slam::Keyframe;
use gyre_worlds::Simulator;
use nalgebra::Point2;

use cars::{Car, centre};
use figures::Figures;

type Outcome<T> = Result<T, Box<dyn Error>>;

fn main() -> Outcome<()> {
    let show = env::var_os("CHANGES_SHOW").is_some();
    let mut all = Figures::default();
    for name in env::args().skip(1) {
        let pair = Pair::simulate(&name)?;
        if let Some(folder) = env::var_os("CHANGES_PLANES") {
            pair.draw(&PathBuf::from(folder).join(name.replace(':', "-")))?;
            continue;
        }
        let figures = pair.compare(show)?;
        println!("{name}: {figures}");
        all.add(&figures);
    }
    if env::var_os("CHANGES_PLANES").is_none() {
        println!("all: {all}");
    }
    Ok(())
}

/// Two drives in the frame of the first one's first keyframe, and the truth about both.
struct Pair {
    drives: [Simulator; 2],
    keyframes: [Vec<Keyframe>; 2],
}

impl Pair {
    /// Finds the changes, and compares them with the cars that have come and gone.
    fn compare(&self, show: bool) -> Outcome<Figures> {
        let surveys = self.surveys();
        let found: Changes = changes(&surveys[0], &surveys[1])?;
        let found: Vec<Change> = found.changes.iter().map(|it| self.in_world(it)).collect();
        let cars = self.changed_cars();
        if show {
            let [median_m, worst_m] = self.placement_m();
            println!("  placed to {median_m:.2} m, {worst_m:.2} m at most");
            self.print_differences(&cars, &found);
        }
        Ok(Figures::of(&cars, &found))
    }

    fn surveys(&self) -> [Survey; 2] {
        self.keyframes.each_ref().map(|keyframes| {
            let mut survey = Survey::default();
            for keyframe in keyframes {
                survey.add(keyframe, &keyframe.pose.motion);
            }
            survey
        })
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
        let truth = self.drives[0].pose(nearest.scan as usize);
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
                "  {}: {} at {:.1} {:.1}, {away_m:.1} m away, {:.1} x {:.1} m, {:.3}, a car {near_m:.1} m from it",
                if is_right { "right" } else { "false" },
                it.kind,
                it.x_m,
                it.y_m,
                it.length_m,
                it.width_m,
                it.confidence
            );
        }
    }
}
