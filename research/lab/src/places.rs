//! `gyre-lab places`: measures how well the places of a run are recognised, and its loops verified.

mod counts;

use std::{fmt::Write, path::PathBuf, process::ExitCode, time::Instant};

use clap::Args;
use gyre_slam::{LoopCandidate, estimation::places::{Candidate, Describer, Descriptor, PlaceIndex, Registrar}};
use gyre_geometry::{wrap_angle, xy_yaw};
use gyre_configuration::terminal::Failure;
use nalgebra::Vector3;

use crate::{
    drive::Drive,
    report::{make_folder, publish, save},
};
use counts::Counts;

/// Candidates that are verified, and their distance from each other along the path.
const VERIFIED: usize = 3;
const APART_M: f64 = 15.0;
/// A loop is wrong if its yaw is off by more.
const WRONG_DEG: f64 = 5.0;

#[derive(Debug, Args)]
pub struct PlacesArguments {
    /// The results of a run with `slam.kind=graph` or `filter`. Its recording needs a ground truth.
    pub run: PathBuf,
    /// Least length of the path between a keyframe and the earlier ones that it is compared with,
    /// m.
    #[arg(long, default_value = "100")]
    pub gap_m: f64,
    /// A loop is wrong if it is farther from the ground truth, m.
    #[arg(long, default_value = "2")]
    pub wrong_m: f64,
    /// The folder of places.md, places.json and loops.csv: every verified candidate with its
    /// verdict and its error.
    #[arg(long, default_value = "out/places")]
    pub out: PathBuf,
}

/// A verified candidate and the truth about it.
struct Checked {
    /// Number of the queried keyframe, and of the found one.
    query: usize,
    place: usize,
    verification: LoopCandidate,
    /// The yaw differs from the candidate's by half a turn.
    half_turn: bool,
    /// x, y (m) and yaw (rad) of the motion less the true one, along the axes of the found
    /// keyframe.
    error: Vector3<f64>,
    is_wrong: bool,
    /// The true distance, m, and yaw, rad.
    distance_m: f64,
    yaw_rad: f64,
}

/// Recognises the places of a run, verifies the loops, and compares both with the ground truth.
///
/// # Errors
/// Results that cannot be read or have no keyframes, or a recording without ground truth.
pub fn places(arguments: &PlacesArguments) -> Result<ExitCode, Failure> {
    let mut drive = Drive::read(&arguments.run)?;
    let start = Instant::now();
    let (mut index, descriptors) = describe(&mut drive)?;
    let mut counts = Counts::new(start.elapsed());
    let mut registrar = Registrar::new(&drive.refinement, drive.capacity)?;
    let mut rows = String::from(HEADER);
    for (query, descriptor) in descriptors.iter().enumerate() {
        let eligible = index.places_until(drive.path_m[query] - arguments.gap_m);
        if eligible == 0 || drive.truths[query].is_none() {
            continue;
        }
        counts.recall(
            &drive,
            query,
            eligible,
            index.query(descriptor, eligible, 0.0),
        );
        let start = Instant::now();
        let candidates = index.query(descriptor, eligible, APART_M);
        counts.query.add(start.elapsed());
        drive.draw(query, 0);
        for candidate in candidates.iter().take(VERIFIED) {
            drive.draw(candidate.place, 1);
            let start = Instant::now();
            let verification = registrar.verify(&drive.submaps[0], &drive.submaps[1], candidate);
            counts.verification.add(start.elapsed());
            if let Some(checked) = check(&drive, query, candidate, verification, arguments.wrong_m) {
                counts.add(&drive, &checked);
                checked.write(&drive, &mut rows)?;
            }
        }
    }
    make_folder(&arguments.out)?;
    save(&arguments.out.join("loops.csv"), &rows)?;
    publish("places", &counts.tables(&drive), &arguments.out)?;
    Ok(ExitCode::SUCCESS)
}

/// Describes all keyframes.
fn describe(drive: &mut Drive) -> Result<(PlaceIndex, Vec<Descriptor>), Failure> {
    let mut describer = Describer::new();
    let mut index = PlaceIndex::with_capacity(drive.keyframes.len());
    let mut descriptors = Vec::new();
    for k in 0..drive.keyframes.len() {
        drive.draw(k, 0);
        let mut descriptor = Descriptor::default();
        describer.describe(&drive.submaps[0], &mut descriptor);
        index.insert(drive.keyframes[k].scan, drive.path_m[k], &descriptor)?;
        descriptors.push(descriptor);
    }
    Ok((index, descriptors))
}

/// Compares a verified candidate with the truth; `None` without truth.
fn check(
    drive: &Drive,
    query: usize,
    candidate: &Candidate,
    verification: LoopCandidate,
    wrong_m: f64,
) -> Option<Checked> {
    let place = candidate.place;
    let [later, earlier] = [query, place].map(|k| drive.truths[k]);
    let truth = earlier?.inv_mul(&later?);
    let error = verification.motion.error(&truth);
    let turned_rad = verification.motion.motion.rotation.angle() - candidate.yaw_rad;
    Some(Checked {
        query,
        place,
        half_turn: wrap_angle(turned_rad).abs() > std::f64::consts::FRAC_PI_2,
        verification,
        is_wrong: error.xy().norm() > wrong_m || error.z.abs() > WRONG_DEG.to_radians(),
        error,
        distance_m: truth.translation.vector.norm(),
        yaw_rad: truth.rotation.angle(),
    })
}

const HEADER: &str = "scan,found_scan,x_m,y_m,yaw_rad,correlation,searched,runner_up,half_turn,outcome,\
    error_x_m,error_y_m,error_yaw_rad,sigma_x_m,sigma_y_m,sigma_yaw_rad,true_distance_m,true_yaw_rad,wrong\n";

impl Checked {
    fn write(&self, drive: &Drive, rows: &mut String) -> std::fmt::Result {
        let [query, place] = [self.query, self.place].map(|k| drive.keyframes[k].scan);
        let found = &self.verification;
        let [x, y, yaw] = xy_yaw(&found.motion.motion);
        let sigma = found.motion.covariance.diagonal().map(f64::sqrt);
        write!(rows, "{query},{place},{x:.4},{y:.4},{yaw:.6},")?;
        write!(
            rows,
            "{:.4},{:.4},{:.4},{},",
            found.correlation, found.searched, found.runner_up, self.half_turn
        )?;
        write!(rows, "{:?},", found.outcome)?;
        for value in self.error.iter().chain(&sigma) {
            write!(rows, "{value:.6},")?;
        }
        writeln!(
            rows,
            "{:.3},{:.4},{}",
            self.distance_m, self.yaw_rad, self.is_wrong
        )
    }
}
