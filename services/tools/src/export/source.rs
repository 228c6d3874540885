//! The source of an export: a run, a recording of one, or a dataset.

use std::{
    collections::{BTreeMap, BTreeSet},
    iter,
    path::{Path, PathBuf},
};

use gyre_configuration::Configuration;
use gyre_datasets::{Dataset, DatasetOptions, ground_truth::read_trajectory};
use gyre_geometry::{Pose, UncertainMotion};
use gyre_journal::{
    self as journal,
    objects::{LoggedObjects, listed},
};
use gyre_mapping::grid;
use gyre_messages::{
    Correction, CorrectionHeader, ListedObject, Message, Objects, ObjectsHeader, Pose as PoseTopic,
    PoseHeader, flag, outcome,
};
use gyre_radar::{LostAzimuths, Trajectory};
use gyre_recording::{
    Recording,
    bags::{BagWriter, Kept},
};
use gyre_ros2_messages::{
    Mounting,
    frames::{Frames, Interval, occupancy_grid},
};
use gyre_slam::RecordReader;
use gyre_terminal::{Failure, print};

use crate::maps::map;

pub struct Source {
    path: PathBuf,
    kind: Kind,
}

enum Kind {
    /// The folder of a run's results.
    Run(Box<Configuration>),
    Recording,
    Dataset,
}

/// A pose of the radar with what led to it.
#[derive(Clone, Debug)]
pub struct Place {
    /// The number of the scan in the run.
    pub seq: u64,
    /// Time of the scan, ns since 1970.
    pub stamp_ns: i64,
    /// The pose in the frame of the first scan.
    pub pose: UncertainMotion,
    /// The motion from the previous scan; `None` where the chain of motions begins.
    pub since: Option<Interval>,
    /// The pose of the odometry frame in the map frame, with SLAM.
    pub map_from_odometry: Option<Pose>,
    /// The objects, of a run that tracks them; `None` where they are not known.
    pub objects: Option<Vec<ListedObject>>,
}

impl Place {
    /// Returns the place of a pose of a run; `None` for the end of the stream.
    pub fn of(pose: &PoseHeader) -> Option<Self> {
        if pose.item.is(flag::END) {
            return None;
        }
        let motion = pose.motion.motion();
        let since = Interval {
            motion: UncertainMotion {
                motion: motion.motion,
                covariance: motion.covariance,
            },
            duration_ns: pose.motion.interval_ns,
            is_measured: pose.motion.refinement.outcome != outcome::PREDICTED,
        };
        Some(Self {
            seq: pose.item.seq,
            stamp_ns: pose.item.stamp_ns,
            pose: pose.pose(),
            since: (!pose.item.is(flag::BREAK)).then_some(since),
            map_from_odometry: None,
            objects: None,
        })
    }
}

pub type Places = Box<dyn Iterator<Item = Result<Place, Failure>>>;

/// Where azimuths of scans were lost, by the number of the scan in its recording.
pub type Lost = BTreeMap<u64, LostAzimuths>;

pub struct Scans {
    pub dataset: Box<dyn Dataset>,
    pub played: std::ops::Range<usize>,
    pub eccentricity_rad: f32,
    /// True if the angles are corrected by it.
    pub is_corrected: bool,
    /// Encoder counts per turn, if they are known.
    pub encoder_counts: Option<u16>,
}

impl Source {
    pub fn open(path: &Path) -> Result<Self, Failure> {
        let kind = match path {
            path if gyre_recording::is_recording(path) => Kind::Recording,
            path if map::exists(&journal::path(path))? => {
                let configuration = Configuration::read(&path.join("config.toml"), &[])?;
                Kind::Run(Box::new(configuration))
            }
            _ => Kind::Dataset,
        };
        Ok(Self {
            path: path.to_owned(),
            kind,
        })
    }

    /// Returns the configuration of a run; `None` of another source.
    pub fn configuration(&self) -> Option<&Configuration> {
        match &self.kind {
            Kind::Run(configuration) => Some(configuration),
            Kind::Recording | Kind::Dataset => None,
        }
    }

    pub fn places(&self) -> Result<Places, Failure> {
        match self.kind {
            Kind::Run(_) => {
                let corrected = self.path.join("trajectory_slam.tum");
                let corrected = corrected.is_file().then(|| read_trajectory(&corrected));
                let corrected = corrected.transpose()?;
                let mut tracked = RecordReader::<LoggedObjects>::open(&self.path)?;
                let records = journal::records(&journal::path(&self.path))?;
                let poses = records.into_iter().flatten();
                let mut place = move |pose: &PoseHeader| -> Result<Option<Place>, Failure> {
                    let Some(mut place) = Place::of(pose) else {
                        return Ok(None);
                    };
                    let near = |it: &Trajectory| it.near(place.stamp_ns, Trajectory::ROUNDING_NS);
                    let in_map: Option<Pose> = corrected.as_ref().and_then(near);
                    let inverse = place.pose.motion.inverse();
                    place.map_from_odometry = in_map.map(|pose| pose * inverse);
                    let seq = place.seq as usize;
                    if seq < tracked.len() {
                        let objects = tracked.read(seq)?.objects;
                        place.objects = Some(objects.iter().map(listed).collect());
                    }
                    Ok(Some(place))
                };
                let places = poses.map(move |pose| place(&pose?));
                Ok(Box::new(places.filter_map(Result::transpose)))
            }
            Kind::Recording => recorded(gyre_recording::open_recording(&self.path)?),
            Kind::Dataset => Ok(Box::new(iter::empty())),
        }
    }

