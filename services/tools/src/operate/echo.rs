//! `gyre echo`: prints the messages of a running run.

use std::{
    io::{self, BufWriter, ErrorKind, Write},
    path::{Path, PathBuf},
    process::ExitCode,
    time::Duration,
};

use clap::{Args, ValueEnum};
use gyre_geometry::xy_yaw;
use gyre_messages::{
    Correction, CorrectionHeader, Fix, FixHeader, Loop, LoopHeader, Masked, Message, Motion,
    MotionEstimate, MotionHeader, Objects, ObjectsHeader, Pose, PoseHeader, Refined, Rotation,
    Scan, fix_status,
};
use gyre_stage::{
    StageError,
    observer::{Next, ObservedRun, Observer},
    reader::Received,
};
use gyre_terminal::Failure;
use thiserror::Error;

use crate::operate::arguments::RunChoice;

/// The arguments of `gyre echo`.
#[derive(Debug, Args)]
pub struct EchoArguments {
    /// The run and the topic, in any order. Default: the only run there is, and pose.
    #[arg(value_name = "RUN|TOPIC", num_args = 0..=2)]
    pub words: Vec<PathBuf>,
}

/// The topics of a run, in the order of the stream.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub enum Topic {
    /// Scans as measured.
    Scan,
    /// Masked rasters and points.
    Masked,
    /// Rotations between scans.
    Rotation,
    /// Motions between scans.
    Motion,
    /// Motions after refinement.
    Refined,
    /// Poses.
    Pose,
    /// Loops between keyframes, in a run with SLAM.
    Loop,
    /// Corrections of the odometry, in a run with SLAM.
    Correction,
    /// Places of keyframes in a map, in a run with SLAM that names one.
    Fix,
    /// Numbers of moving objects, in a run that tracks them.
    Objects,
}

/// Prints a line for each message of a topic, and how many were missed, until the run ends.
pub fn echo(arguments: &EchoArguments) -> Result<ExitCode, Failure> {
    let (out, topic) = chosen_topic(&arguments.words)?;
    let out = &out;
    match topic {
        Topic::Scan => observe::<Scan>(out, scan),
        Topic::Masked => observe::<Masked>(out, masked),
        Topic::Rotation => observe::<Rotation>(out, rotation),
        Topic::Motion => observe::<Motion>(out, |message| motion(message.header())),
        Topic::Refined => observe::<Refined>(out, |message| motion(message.header())),
        Topic::Pose => observe::<Pose>(out, |message| pose(message.header())),
        Topic::Loop => observe::<Loop>(out, |message| closed(message.header())),
        Topic::Correction => observe::<Correction>(out, |message| correction(message.header())),
        Topic::Fix => observe::<Fix>(out, |message| fix(message.header())),
        Topic::Objects => observe::<Objects>(out, |message| objects(message.header())),
    }
}

/// Returns the run and the topic that are named.
fn chosen_topic(words: &[PathBuf]) -> Result<(PathBuf, Topic), Failure> {
    let topic = |word: &PathBuf| {
        let name = word.to_str().filter(|_| !word.is_dir());
        name.and_then(|name| Topic::from_str(name, false).ok())
    };
    let topics: Vec<Topic> = words.iter().filter_map(topic).collect();
    let runs: Vec<&PathBuf> = words.iter().filter(|word| topic(word).is_none()).collect();
    match (&topics[..], &runs[..]) {
        ([] | [_], [] | [_]) => {
            let run = RunChoice::named_by(runs.first().copied().cloned());
            Ok((
                run.folder()?,
                topics.first().copied().unwrap_or(Topic::Pose),
            ))
        }
        _ => {
            let topics = Topic::value_variants().iter();
            let names =
                topics.filter_map(|topic| Some(topic.to_possible_value()?.get_name().to_owned()));
            let names: Vec<String> = names.collect();
            Err(format!(
                "name a run, the folder of its results, and a topic: {}",
                names.join(", ")
            )
            .into())
        }
    }
}

fn observe<M: Message>(
    out: &Path,
    describe: impl Fn(&Received<M>) -> String,
) -> Result<ExitCode, Failure> {
    let run = ObservedRun::writing_to(out)?;
    let mut observer = run.observe::<M>()?;
    match print_all(&mut observer, describe) {
        // Nobody reads it any more, as after `gyre echo OUT | head`.
        Err(EchoError::Print(error)) if error.kind() == ErrorKind::BrokenPipe => {}
        printed => printed?,
    }
    Ok(ExitCode::SUCCESS)
}

