//! The threads that follow the run.

use std::{
    path::{Path, PathBuf},
    sync::Arc,
    thread::{self, JoinHandle},
    time::{Duration, Instant},
};

use gyre_messages::{Masked, Message, Objects, Pose, Scan};
use gyre_stage::{
    StageError,
    observer::{Next, ObservedRun},
    reader::Received,
};

use crate::{
    journal_track::JournalTrack,
    messages::{Layer, RunState},
    pictures,
    processes::ProcessMeter,
    run_view::RunView,
};

/// Time between two polls for a run, for browsers that want a layer, and for a request to stop.
const POLL_INTERVAL: Duration = Duration::from_millis(200);
/// The shortest time between two pictures: all scans of a radar that turns four times a second, and
/// some of one that is played faster.
const PICTURE_INTERVAL: Duration = Duration::from_millis(180);
/// Time between two reports.
const REPORT_INTERVAL: Duration = Duration::from_secs(1);

/// The run to follow.
pub struct Followed {
    /// The folder of its results.
    pub out: PathBuf,
    /// Returns whether a run that has ended in this folder has reached the end of its recording.
    pub is_complete: fn(&Path) -> bool,
    /// The view of the run.
    pub view: Arc<RunView>,
}

/// Starts the threads. They end when the view is stopped.
pub fn start(followed: &Arc<Followed>) -> std::io::Result<Vec<JoinHandle<()>>> {
    let start = |name: &str, follow: fn(&Followed)| {
        let followed = Arc::clone(followed);
        let thread = thread::Builder::new().name(name.to_owned());
        thread.spawn(move || follow(&followed))
    };
    Ok(vec![
        start("poses", follow_runs)?,
        start("scans", |followed| {
            follow_pictures::<Scan>(followed, &[Layer::Scan], scan);
        })?,
        start("masked", |followed| {
            follow_pictures::<Masked>(followed, &[Layer::Raster, Layer::Points], masked);
        })?,
        start("objects", |followed| {
            follow_pictures::<Objects>(followed, &[Layer::Objects], |view, message| {
                view.set_objects(message.header());
            });
        })?,
        start("report", report)?,
    ])
}

/// Follows the run, and the next one in the same folder after its end.
fn follow_runs(followed: &Followed) {
    while !followed.view.is_stopping() {
        match ObservedRun::writing_to(&followed.out) {
            Ok(run) => follow_run(followed, &run),
            // There is no run yet.
            Err(_) => thread::sleep(POLL_INTERVAL),
        }
    }
}

fn follow_run(followed: &Followed, run: &ObservedRun) {
    let view = &followed.view;
    view.begin(run.manifest());
    let mut track = JournalTrack::of(&run.manifest().out);
    while !view.is_stopping() && !run.has_ended() {
        match follow_poses(followed, run, &mut track) {
            Ok(()) if view.is_stopping() => return,
            Ok(()) => {
                view.set_state(RunState::Finishing);
                await_end(view, run);
            }
            Err(StageError::NotRunning { .. }) => {}
            Err(error) => {
                view.set_notice(Some(format!("Poses are not shown: {error}.")));
                thread::sleep(POLL_INTERVAL);
            }
        }
    }
    if !view.is_stopping() {
        view.end(match (followed.is_complete)(&followed.out) {
            true => RunState::Complete,
            false => RunState::Interrupted,
        });
    }
}

/// Waits until the results are written and the run is gone.
fn await_end(view: &RunView, run: &ObservedRun) {
    while !view.is_stopping() && !run.has_ended() {
        thread::sleep(POLL_INTERVAL);
    }
}

/// Follows the poses to their end. The track begins with the poses of the journal, and continues
/// with the published ones.
fn follow_poses(
    followed: &Followed,
    run: &ObservedRun,
    track: &mut JournalTrack,
) -> Result<(), StageError> {
    let view = &followed.view;
    let mut poses = run.observe::<Pose>()?;
    // Without a place for it the rates are missing, and nothing else.
    let has_samples = run.manifest().limits.samples > 0;
    let mut scans = has_samples.then(|| run.observe::<Scan>().ok()).flatten();
    view.set_notice(None);
    while !view.is_stopping() {
        let limit = match track.catch_up(|pose| view.add_to_track(pose)) {
            true => Duration::ZERO,
            false => POLL_INTERVAL,
        };
        match poses.next(limit)? {
            Next::Message(message, _) => {
                let pose = message.header();
                view.add_pose(pose);
                track.see(pose, |pose| view.add_to_track(pose));
            }
            Next::Idle => {}
            Next::Ended => {
                draw_the_rest(view, track);
                break;
            }
        }
        view.set_missed(|missed| missed.pose = poses.missed());
        if let Some(scans) = &mut scans {
            while let Next::Message(scan, _) = scans.next(Duration::ZERO)? {
                view.add_samples(scan.header(), scan.values());
            }
        }
    }
    Ok(())
}

