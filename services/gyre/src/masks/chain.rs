//! Scans masked one after the other, each compensated by a motion that the search found in those before it: what the processes of a
//! run do, in one.

use std::collections::VecDeque;

use gyre_geometry::Twist;
use gyre_masking::{Masker, Sweep};
use gyre_messages::{MaskedHeader, Pair, SearchedMotion};
use gyre_radar::{Dataset, OwnedScan};

use super::exposure::{Exposer, Exposure};
use crate::{
    Failure,
    configuration::Configuration,
    print,
    search::{Search, search},
};

/// Where scans are far apart, so many before each of them are worked through. The first motions are found in rasters whose
/// distortion is not undone, as at a run's start; a few scans later they are what a run finds, but for its noise.
const RUN_UP: usize = 8;

/// See the module.
pub struct Chain {
    dataset: Box<dyn Dataset>,
    /// The scan that comes next.
    next: usize,
    masker: Masker,
    search: Search,
    exposer: Exposer,
    /// Scans since the chain began.
    seq: u64,
    lag: usize,
    /// Those of the last `lag` scans.
    motions: VecDeque<Option<SearchedMotion>>,
    /// The last scan and the one before.
    links: [Link; 2],
    /// What masking makes of each.
    masked: [Vec<f32>; 2],
    /// Memory to read the next scan into.
    spare: OwnedScan,
}

/// A scan, and the motion that its sweep's distortion is undone with.
pub struct Link {
    pub number: usize,
    scan: OwnedScan,
    motion: Option<SearchedMotion>,
}

impl Link {
    pub fn sweep(&self) -> Sweep<'_> {
        Sweep {
            number: self.number as u64,
            scan: self.scan.view(),
            motion: self.motion,
        }
    }
}

impl Chain {
    /// Plans masks and search.
    ///
    /// # Errors
    /// A setting that is out of its bounds, a network that cannot be used.
    pub fn new(configuration: &Configuration, dataset: Box<dyn Dataset>) -> Result<Self, Failure> {
        let (raster, points, masking) = (
            &configuration.raster,
            &configuration.points,
            &configuration.masking,
        );
        let masker = Masker::new(raster, points, masking)?;
        let room = masker.rasters() * MaskedHeader::raster_values(raster.n * raster.n);
        let scan = OwnedScan::with_limits(dataset.limits());
        let link = || Link {
            number: 0,
            scan: scan.clone(),
            motion: None,
        };
        Ok(Self {
            next: configuration.played(dataset.len()).start,
            search: search(configuration, masker.rasters())?,
            exposer: Exposer::new(configuration)?,
            seq: 0,
            lag: masking.feedback_lag(),
            motions: VecDeque::with_capacity(masking.feedback_lag() + 1),
            links: [link(), link()],
            masked: [vec![0.0; room], vec![0.0; room]],
            spare: scan,
            masker,
            dataset,
        })
    }

    /// Goes on to the scan `number`, not before the last one, and shows what becomes of it; `None` if it cannot be read.
    pub fn expose(&mut self, number: usize) -> Result<Option<Exposure>, Failure> {
        let from = number.saturating_sub(self.lag + RUN_UP);
        if from > self.next {
            (self.next, self.seq) = (from, 0);
            self.motions.clear();
        }
        for before in self.next..number {
            self.step(before)?;
        }
        self.next = number + 1;
        let Some(twist) = self.step(number)? else {
            return Ok(None);
        };
        let [now, before] = &self.links;
        // Where the chain starts a scan is its own scan before.
        let before = if self.seq == 1 { now } else { before };
        let scans = &[now, before][..self.masker.rasters()];
        Ok(Some(self.exposer.expose(
            &mut self.masker,
            scans,
            &self.masked[0],
            twist,
        )?))
    }

    /// Masks a scan and finds its motion. `None`: it cannot be read, and the chain steps over it as a run does.
    fn step(&mut self, number: usize) -> Result<Option<Option<Twist>>, Failure> {
        match self.dataset.read(number, self.spare.slot()) {
            Ok(geometry) => self.spare.geometry = geometry,
            Err(error) => {
                print::note(format_args!("left out: {error}"));
                return Ok(None);
            }
        }
        self.links.swap(0, 1);
        self.masked.swap(0, 1);
        let [now, before] = &mut self.links;
        std::mem::swap(&mut now.scan, &mut self.spare);
        now.number = number;
        now.motion = if self.motions.len() == self.lag {
            self.motions.pop_front().flatten()
        } else {
            None
        };
        let earlier = (self.seq > 0).then(|| before.sweep());
        let failed = |error: &dyn std::error::Error| format!("scan {number}: {error}");
        let twist = self
            .masker
            .mask(&now.sweep(), earlier.as_ref(), &mut self.masked[0]);
        let twist = twist.map_err(|error| failed(&error))?;
        let pair = pair(
            &self.masked,
            self.masker.rasters(),
            self.exposer.cells(),
            self.seq == 0,
        );
        let motion = (self.search)(self.seq, pair)
            .map_err(|error| failed(&error))?
            .as_searched();
        let interval_ns = now
            .scan
            .geometry
            .stamp_ns
            .saturating_sub(before.scan.geometry.stamp_ns);
        if self.lag > 0 {
            self.motions
                .push_back((self.seq > 0).then_some(SearchedMotion {
                    interval_ns,
                    ..motion
                }));
        }
        self.seq += 1;
        Ok(Some(twist))
    }
}

/// The rasters to search: where the mask looks at two scans, both are its of this pair.
fn pair<'a>(
    [masked, masked_before]: &'a [Vec<f32>; 2],
    rasters: usize,
    cells: usize,
    begins: bool,
) -> Pair<'a> {
    let earlier = if rasters == 2 {
        &masked[masked.len() / 2..]
    } else {
        masked_before
    };
    Pair {
        later: &masked[..cells],
        earlier: (!begins).then_some(&earlier[..cells]),
    }
}
