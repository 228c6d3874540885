//! Loop closing: follows `journal/keyframes.log`, and keeps the places of keyframes in
//! `journal/places.log` and the verdicts on all candidates in `journal/loops.log`. A restarted
//! process continues from both logs. Both follow from the keyframes, whenever those come.

use std::collections::VecDeque;

use gyre_contract::{Loop, LoopHeader, run::StageCounters};
use gyre_journal::loops::loops_of;
use gyre_matching::RefinementConfig;
use gyre_radar::points::PointsConfig;
use gyre_slam::{
    ClosingError, Keyframe, LoopCloser, Place, Query, RecordLog, RecordReader, SlamConfig,
    estimation::places::{MAX_NEIGHBOURS, neighbours},
};
use gyre_stage::{
    Follower, Launch,
    follower::{self, Progress, Step},
};
use gyre_transport::{RunError, services::LogId, transport::Notifier};

pub fn run(launch: &Launch) -> Result<StageCounters, RunError> {
    launch.take_place()?;
    let (slam, refinement, points): (SlamConfig, RefinementConfig, PointsConfig) = (
        launch.section("slam")?,
        launch.section("refinement")?,
        launch.section("points")?,
    );
    let submap_reach_m = slam.submap_reach_m;
    let new_closer = move || {
        let closer = LoopCloser::new(submap_reach_m, &refinement, points.capacity);
        closer.map_err(RunError::input)
    };
    let out = &launch.manifest.out;
    let mut closing = LoopClosing {
        growth: LogId::Loops.growth(&launch.node)?,
        keyframes: RecordReader::open(out)?,
        places: RecordLog::open(out)?,
        queries: RecordLog::open(out)?,
        closer: new_closer()?,
        new_closer: Box::new(new_closer),
        submap_reach_m,
        loops: 0,
        pending: VecDeque::new(),
        has_finished: false,
    };
    closing.restore(None)?;
    follower::run(launch, &mut closing)
}

/// The logs, and what follows from the records read so far.
struct LoopClosing {
    /// Wakes the readers of the queries.
    growth: Notifier,
    keyframes: RecordReader<Keyframe>,
    places: RecordLog<Place>,
    queries: RecordLog<Query>,
    closer: LoopCloser,
    new_closer: Box<dyn Fn() -> Result<LoopCloser, RunError>>,
    submap_reach_m: f64,
    loops: u64,
    pending: VecDeque<LoopHeader>,
    has_finished: bool,
}

impl Follower for LoopClosing {
    type Output = Loop;
    const LOGS: &'static [LogId] = &[LogId::Keyframes];

    fn step(&mut self) -> Result<Step<LoopHeader>, RunError> {
        if let Some(unchanged) = self.look()? {
            self.closer = (self.new_closer)()?;
            self.restore(Some(unchanged))?;
        }
        if let Some(found) = self.pending.pop_front() {
            return Ok(Step::Worked(Some(found)));
        }
        let next = self.closer.keyframes();
        if next < self.keyframes.len() {
            let pushed = self.keyframes.read(next)?;
            self.closer.push(&pushed).map_err(RunError::input)?;
            return Ok(Step::Worked(None));
        }
        if self.keyframes.has_ended() && !self.has_finished {
            self.closer.finish();
            self.has_finished = true;
        }
        self.close()
    }

    fn sync(&mut self) -> Result<(), RunError> {
        self.places.sync()?;
        Ok(self.queries.sync()?)
    }

    fn progress(&self) -> Progress {
        Progress::of(self.queries.len(), self.keyframes.len())
    }
}

impl LoopClosing {
    /// Gives the places and queries that are there to a new closer, and cuts off those that
    /// keyframes which are no longer there have led to. `unchanged` is the number of keyframes that
    /// are as they were; `None`: none was cut off.
    fn restore(&mut self, unchanged: Option<usize>) -> Result<(), RunError> {
        let places = self.known_places(unchanged)?;
        if places < self.places.len() {
            self.places.cut(places)?;
        }
        let is_whole = self.keyframes.has_ended() && unchanged.is_none();
        if !is_whole || places < self.queries.len() {
            // With more keyframes to come, the queries have not ended either.
            self.queries.cut(places)?;
        }
        for index in 0..places {
            let place = self.places.read(index)?;
            let restored = self.closer.restore_place::<RunError>(&place);
            restored.map_err(failed)?;
        }
        (self.loops, self.has_finished) = (0, false);
        self.pending.clear();
        for index in 0..self.queries.len() {
            let query = self.queries.read(index)?;
            self.note(&query)?;
            // An observer that comes now receives the last one.
            self.pending.drain(..self.pending.len().saturating_sub(1));
        }
        self.closer.restore_queries(self.queries.len());
        Ok(())
    }

    /// Returns how many of the places follow from the keyframes that are there.
    fn known_places(&mut self, unchanged: Option<usize>) -> Result<usize, RunError> {
        let keyframes = unchanged.unwrap_or(usize::MAX).min(self.keyframes.len());
        let places = self.places.len().min(keyframes);
        if self.keyframes.has_ended() && unchanged.is_none() {
            return Ok(places);
        }
        // A place follows from the keyframes around it.
        let first = places.saturating_sub(MAX_NEIGHBOURS + 1);
        let path_m = |index| Ok(self.keyframes.read(index)?.path_m);
        let path_m: Result<Vec<f64>, RunError> = (first..keyframes).map(path_m).collect();
        let path_m = path_m?;
        let is_incomplete = |place: &usize| {
            first + neighbours(&path_m, place - first, self.submap_reach_m).end >= keyframes
        };
        Ok((first..places).find(is_incomplete).unwrap_or(places))
    }

    /// Looks for new keyframes. Returns the number of those that are as they were, if some have
    /// been cut off.
    fn look(&mut self) -> Result<Option<usize>, RunError> {
        let known = self.keyframes.len();
        self.keyframes.refresh()?;
        let unchanged = self.keyframes.unchanged();
        let was_cut = unchanged < known || (self.has_finished && !self.keyframes.has_ended());
        Ok(was_cut.then_some(unchanged))
    }

    fn close(&mut self) -> Result<Step<LoopHeader>, RunError> {
        let mut read = |index: usize| self.keyframes.read(index).map_err(RunError::from);
        if let Some(place) = self.closer.describe(&mut read).map_err(failed)? {
            self.places.append(&place)?;
            return Ok(Step::Worked(None));
        }
        if let Some(query) = self.closer.close(&mut read).map_err(failed)? {
            self.queries.append(&query)?;
            self.growth.notify()?;
            self.note(&query)?;
            return Ok(Step::Worked(self.pending.pop_front()));
        }
        if !self.has_finished {
            return Ok(Step::Idle);
        }
        self.queries.end()?;
        self.growth.notify()?;
        Ok(Step::Ended)
    }

    /// Counts the loops of a query, which are to be published.
    fn note(&mut self, query: &Query) -> Result<(), RunError> {
        let found = loops_of(query, self.loops, &mut self.keyframes)?;
        self.loops += found.len() as u64;
        self.pending.extend(found);
        Ok(())
    }
}

fn failed(error: ClosingError<RunError>) -> RunError {
    match error {
        ClosingError::Source(error) => error,
        other => RunError::input(other),
    }
}