/// Draws the remaining poses of the journal when no more poses come.
fn draw_the_rest(view: &RunView, track: &mut JournalTrack) {
    while !view.is_stopping() && track.catch_up(|pose| view.add_to_track(pose)) {}
}

/// Follows a topic as long as a browser wants one of these layers.
fn follow_pictures<M: Message>(
    followed: &Followed,
    layers: &[Layer],
    picture: fn(&RunView, &Received<M>),
) {
    let view = &followed.view;
    let is_wanted = || !view.is_stopping() && layers.iter().any(|layer| view.is_wanted(*layer));
    while !view.is_stopping() {
        thread::sleep(POLL_INTERVAL);
        if !is_wanted() || view.run().state != RunState::Working {
            continue;
        }
        let seen = ObservedRun::writing_to(&followed.out)
            .and_then(|run| follow_topic(view, &run, &is_wanted, picture));
        if !is_wanted() {
            layers.iter().for_each(|layer| view.clear_pictures(*layer));
        }
        match seen {
            Ok(()) | Err(StageError::NotRunning { .. }) => {}
            Err(error) => view.set_notice(Some(format!("Not all is shown: {error}."))),
        }
    }
}

fn follow_topic<M: Message>(
    view: &RunView,
    run: &ObservedRun,
    is_wanted: &impl Fn() -> bool,
    picture: fn(&RunView, &Received<M>),
) -> Result<(), StageError> {
    let before = view.counts().missed;
    let mut observer = run.observe::<M>()?;
    let mut drawn: Option<Instant> = None;
    while is_wanted() {
        match observer.next(POLL_INTERVAL)? {
            Next::Message(message, _) => {
                if drawn.is_none_or(|drawn| drawn.elapsed() >= PICTURE_INTERVAL) {
                    drawn = Some(Instant::now());
                    picture(view, message);
                }
            }
            Next::Idle => {}
            Next::Ended => break,
        }
        let missed_now = observer.missed();
        view.set_missed(|missed| match M::TOPIC {
            Scan::TOPIC => missed.scan = before.scan + missed_now,
            Objects::TOPIC => missed.objects = before.objects + missed_now,
            _ => missed.masked = before.masked + missed_now,
        });
    }
    Ok(())
}

/// Sends the picture of a scan; without memory for it, none.
fn scan(view: &RunView, message: &Received<Scan>) {
    let item = message.item();
    let scan = message.header().view(message.values());
    let picture = scan.map(|scan| pictures::scan(&scan, item.seq, item.scan));
    if let Some(Ok(picture)) = picture {
        view.updates.scan.send_replace(picture);
    }
}

fn masked(view: &RunView, message: &Received<Masked>) {
    let (header, values, seq) = (message.header(), message.values(), message.item().seq);
    if view.is_wanted(Layer::Raster)
        && let Some(pair) = header.pair(values, None)
        && let Ok(picture) = pictures::raster(pair.later, header.cell_m, seq)
    {
        view.updates.raster.send_replace(picture);
    }
    if view.is_wanted(Layer::Points)
        && let Some(points) = header.points(values)
    {
        view.add_points(pictures::points(points, header), seq);
    }
}

/// Reports once a second.
fn report(followed: &Followed) {
    let mut meter = ProcessMeter::default();
    let mut reported = Instant::now();
    let view = &followed.view;
    while !view.is_stopping() {
        if reported.elapsed() >= REPORT_INTERVAL {
            reported = Instant::now();
            if view.run().state.is_up()
                && let Some((status, processes)) = meter.read(&followed.out)
            {
                view.set_processes(&status, processes);
            }
            view.report();
        }
        thread::sleep(POLL_INTERVAL);
    }
}
