//! The threads that follow the run.

use std::{
    path::{Path, PathBuf},
    sync::Arc,
    thread::{self, JoinHandle},
    time::{Duration, Instant},
};

use gyre_journal as journal;
use gyre_messages::{Masked, Message, Pose, Scan};
use gyre_stage::{
    StageError,
    observer::{Next, ObservedRun},
    reader::Received,
};

use crate::{
    board::Board,
    messages::{Layer, RunState},
    pictures,
    processes::ProcessMeter,
    traces::Exporter,
};

/// Time between two looks for a run, for browsers that want a layer, and for a request to stop.
const LOOK: Duration = Duration::from_millis(200);
/// The shortest time between two pictures: all scans of a radar that turns four times a second, and some of one that is played faster.
const PICTURE_INTERVAL: Duration = Duration::from_millis(180);
/// Time between two reports.
const REPORT_INTERVAL: Duration = Duration::from_secs(1);

/// The run to follow.
pub struct Followed {
    /// The folder of its results.
    pub out: PathBuf,
    /// Returns whether a run that has ended in this folder has reached the end of its recording.
    pub is_complete: fn(&Path) -> bool,
    /// What is seen of it.
    pub board: Arc<Board>,
    /// Where each pose is sent as a trace.
    pub traces: Option<Exporter>,
}

/// Starts the threads. They end when the board is stopped.
///
/// # Errors
/// The system refuses a thread.
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
        start("report", report)?,
    ])
}

/// Follows the run, and the next one in the same folder after its end.
fn follow_runs(followed: &Followed) {
    while !followed.board.is_stopping() {
        match ObservedRun::writing_to(&followed.out) {
            Ok(run) => follow_run(followed, &run),
            // There is none.
            Err(_) => thread::sleep(LOOK),
        }
    }
}

fn follow_run(followed: &Followed, run: &ObservedRun) {
    let board = &followed.board;
    board.begin(run.manifest());
    while !board.is_stopping() && !run.has_ended() {
        match follow_poses(followed, run) {
            Ok(()) if board.is_stopping() => return,
            Ok(()) => {
                board.set_state(RunState::Finishing);
                await_end(board, run);
            }
            Err(StageError::NotRunning(_)) => {}
            Err(error) => {
                board.set_notice(Some(format!("Poses are not shown: {error}.")));
                thread::sleep(LOOK);
            }
        }
    }
    if !board.is_stopping() {
        board.end(match (followed.is_complete)(&followed.out) {
            true => RunState::Complete,
            false => RunState::Interrupted,
        });
    }
}

/// Waits until the results are written and the run is gone.
fn await_end(board: &Board, run: &ObservedRun) {
    while !board.is_stopping() && !run.has_ended() {
        thread::sleep(LOOK);
    }
}

/// Follows the poses to their end. Those of the journal come first.
fn follow_poses(followed: &Followed, run: &ObservedRun) -> Result<(), StageError> {
    let board = &followed.board;
    let mut poses = run.observe::<Pose>()?;
    board.set_notice(None);
    let journalled = add_journal(board, &run.manifest().out);
    while !board.is_stopping() {
        match poses.next(LOOK)? {
            Next::Message(message, _) => {
                let pose = message.header();
                let is_new = journalled.is_none_or(|last| pose.item.seq > last);
                board.add_pose(pose, is_new);
                if let Some(traces) = &followed.traces {
                    traces.add(&run.manifest().prefix, pose);
                }
            }
            Next::Idle => {}
            Next::Ended => break,
        }
        board.set_missed(|missed| missed.pose = poses.missed());
    }
    Ok(())
}

/// Adds the poses of the journal, and returns the number of the last one. A journal that cannot be read is only not shown.
fn add_journal(board: &Board, out: &Path) -> Option<u64> {
    board.clear_track();
    let records = journal::records(&journal::path(out)).ok()??;
    let poses = records.map_while(Result::ok);
    let add = |pose| {
        board.add_earlier(&pose);
        pose.item.seq
    };
    poses.map(add).last()
}

/// Follows a topic as long as a browser wants one of its layers.
fn follow_pictures<M: Message>(
    followed: &Followed,
    layers: &[Layer],
    picture: fn(&Board, &Received<M>),
) {
    let board = &followed.board;
    let is_wanted = || !board.is_stopping() && layers.iter().any(|layer| board.is_wanted(*layer));
    while !board.is_stopping() {
        thread::sleep(LOOK);
        if !is_wanted() || board.run().state != RunState::Working {
            continue;
        }
        let seen = ObservedRun::writing_to(&followed.out)
            .and_then(|run| follow_topic(board, &run, &is_wanted, picture));
        if !is_wanted() {
            layers.iter().for_each(|layer| board.clear_pictures(*layer));
        }
        match seen {
            Ok(()) | Err(StageError::NotRunning(_)) => {}
            Err(error) => board.set_notice(Some(format!("Not all is shown: {error}."))),
        }
    }
}

fn follow_topic<M: Message>(
    board: &Board,
    run: &ObservedRun,
    is_wanted: &impl Fn() -> bool,
    picture: fn(&Board, &Received<M>),
) -> Result<(), StageError> {
    let before = board.counts().missed;
    let mut observer = run.observe::<M>()?;
    let mut drawn: Option<Instant> = None;
    while is_wanted() {
        match observer.next(LOOK)? {
            Next::Message(message, _) => {
                if drawn.is_none_or(|drawn| drawn.elapsed() >= PICTURE_INTERVAL) {
                    drawn = Some(Instant::now());
                    picture(board, message);
                }
            }
            Next::Idle => {}
            Next::Ended => break,
        }
        let missed_now = observer.missed();
        board.set_missed(|missed| match M::TOPIC {
            Scan::TOPIC => missed.scan = before.scan + missed_now,
            _ => missed.masked = before.masked + missed_now,
        });
    }
    Ok(())
}

/// A scan whose rows do not fit its header was refused by the observer; one for whose picture there is no memory is left out.
fn scan(board: &Board, message: &Received<Scan>) {
    let item = message.item();
    let scan = message.header().view(message.values());
    let picture = scan.map(|scan| pictures::scan(&scan, item.seq, item.scan));
    if let Some(Ok(picture)) = picture {
        board.news.scan.send_replace(picture);
    }
}

fn masked(board: &Board, message: &Received<Masked>) {
    let (header, values, seq) = (message.header(), message.values(), message.item().seq);
    if board.is_wanted(Layer::Raster)
        && let Some(pair) = header.pair(values, None)
        && let Ok(picture) = pictures::raster(pair.later, header.cell_m, seq)
    {
        board.news.raster.send_replace(picture);
    }
    if board.is_wanted(Layer::Points)
        && let Some(points) = header.points(values)
    {
        board.add_points(pictures::points(points, header), seq);
    }
}

/// Reports once a second.
fn report(followed: &Followed) {
    let mut meter = ProcessMeter::default();
    let mut reported = Instant::now();
    let board = &followed.board;
    while !board.is_stopping() {
        if reported.elapsed() >= REPORT_INTERVAL {
            reported = Instant::now();
            if board.run().state.is_up()
                && let Some((status, processes)) = meter.look(&followed.out)
            {
                board.set_processes(&status, processes);
            }
            board.report();
        }
        thread::sleep(LOOK);
    }
}
