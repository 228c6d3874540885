use std::path::Path;

use gyre_geometry::Pose;
use gyre_matching::Submap;
use gyre_storage::{LogError, Record, RecordLog, RecordReader};
use nalgebra::Point2;
use thiserror::Error;

use crate::{
    Keyframe,
    estimation::places::{
        Candidate, Describer, Descriptor, MAX_NEIGHBOURS, OrderError, PlaceFileError, PlaceIndex,
        SUBMAP_REACH_M, neighbours,
    },
};

const KEYFRAMES: &str = Keyframe::FILE;
const PLACES: &str = "places.index";

#[derive(Debug, Error)]
pub enum MapError {
    #[error("a map needs keyframes: there is none")]
    Empty,
    #[error(transparent)]
    Order(#[from] OrderError),
    #[error(transparent)]
    Keyframes(#[from] LogError),
    #[error(transparent)]
    Places(#[from] PlaceFileError),
    #[error("{0}")]
    Unlike(String),
}

pub struct Map {
    keyframes: Vec<Keyframe>,
    path_m: Vec<f64>,
    index: PlaceIndex,
}

impl Map {
    /// Describes all keyframes of a drive. [`Keyframe::pose`] is in the map's frame.
    pub fn new(keyframes: Vec<Keyframe>) -> Result<Self, MapError> {
        let index = PlaceIndex::with_capacity(keyframes.len());
        let mut map = Self::with_index(keyframes, index)?;
        let (mut submap, mut describer) = (map.new_submap(), Describer::new());
        let mut descriptor = Descriptor::default();
        for k in 0..map.keyframes.len() {
            map.draw(k, &mut submap);
            describer.describe(&submap, &mut descriptor);
            let keyframe = &map.keyframes[k];
            map.index
                .insert(keyframe.scan, keyframe.path_m, &descriptor)?;
        }
        Ok(map)
    }

    /// Writes the map into a folder: `keyframes.log` and `places.index`. A map that is there is
    /// replaced.
    pub fn save(&self, folder: &Path) -> Result<(), MapError> {
        let mut log = RecordLog::<Keyframe>::open_file(&folder.join(KEYFRAMES))?;
        log.cut(0)?;
        for keyframe in &self.keyframes {
            log.append(keyframe)?;
        }
        self.index.save(&folder.join(PLACES))?;
        Ok(log.end()?)
    }

    pub fn open(folder: &Path) -> Result<Self, MapError> {
        let mut reader = RecordReader::<Keyframe>::open_file(&folder.join(KEYFRAMES))?;
        let keyframes: Result<Vec<_>, _> = (0..reader.len()).map(|k| reader.read(k)).collect();
        let index = PlaceIndex::load(&folder.join(PLACES))?;
        let (is_complete, keyframes) = (reader.has_ended(), keyframes?);
        if !is_complete || index.len() != keyframes.len() {
            let end = if is_complete { "" } else { " and no end" };
            return Err(MapError::Unlike(format!(
                "{KEYFRAMES} has {} keyframes{end}, and {PLACES} {}: draw the map again with gyre map",
                keyframes.len(),
                index.len()
            )));
        }
        Self::with_index(keyframes, index)
    }

    fn with_index(keyframes: Vec<Keyframe>, index: PlaceIndex) -> Result<Self, MapError> {
        if keyframes.is_empty() {
            return Err(MapError::Empty);
        }
        Ok(Self {
            path_m: keyframes.iter().map(|keyframe| keyframe.path_m).collect(),
            index,
            keyframes,
        })
    }

    pub fn keyframes(&self) -> &[Keyframe] {
        &self.keyframes
    }

    pub fn pose(&self, keyframe: usize) -> Pose {
        self.keyframes[keyframe].pose.motion
    }

    pub fn nearest(&self, place: Point2<f64>) -> (usize, f64) {
        let distance_m =
            |keyframe: &Keyframe| (keyframe.pose.motion.translation.vector - place.coords).norm();
        let all = self.keyframes.iter().map(distance_m).enumerate();
        all.min_by(|a, b| a.1.total_cmp(&b.1))
            .unwrap_or((0, f64::INFINITY))
    }

    /// Returns the keyframes by how much their submaps look like a descriptor, each at its best
    /// `angles` angles.
    pub(crate) fn similar(&mut self, descriptor: &Descriptor, angles: usize) -> &[Candidate] {
        self.index.rank_all(descriptor, angles)
    }

    pub(crate) fn draw(&self, middle: usize, submap: &mut Submap) {
        let keyframe = &self.keyframes[middle];
        submap.start(&keyframe.points, &keyframe.twist);
        let reach_m = SUBMAP_REACH_M;
        for k in neighbours(&self.path_m, middle, reach_m).filter(|k| *k != middle) {
            let other = &self.keyframes[k];
            let pose = self.pose(middle).inv_mul(&other.pose.motion);
            submap.add(&other.points, &other.twist, &pose);
        }
    }

    pub(crate) fn new_submap(&self) -> Submap {
        Submap::with_capacity(self.largest() * (2 * MAX_NEIGHBOURS + 1))
    }

    pub(crate) fn largest(&self) -> usize {
        let points = self.keyframes.iter().map(|keyframe| keyframe.points.len());
        points.max().unwrap_or(0)
    }
}
