//! The threads that follow the run.

use std::{
    path::{Path, PathBuf},
    sync::Arc,
    thread::{self, JoinHandle},
    time::{Duration, Instant},
};

use axum::{body::Bytes, extract::ws};
use gyre_client::{Next, Observer, Received, Run, RunError};
use gyre_contract::{Masked, Message, Objects, Pose, PoseHeader, Scan};

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
const REPORT_INTERVAL: Duration = Duration::from_secs(1);

pub struct Followed {
    pub out: PathBuf,
    /// Returns whether a run that has ended in this folder has reached the end of its recording.
    pub is_complete: fn(&Path) -> bool,
    pub view: Arc<RunView>,
}

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

fn follow_runs(followed: &Followed) {
    while !followed.view.is_stopping() {
        match Run::open(&followed.out) {
            Ok(run) => follow_run(followed, &run),
            // There is no run yet.
            Err(_) => thread::sleep(POLL_INTERVAL),
        }
    }
}

fn follow_run(followed: &Followed, run: &Run) {
    let view = &followed.view;
    view.begin(run.manifest());
    let mut track = JournalTrack::of(&run.manifest().out);
    while !view.is_stopping() && !run.has_ended() {
        match follow_poses(followed, run, &mut track) {
            Ok(()) if view.is_stopping() => return,
            Ok(()) => {
                view.set_state(RunState::Finishing);
                while !view.is_stopping() && !run.has_ended() {
                    thread::sleep(POLL_INTERVAL);
                }
            }
            Err(RunError::NotRunning { .. }) => {}
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

fn follow_poses(followed: &Followed, run: &Run, track: &mut JournalTrack) -> Result<(), RunError> {
    let view = &followed.view;
    let mut poses = run.observe::<Pose>()?;
    // Without a place for it the rates are missing, and nothing else.
    let has_samples = run.manifest().limits.samples > 0;
    let mut scans = has_samples.then(|| run.observe::<Scan>().ok()).flatten();
    view.set_notice(None);
    let mut newest: Option<PoseHeader> = None;
    while !view.is_stopping() {
        let see = |newest: &PoseHeader| track.see(newest, |pose| view.add_to_track(pose));
        let is_behind = newest.as_ref().is_some_and(see);
        let limit = match is_behind {
            true => Duration::ZERO,
            false => POLL_INTERVAL,
        };
        match poses.next(limit)? {
            Next::Message(message, missed) => {
                view.add_missed(Pose::TOPIC, missed);
                view.add_pose(message.header());
                newest = Some(*message.header());
            }
            Next::Idle => {}
            // First the remaining poses of the journal.
            Next::Ended if is_behind => {}
            Next::Ended => break,
        }
        if let Some(scans) = &mut scans {
            while let Next::Message(scan, _) = scans.next(Duration::ZERO)? {
                view.add_samples(scan.header(), scan.values());
            }
        }
    }
    Ok(())
}

fn follow_pictures<M: Message>(
    followed: &Followed,
    layers: &[Layer],
    picture: fn(&RunView, &Received<M>),
) {
    let view = &followed.view;
    let is_wanted = || !view.is_stopping() && layers.iter().any(|layer| view.is_wanted(*layer));
    while !view.is_stopping() {
        let mut drawn: Option<Instant> = None;
        let failed = follow_topic(
            followed,
            Run::observe::<M>,
            &is_wanted,
            |message, missed| {
                view.add_missed(M::TOPIC, missed);
                if drawn.is_none_or(|drawn| drawn.elapsed() >= PICTURE_INTERVAL) {
                    drawn = Some(Instant::now());
                    picture(view, message);
                }
            },
        );
        if !is_wanted() {
            // A later browser is not shown an old picture.
            for layer in layers {
                view.updates.of(*layer).send_replace(None);
            }
        }
        if let Err(error) = failed {
            view.set_notice(Some(format!("Not all is shown: {error}.")));
        }
    }
}

/// Waits for a poll, and follows a topic of the run, if there is one, as long as the topic is
/// wanted: calls `take` with each message, and with the number of those missed before it.
pub fn follow_topic<M>(
    followed: &Followed,
    observe: impl FnOnce(&Run) -> Result<Observer<M>, RunError>,
    is_wanted: &dyn Fn() -> bool,
    mut take: impl FnMut(&Received<M>, u64),
) -> Result<(), RunError> {
    thread::sleep(POLL_INTERVAL);
    if !is_wanted() || followed.view.run().state != RunState::Working {
        return Ok(());
    }
    let followed = Run::open(&followed.out).and_then(|run| {
        let mut observer = observe(&run)?;
        while is_wanted() {
            match observer.next(POLL_INTERVAL)? {
                Next::Message(message, missed) => take(message, missed),
                Next::Idle => {}
                Next::Ended => break,
            }
        }
        Ok(())
    });
    match followed {
        Err(RunError::NotRunning { .. }) => Ok(()),
        followed => followed,
    }
}

fn scan(view: &RunView, message: &Received<Scan>) {
    let item = message.item();
    let scan = message.header().view(message.values());
    let picture = scan.map(|scan| pictures::scan(&scan, item.seq, item.scan));
    if let Some(Ok(picture)) = picture {
        show(view, Layer::Scan, picture);
    }
}

fn show(view: &RunView, layer: Layer, picture: Bytes) {
    let picture = ws::Message::Binary(picture);
    view.updates.of(layer).send_replace(Some(picture));
}

fn masked(view: &RunView, message: &Received<Masked>) {
    let (header, values, seq) = (message.header(), message.values(), message.item().seq);
    if view.is_wanted(Layer::Raster)
        && let Some(pair) = header.pair(values, None)
        && let Ok(picture) = pictures::raster(pair.later, header.cell_m, seq)
    {
        show(view, Layer::Raster, picture);
    }
    if view.is_wanted(Layer::Points)
        && let Some(points) = header.points(values)
    {
        view.add_points(pictures::points(points, header), seq);
    }
}

fn report(followed: &Followed) {
    let mut meter = ProcessMeter::default();
    let mut reported = Instant::now();
    let view = &followed.view;
    while !view.is_stopping() {
        if reported.elapsed() >= REPORT_INTERVAL {
            reported = Instant::now();
            match meter.read(&followed.out) {
                Some((status, processes)) => view.set_processes(&status, processes),
                None => view.set_unknown(),
            }
            view.report();
        }
        thread::sleep(POLL_INTERVAL);
    }
}