    /// Returns where azimuths were lost of each scan that has a pose in a run; nothing of another
    /// source.
    pub fn lost(&self) -> Result<Lost, Failure> {
        let mut lost = Lost::new();
        if matches!(self.kind, Kind::Run(_)) {
            let records = journal::records(&journal::path(&self.path))?;
            for pose in records.into_iter().flatten() {
                let item = pose?.item;
                if !item.is(flag::END) {
                    lost.insert(item.scan, item.lost_azimuths());
                }
            }
        }
        Ok(lost)
    }

    /// Returns the scans; `None` of a run of a radar, which leaves none.
    pub fn scans(&self) -> Result<Option<Scans>, Failure> {
        if let Kind::Run(configuration) = &self.kind {
            if configuration.is_radar() {
                return Ok(None);
            }
            let mut configuration = configuration.clone();
            // The angles of an encoder are written as it counts them: who reads them corrects its
            // eccentricity.
            let eccentricity = &mut configuration.dataset.azimuth_eccentricity_rad;
            let eccentricity_rad = eccentricity.replace(0.0).unwrap_or_default();
            let dataset = gyre_configuration::open(&configuration)?.dataset;
            return Ok(Some(Scans {
                played: configuration.source.played(dataset.scans()),
                encoder_counts: dataset.encoder_counts(),
                dataset,
                eccentricity_rad,
                is_corrected: false,
            }));
        }
        let is_corrected = matches!(self.kind, Kind::Recording);
        let stored = gyre_recording::stored_options(&self.path)?;
        let options = DatasetOptions {
            azimuth_eccentricity_rad: (!is_corrected).then_some(0.0),
            ..DatasetOptions::default()
        };
        let dataset = gyre_recording::open(&self.path, &options)?;
        Ok(Some(Scans {
            played: dataset.first()..dataset.len(),
            encoder_counts: match is_corrected {
                true => stored.encoder_counts,
                false => dataset.encoder_counts(),
            },
            dataset,
            eccentricity_rad: stored.azimuth_eccentricity_rad.unwrap_or_default(),
            is_corrected,
        }))
    }

    pub fn write_map(
        &self,
        bag: &mut BagWriter,
        frames: &Frames,
        stamp_ns: i64,
        mounting: &Mounting,
    ) -> Result<(), Failure> {
        let Kind::Run(configuration) = &self.kind else {
            return Ok(());
        };
        if !configuration.slam.is_on() {
            return Ok(());
        }
        let aside = tempfile::tempdir()?;
        // Along the axes of the vehicle: Nav2 ignores the rotation of a grid.
        let mut evidence = match map::evidence(&self.path, aside.path(), mounting.radar()) {
            Ok(evidence) => evidence,
            Err(reason) => {
                print::note(format_args!("the bag has no map: {reason}"));
                return Ok(());
            }
        };
        let grid = grid(&mut evidence)?;
        let (size, corner_m) = ([grid.columns, grid.rows], grid.corner_m);
        let (frame, cell_m) = (&frames.map, grid.cell_m);
        let grid = occupancy_grid(stamp_ns, frame, cell_m, size, corner_m, grid.values);
        let topic = bag.topic("/map", Kept::ForLater)?;
        bag.write(&topic, stamp_ns, &grid)?;
        Ok(())
    }
}

/// Returns the poses of a recording, each with its objects, and the correction that was known then.
fn recorded(mut recording: Recording) -> Result<Places, Failure> {
    let sequences = |recording: &Recording, topic: &str| -> Vec<u64> {
        recording.entries(topic).map(|entry| entry.seq).collect()
    };
    let mut corrections = Vec::new();
    for seq in sequences(&recording, Correction::TOPIC) {
        let header: CorrectionHeader = recording.read_header(Correction::TOPIC, seq)?;
        corrections.push((header.item.stamp_ns, header.map_from_odometry()));
    }
    let tracked: BTreeSet<u64> = sequences(&recording, Objects::TOPIC).into_iter().collect();
    let poses = sequences(&recording, PoseTopic::TOPIC).into_iter();
    let mut place = move |seq| -> Result<Option<Place>, Failure> {
        let header: PoseHeader = recording.read_header(PoseTopic::TOPIC, seq)?;
        let Some(place) = Place::of(&header) else {
            return Ok(None);
        };
        let objects: Option<ObjectsHeader> = match tracked.contains(&seq) {
            true => Some(recording.read_header(Objects::TOPIC, seq)?),
            false => None,
        };
        let known = corrections
            .iter()
            .take_while(|(ns, _)| *ns <= place.stamp_ns);
        Ok(Some(Place {
            map_from_odometry: known.last().map(|(_, correction)| *correction),
            objects: objects.map(|header| header.list().to_vec()),
            ..place
        }))
    };
    Ok(Box::new(
        poses.filter_map(move |seq| place(seq).transpose()),
    ))
}
