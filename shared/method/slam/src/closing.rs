//! Closing of loops: which earlier keyframes saw the place of a keyframe, and the motion between
//! the two.

mod cache;

use cache::Cache;
use gyre_geometry::{Pose, UncertainMotion, covariance};
use gyre_matching::{RefinementConfig, SettingError, Submap};
use thiserror::Error;

use crate::{
    Keyframe, LoopCandidate, LoopOutcome, Query,
    estimation::{
        Constraint, EstimationError, GraphOptions, Outcome, PoseGraph,
        places::{
            Candidate, Describer, Descriptor, MAX_NEIGHBOURS, OrderError, PlaceIndex, Registrar,
            neighbours,
        },
    },
    place::Place,
};

/// Length of the path between a keyframe and the earlier ones that it is compared with, at least,
/// m.
pub(crate) const GAP_M: f64 = 100.0;
/// Number of candidates that are verified, and the distance along the path between two, at least,
/// m.
const CANDIDATES: usize = 3;
const APART_M: f64 = 15.0;

#[derive(Debug, Error)]
pub enum ClosingError<E> {
    #[error(transparent)]
    Source(E),
    #[error(transparent)]
    Order(#[from] OrderError),
    #[error(transparent)]
    Estimation(#[from] EstimationError),
}

/// Closes loops: a function of the sequence of keyframes, independent of their time of arrival. A
/// keyframe is described and queried once its submap is complete. Descriptors are kept in memory;
/// points are read again where a submap is drawn.
pub struct LoopCloser {
    submap_reach_m: f64,
    describer: Describer,
    registrar: Registrar,
    index: PlaceIndex,
    /// The odometry alone, against which loops are tested.
    odometry: PoseGraph,
    path_m: Vec<f64>,
    has_ended: bool,
    next_query: usize,
    cache: Cache,
    submaps: [Submap; 2],
}

impl LoopCloser {
    /// Plans the closing of loops between keyframes of at most `capacity` points, whose submaps are
    /// made of the keyframes up to `submap_reach_m` of the path to each side. `refinement` is the
    /// odometry's.
    pub fn new(
        submap_reach_m: f64,
        refinement: &RefinementConfig,
        capacity: usize,
    ) -> Result<Self, SettingError> {
        let submap = || Submap::with_capacity(capacity * (2 * MAX_NEIGHBOURS + 1));
        Ok(Self {
            describer: Describer::new(),
            registrar: Registrar::new(refinement, capacity)?,
            index: PlaceIndex::default(),
            odometry: PoseGraph::new(Pose::identity(), GraphOptions::default()),
            path_m: Vec::new(),
            has_ended: false,
            next_query: 0,
            cache: Cache::new(),
            submaps: [submap(), submap()],
            submap_reach_m,
        })
    }

    pub fn push(&mut self, keyframe: &Keyframe) -> Result<(), EstimationError> {
        self.extend(keyframe.path_m, &keyframe.motion)
    }

    /// Notes that no keyframe comes after the last one: the submaps of all are complete.
    pub fn finish(&mut self) {
        self.has_ended = true;
    }

    /// Takes the next keyframe from its place, as [`LoopCloser::describe`] has returned it. The
    /// keyframes themselves follow after the last of the places.
    pub fn restore_place<E>(&mut self, place: &Place) -> Result<(), ClosingError<E>> {
        self.extend(place.path_m, &place.motion)?;
        self.insert(place)
    }

    /// Continues with the query of keyframe `keyframe`: those before are known.
    pub fn restore_queries(&mut self, keyframe: usize) {
        self.next_query = keyframe;
    }

    pub fn keyframes(&self) -> usize {
        self.path_m.len()
    }

    /// Describes the next keyframe whose submap is complete; returns `None` without one. `read`
    /// reads a keyframe that was given to [`LoopCloser::push`].
    pub fn describe<E>(
        &mut self,
        read: &mut impl FnMut(usize) -> Result<Keyframe, E>,
    ) -> Result<Option<Place>, ClosingError<E>> {
        let next = self.index.len();
        if !self.is_complete(next) {
            return Ok(None);
        }
        self.draw(read, next, 0).map_err(ClosingError::Source)?;
        let mut descriptor = Descriptor::default();
        self.describer.describe(&self.submaps[0], &mut descriptor);
        let keyframe = self.cache.get(read, next).map_err(ClosingError::Source)?;
        let place = Place {
            path_m: keyframe.path_m,
            motion: keyframe.motion,
            descriptor,
        };
        self.insert(&place)?;
        Ok(Some(place))
    }

    /// Queries the next keyframe that is described, and verifies its candidates; returns `None`
    /// without one.
    pub fn close<E>(
        &mut self,
        read: &mut impl FnMut(usize) -> Result<Keyframe, E>,
    ) -> Result<Option<Query>, ClosingError<E>> {
        let keyframe = self.next_query;
        // A place that was restored is known before the keyframes behind it.
        if keyframe >= self.index.len() || !self.is_complete(keyframe) {
            return Ok(None);
        }
        let mut candidates = Vec::new();
        for candidate in self.candidates(keyframe) {
            if candidates.is_empty() {
                self.draw(read, keyframe, 0).map_err(ClosingError::Source)?;
            }
            self.draw(read, candidate.place, 1)
                .map_err(ClosingError::Source)?;
            candidates.push(self.verify(keyframe, &candidate)?);
        }
        self.next_query += 1;
        Ok(Some(Query {
            keyframe,
            candidates,
        }))
    }

    fn extend(&mut self, path_m: f64, motion: &UncertainMotion) -> Result<(), EstimationError> {
        if let Some(last) = self.path_m.len().checked_sub(1) {
            self.odometry.apply(&Constraint::odometry(last, *motion))?;
        }
        self.path_m.push(path_m);
        Ok(())
    }

    fn insert<E>(&mut self, place: &Place) -> Result<(), ClosingError<E>> {
        let id = self.index.len() as u64;
        self.index.insert(id, place.path_m, &place.descriptor)?;
        Ok(())
    }

    /// Returns whether all keyframes of a submap are known. Which they are does not change
    /// afterwards.
    fn is_complete(&self, middle: usize) -> bool {
        let known = self.path_m.len();
        let end = self.neighbours(middle).end;
        middle < known && (self.has_ended || end < known)
    }

    fn neighbours(&self, middle: usize) -> std::ops::Range<usize> {
        neighbours(&self.path_m, middle, self.submap_reach_m)
    }

    fn candidates(&mut self, keyframe: usize) -> Vec<Candidate> {
        let eligible = self.index.places_until(self.path_m[keyframe] - GAP_M);
        let Some(descriptor) = self.index.descriptor(keyframe).filter(|_| eligible > 0) else {
            return Vec::new();
        };
        let found = self.index.query(&descriptor, eligible, APART_M);
        found[..found.len().min(CANDIDATES)].to_vec()
    }

    fn draw<E>(
        &mut self,
        read: &mut impl FnMut(usize) -> Result<Keyframe, E>,
        middle: usize,
        submap: usize,
    ) -> Result<(), E> {
        let around = self.neighbours(middle);
        let submap = &mut self.submaps[submap];
        let keyframe = self.cache.get(read, middle)?;
        submap.start(&keyframe.points, &keyframe.twist);
        let pose = keyframe.pose.motion;
        for other in around.filter(|other| *other != middle) {
            let other = self.cache.get(read, other)?;
            let motion = pose.inv_mul(&other.pose.motion);
            submap.add(&other.points, &other.twist, &motion);
        }
        Ok(())
    }

    fn verify(
        &mut self,
        keyframe: usize,
        candidate: &Candidate,
    ) -> Result<LoopCandidate, EstimationError> {
        let [later, earlier] = &self.submaps;
        let mut found = self.registrar.verify(later, earlier, candidate);
        // As it is read from a file.
        found.motion.covariance = covariance::unpack(&covariance::pack(&found.motion.covariance));
        if found.outcome == LoopOutcome::Accepted {
            let closing = Constraint::closing(found.place, keyframe, found.motion);
            let verdict = self.odometry.test(&closing)?;
            found.chi_square = verdict.chi_square;
            if verdict.outcome == Outcome::Rejected {
                found.outcome = LoopOutcome::ContradictsOdometry;
            }
        }
        Ok(found)
    }
}