#[derive(Debug, Error)]
enum EchoError {
    #[error(transparent)]
    Stage(#[from] StageError),
    #[error("cannot print: {0}")]
    Print(#[from] io::Error),
}

fn print_all<M: Message>(
    observer: &mut Observer<'_, M>,
    describe: impl Fn(&Received<M>) -> String,
) -> Result<(), EchoError> {
    let mut lines = BufWriter::new(io::stdout().lock());
    let mut received = 0_u64;
    loop {
        let next = match observer.next(Duration::ZERO)? {
            Next::Idle => {
                // Written together: one that reads them is not woken for each.
                lines.flush()?;
                observer.next(Duration::MAX)?
            }
            next => next,
        };
        match next {
            Next::Message(message, missed) => {
                received += 1;
                let (seq, scan) = (message.item().seq, message.item().scan);
                if missed > 0 {
                    writeln!(lines, "{missed} missed")?;
                }
                writeln!(lines, "{seq}: scan {scan}, {}", describe(message))?;
            }
            Next::Idle => {}
            Next::Ended => break,
        }
    }
    let missed = observer.missed();
    writeln!(lines, "{}: {received} received, {missed} missed", M::TOPIC)?;
    Ok(lines.flush()?)
}

fn scan(message: &Received<Scan>) -> String {
    let header = message.header();
    let Some(scan) = header.view(message.values()) else {
        return "its rows do not fit its header".to_owned();
    };
    // Four bytes are enough for a row, and are added faster than eight.
    let row = |row| scan.row(row).iter().map(|power| u32::from(*power));
    let rows = (0..scan.geometry.azimuths).map(|number| u64::from(row(number).sum::<u32>()));
    let power: u64 = rows.sum();
    let (azimuths, bins) = (scan.geometry.azimuths, scan.geometry.bins);
    let mean = power as f64 / (azimuths * bins).max(1) as f64;
    format!("{azimuths} azimuths of {bins} bins, mean power {mean:.2}")
}

fn masked(message: &Received<Masked>) -> String {
    let header = message.header();
    let (n, cell_m) = (header.n, header.cell_m);
    format!(
        "{} raster{} of {n} x {n} cells of {cell_m} m, {} points",
        header.rasters,
        if header.rasters == 1 { "" } else { "s" },
        header.points
    )
}

fn rotation(message: &Received<Rotation>) -> String {
    let rotation = &message.header().rotation;
    format!(
        "yaw {:.3} deg, score {:.3}",
        rotation.angle_rad.to_degrees(),
        rotation.score
    )
}

fn motion(header: &MotionHeader) -> String {
    let motion = &header.motion;
    let place = place(motion.x_m, motion.y_m, motion.yaw_rad);
    let standing = standing(motion);
    format!("{place}, score {:.3}{standing}", motion.score)
}

fn pose(header: &PoseHeader) -> String {
    let place = place(header.x_m, header.y_m, header.yaw_rad);
    format!("{place}{}", standing(&header.motion))
}

fn standing(motion: &MotionEstimate) -> &'static str {
    match motion.refinement.is_stationary() {
        true => ", stationary",
        false => "",
    }
}

fn closed(header: &LoopHeader) -> String {
    let place = place(header.x_m, header.y_m, header.yaw_rad);
    let (scan, correlation) = (header.item.previous_scan, header.correlation);
    format!("at scan {scan}: {place}, correlation {correlation:.3}")
}

fn correction(header: &CorrectionHeader) -> String {
    let place = place(header.x_m, header.y_m, header.yaw_rad);
    let (keyframes, loops) = (header.keyframes, header.loops);
    format!("{place}, {keyframes} keyframes, {loops} loops")
}

fn fix(header: &FixHeader) -> String {
    let Some(pose) = header.pose() else {
        return "lost".to_owned();
    };
    let [x_m, y_m, yaw_rad] = xy_yaw(&pose);
    let place = place(x_m, y_m, yaw_rad);
    match header.status {
        fix_status::PREDICTED => format!("{place}, predicted"),
        _ => format!("{place}, correlation {:.3}", header.correlation),
    }
}

fn objects(header: &ObjectsHeader) -> String {
    let moving = header.list().iter().filter(|object| object.is_moving());
    let moving = moving.map(|object| {
        let (place, speed_mps) = (
            place(object.x_m, object.y_m, object.yaw_rad),
            object.speed_mps(),
        );
        format!("; {}: {place}, {speed_mps:.1} m/s", object.id)
    });
    let counts = format!("{} objects, {} move", header.objects, header.moving);
    std::iter::once(counts).chain(moving).collect()
}

fn place(x_m: f64, y_m: f64, yaw_rad: f64) -> String {
    let yaw_deg = yaw_rad.to_degrees();
    format!("x {x_m:.3} m, y {y_m:.3} m, yaw {yaw_deg:.3} deg")
}
