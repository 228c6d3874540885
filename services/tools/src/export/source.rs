//! The source of an export: a run, a recording of one, or a dataset.

use std::{
    collections::{BTreeMap, BTreeSet},
    iter,
    path::{Path, PathBuf},
};

use gyre_configuration::{
    Configuration,
    terminal::{Failure, print},
};
use gyre_contract::{
    Correction, CorrectionHeader, Message, Object, Objects, ObjectsHeader, Pose as PoseTopic,
    PoseHeader, flag,
};
use gyre_datasets::{Dataset, DatasetOptions, ground_truth::read_trajectory};
use gyre_geometry::{LostAzimuths, Pose};
use gyre_journal::{self as journal, objects::LoggedObjects};
use gyre_radar::Trajectory;
use gyre_recording::{
    Recording,
    bags::{BagWriter, Kept},
};
use gyre_ros2_messages::{Vehicle, frames::occupancy_grid};
use gyre_slam::{RecordReader, mapping::grid};
use gyre_storage::LogError;

use crate::maps::map;

pub struct Source {
    path: PathBuf,
    is_recording: bool,
    /// The configuration of a run, whose folder of results it is.
    pub run: Option<Configuration>,
}

/// A pose of a run, and its time where it is known.
#[derive(Clone, Debug)]
pub struct Place {
    pub pose: PoseHeader,
    /// The pose of the odometry frame in the map frame, with SLAM.
    pub map_from_odometry: Option<Pose>,
    /// The objects, of a run that tracks them; `None` where they are not known.
    pub objects: Option<Vec<Object>>,
}

impl Place {
    pub fn stamp_ns(&self) -> i64 {
        self.pose.item.stamp_ns
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
        let is_recording = gyre_recording::is_recording(path);
        let is_run = !is_recording && map::exists(&journal::path(path))?;
        let run = is_run.then(|| map::configuration(path)).transpose()?;
        Ok(Self {
            path: path.to_owned(),
            is_recording,
            run,
        })
    }

    pub fn places(&self) -> Result<Places, Failure> {
        if self.is_recording {
            return recorded(gyre_recording::open_recording(&self.path)?);
        }
        if self.run.is_none() {
            return Ok(Box::new(iter::empty()));
        }
        let corrected = self.path.join("trajectory_slam.tum");
        let corrected = corrected.is_file().then(|| read_trajectory(&corrected));
        let corrected = corrected.transpose()?;
        let mut tracked = RecordReader::<LoggedObjects>::open(&self.path)?;
        let mut place = move |pose: PoseHeader| -> Result<Place, Failure> {
            let (seq, stamp_ns) = (pose.item.seq as usize, pose.item.stamp_ns);
            let near = |it: &Trajectory| it.near(stamp_ns, Trajectory::ROUNDING_NS);
            let in_map: Option<Pose> = corrected.as_ref().and_then(near);
            let inverse = pose.pose().motion.inverse();
            let objects: Option<Vec<Object>> = match seq < tracked.len() {
                true => Some(tracked.read(seq)?.objects),
                false => None,
            };
            Ok(Place {
                pose,
                map_from_odometry: in_map.map(|pose| pose * inverse),
                objects,
            })
        };
        Ok(Box::new(self.poses()?.map(move |pose| place(pose?))))
    }

    /// Returns the poses of a run, without the end of the stream.
    fn poses(&self) -> Result<impl Iterator<Item = Result<PoseHeader, LogError>> + use<>, Failure> {
        let poses = journal::poses(&self.path)?;
        let is_end = |pose: &PoseHeader| pose.item.is(flag::END);
        Ok(poses.filter(move |pose| !pose.as_ref().is_ok_and(is_end)))
    }

    /// Returns where azimuths were lost of each scan that has a pose in a run; nothing of another
    /// source.
    pub fn lost(&self) -> Result<Lost, Failure> {
        let mut lost = Lost::new();
        if self.run.is_some() {
            for pose in self.poses()? {
                let item = pose?.item;
                lost.insert(item.scan, item.lost_azimuths());
            }
        }
        Ok(lost)
    }

    /// Returns the scans; `None` of a run of a radar, which leaves none.
    pub fn scans(&self) -> Result<Option<Scans>, Failure> {
        if let Some(configuration) = &self.run {
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
        let is_corrected = self.is_recording;
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
        stamp_ns: i64,
        vehicle: &Vehicle,
    ) -> Result<(), Failure> {
        if !self.run.as_ref().is_some_and(|run| run.slam.is_on()) {
            return Ok(());
        }
        let aside = tempfile::tempdir()?;
        // Along the axes of the vehicle: Nav2 ignores the rotation of a grid.
        let radar = vehicle.mounting.radar();
        let mut evidence = match map::evidence(&self.path, aside.path(), radar) {
            Ok(evidence) => evidence,
            Err(reason) => {
                print::note(format_args!("the bag has no map: {reason}"));
                return Ok(());
            }
        };
        let grid = grid(&mut evidence)?;
        let (size, corner_m) = ([grid.columns, grid.rows], grid.corner_m);
        let (frame, cell_m) = (&vehicle.frames.map, grid.cell_m);
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
        let pose: PoseHeader = recording.read_header(PoseTopic::TOPIC, seq)?;
        if pose.item.is(flag::END) {
            return Ok(None);
        }
        let objects: Option<ObjectsHeader> = match tracked.contains(&seq) {
            true => Some(recording.read_header(Objects::TOPIC, seq)?),
            false => None,
        };
        let known = corrections
            .iter()
            .take_while(|(ns, _)| *ns <= pose.item.stamp_ns);
        Ok(Some(Place {
            pose,
            map_from_odometry: known.last().map(|(_, correction)| *correction),
            objects: objects.map(|header| header.list().to_vec()),
        }))
    };
    Ok(Box::new(
        poses.filter_map(move |seq| place(seq).transpose()),
    ))
}
