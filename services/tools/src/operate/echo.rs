//! `gyre echo`: prints the messages of a running run.

use std::{
    io::{self, BufWriter, ErrorKind, Write},
    path::{Path, PathBuf},
    process::ExitCode,
    time::Duration,
};

use clap::Args;
use gyre_client::{
    Received,
    observer::{Next, ObservedRun},
};
use gyre_configuration::terminal::Failure;
use gyre_contract::{
    Correction, Fix, Loop, Masked, Message, Motion, MotionEstimate, MotionHeader, Objects, Pose,
    Refined, Rotation, Scan, fix_status,
};
use gyre_geometry::xy_yaw;

use crate::operate::choice::RunChoice;

#[derive(Debug, Args)]
pub struct EchoArguments {
    /// The run and the topic, in any order. Default: the only run there is, and pose.
    #[arg(value_name = "RUN|TOPIC", num_args = 0..=2)]
    pub words: Vec<PathBuf>,
}

type Echo = fn(&Path) -> Result<(), Failure>;

/// The topics of a run, in the order of the stream.
const TOPICS: [(&str, Echo); 10] = [
    (Scan::TOPIC, |out| observe::<Scan>(out, scan)),
    (Masked::TOPIC, |out| observe::<Masked>(out, masked)),
    (Rotation::TOPIC, |out| observe::<Rotation>(out, rotation)),
    (Motion::TOPIC, |out| observe::<Motion>(out, motion)),
    (Refined::TOPIC, |out| observe::<Refined>(out, motion)),
    (Pose::TOPIC, |out| observe::<Pose>(out, pose)),
    (Loop::TOPIC, |out| observe::<Loop>(out, closed)),
    (Correction::TOPIC, |out| {
        observe::<Correction>(out, correction)
    }),
    (Fix::TOPIC, |out| observe::<Fix>(out, fix)),
    (Objects::TOPIC, |out| observe::<Objects>(out, objects)),
];

/// Prints a line for each message of a topic, and how many were missed, until the run ends.
pub fn echo(arguments: &EchoArguments) -> Result<ExitCode, Failure> {
    let words = &arguments.words;
    let topic = |word: &PathBuf| {
        let name = word.to_str().filter(|_| !word.is_dir())?;
        TOPICS.iter().find(|(topic, _)| *topic == name)
    };
    let topics: Vec<_> = words.iter().filter_map(topic).collect();
    let runs: Vec<&PathBuf> = words.iter().filter(|word| topic(word).is_none()).collect();
    let echo: Echo = match (&topics[..], &runs[..]) {
        ([(_, echo)], [] | [_]) => *echo,
        ([], [] | [_]) => |out: &Path| observe::<Pose>(out, pose),
        _ => {
            let names = TOPICS.map(|(name, _)| name).join(", ");
            let usage = "name a run, the folder of its results, and a topic";
            return Err(format!("{usage}: {names}").into());
        }
    };
    let run = runs.first().copied().cloned();
    let printed = echo(&RunChoice { run }.folder()?);
    match printed.map_err(|error| error.downcast::<io::Error>()) {
        Ok(()) => Ok(ExitCode::SUCCESS),
        // Nobody reads it any more, as after `gyre echo OUT | head`.
        Err(Ok(error)) if error.kind() == ErrorKind::BrokenPipe => Ok(ExitCode::SUCCESS),
        Err(Ok(error)) => Err(format!("cannot print: {error}").into()),
        Err(Err(error)) => Err(error),
    }
}

fn observe<M: Message>(out: &Path, words: impl Fn(&Received<M>) -> String) -> Result<(), Failure> {
    let run = ObservedRun::writing_to(out)?;
    let mut observer = run.observe::<M>()?;
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
                writeln!(lines, "{seq}: scan {scan}, {}", words(message))?;
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
    let (n, cell_m, rasters, points) = (header.n, header.cell_m, header.rasters, header.points);
    let s = if rasters == 1 { "" } else { "s" };
    format!("{rasters} raster{s} of {n} x {n} cells of {cell_m} m, {points} points")
}

fn rotation(message: &Received<Rotation>) -> String {
    let rotation = &message.header().rotation;
    let (yaw_deg, score) = (rotation.angle_rad.to_degrees(), rotation.score);
    format!("yaw {yaw_deg:.3} deg, score {score:.3}")
}

fn motion<M: Message<Header = MotionHeader>>(message: &Received<M>) -> String {
    let motion = &message.header().motion;
    let place = place(motion.x_m, motion.y_m, motion.yaw_rad);
    let standing = standing(motion);
    format!("{place}, score {:.3}{standing}", motion.score)
}

fn pose(message: &Received<Pose>) -> String {
    let header = message.header();
    let place = place(header.x_m, header.y_m, header.yaw_rad);
    format!("{place}{}", standing(&header.motion))
}

fn standing(motion: &MotionEstimate) -> &'static str {
    match motion.refinement.is_stationary() {
        true => ", stationary",
        false => "",
    }
}

fn closed(message: &Received<Loop>) -> String {
    let header = message.header();
    let place = place(header.x_m, header.y_m, header.yaw_rad);
    let (scan, correlation) = (header.item.previous_scan, header.correlation);
    format!("at scan {scan}: {place}, correlation {correlation:.3}")
}

fn correction(message: &Received<Correction>) -> String {
    let header = message.header();
    let place = place(header.x_m, header.y_m, header.yaw_rad);
    let (keyframes, loops) = (header.keyframes, header.loops);
    format!("{place}, {keyframes} keyframes, {loops} loops")
}

fn fix(message: &Received<Fix>) -> String {
    let header = message.header();
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

fn objects(message: &Received<Objects>) -> String {
    let header = message.header();
    let mut text = format!("{} objects, {} move", header.objects, header.moving);
    for object in header.list().iter().filter(|object| object.is_moving()) {
        let place = place(object.x_m, object.y_m, object.yaw_rad);
        let (id, speed_mps) = (object.id, object.speed_mps());
        text += &format!("; {id}: {place}, {speed_mps:.1} m/s");
    }
    text
}

fn place(x_m: f64, y_m: f64, yaw_rad: f64) -> String {
    let yaw_deg = yaw_rad.to_degrees();
    format!("x {x_m:.3} m, y {y_m:.3} m, yaw {yaw_deg:.3} deg")
}
