//! Localisation of a run in the map of an earlier drive: follows `journal/keyframes.log`, and
//! publishes each place as a `fix`. Its fixes depend only on the keyframes, the map, and the
//! commands that give a place.

use gyre_contract::{
    Command, CommandsOfScans, Fix, FixHeader, Item, fix_status, run::StageCounters,
};
use gyre_geometry::{UncertainMotion, covariance, xy_yaw};
use gyre_matching::RefinementConfig;
use gyre_radar::points::PointsConfig;
use gyre_slam::{
    Keyframe, RecordReader, SlamConfig,
    localisation::{Localisation, Localiser, Map, Observation, Status},
};
use gyre_stage::{
    Follower, Launch,
    follower::{self, Progress, Step},
};
use gyre_transport::{RunError, services::LogId};

pub fn run(launch: &Launch) -> Result<StageCounters, RunError> {
    let slam: SlamConfig = launch.section("slam")?;
    let refinement: RefinementConfig = launch.section("refinement")?;
    let points: PointsConfig = launch.section("points")?;
    let map = Map::open(&slam.map).map_err(RunError::input)?;
    let localiser = Localiser::new(map, &refinement, points.capacity);
    launch.take_place()?;
    let mut places = Fixes {
        keyframes: RecordReader::open(&launch.manifest.out)?,
        localiser: localiser.map_err(RunError::input)?,
        commands: CommandsOfScans::open(&launch.manifest.out).map_err(RunError::input)?,
        read: 0,
    };
    follower::run(launch, &mut places)
}

struct Fixes {
    keyframes: RecordReader<Keyframe>,
    localiser: Localiser,
    commands: CommandsOfScans,
    read: usize,
}

impl Fixes {
    /// Looks for new keyframes. If some of the keyframes that were read have been cut off, it
    /// restarts from the first keyframe.
    fn look(&mut self) -> Result<(), RunError> {
        self.keyframes.refresh()?;
        if self.keyframes.unchanged() < self.read {
            self.localiser.reset();
            self.commands.restart();
            self.read = 0;
        }
        Ok(())
    }

    fn locate_next(&mut self) -> Result<FixHeader, RunError> {
        let keyframe = self.keyframes.read(self.read)?;
        let mut motion = keyframe.motion;
        if let Some(given) = self.given(keyframe.stamp_ns)? {
            self.localiser.place(given, keyframe.stamp_ns);
            motion = UncertainMotion::identity();
        }
        let found = self.localiser.locate(&Observation {
            stamp_ns: keyframe.stamp_ns,
            points: &keyframe.points,
            twist: keyframe.twist,
            motion,
        });
        let header = header(self.read, &keyframe, &found, self.localiser.map());
        self.read += 1;
        Ok(header)
    }

    /// Returns the place that a command has given since the keyframe before. With a new map the
    /// keyframes begin again, and a place from before is an old one.
    fn given(&mut self, stamp_ns: i64) -> Result<Option<UncertainMotion>, RunError> {
        let new = self.commands.of_scan(stamp_ns).map_err(RunError::input)?;
        Ok(new.fold(None, |given, command| match command {
            Command::Locate { at } => Some(at.pose()),
            _ if command.starts_map() => None,
            _ => given,
        }))
    }
}

impl Follower for Fixes {
    type Output = Fix;
    const LOGS: &'static [LogId] = &[LogId::Keyframes];

    fn step(&mut self) -> Result<Step<FixHeader>, RunError> {
        self.look()?;
        if self.read < self.keyframes.len() {
            return Ok(Step::Worked(Some(self.locate_next()?)));
        }
        Ok(match self.keyframes.has_ended() {
            true => Step::Ended,
            false => Step::Idle,
        })
    }

    fn progress(&self) -> Progress {
        Progress::of(self.read, self.keyframes.len())
    }
}

fn header(index: usize, keyframe: &Keyframe, found: &Localisation, map: &Map) -> FixHeader {
    let mut header = FixHeader {
        item: Item::recorded(index as u64, keyframe.scan, keyframe.stamp_ns),
        keyframe_seq: keyframe.seq,
        status: match found.status {
            Status::Lost => fix_status::LOST,
            Status::Found => fix_status::FOUND,
            Status::Tracked => fix_status::TRACKED,
            // Away from the map a prediction is no place.
            Status::Predicted if found.fix.is_none() => fix_status::LOST,
            Status::Predicted => fix_status::PREDICTED,
        },
        ..FixHeader::default()
    };
    if let Some(fix) = &found.fix {
        header.place = map.keyframes()[fix.keyframe].scan;
        [header.x_m, header.y_m, header.yaw_rad] = xy_yaw(&fix.pose.motion);
        header.covariance = covariance::pack(&fix.pose.covariance);
        header.correlation = fix.correlation;
    }
    header
}
