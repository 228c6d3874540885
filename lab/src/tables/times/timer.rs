//! A row at one size: its passes, and how long they took.

use std::{hint::black_box, time::Instant};

use gyre::{Failure, configuration::Configuration};
use gyre_masking::{MaskKind, network::Network};
use gyre_odometry::{Odometry, SearchKind};
use gyre_radar::OwnedScan;
use ndarray::Array3;

use super::Median;
use crate::{models::Model, sequence::Sequence, tables::rows::Row};

/// Untimed passes before each half.
const BURN_IN: usize = 5;

/// Times a row after rasterising: the network's mask, the search, the refinement.
pub struct Timer {
    /// The network that masks.
    pub model: Option<Model>,
    cell_m: f32,
    angles: Option<usize>,
    odometry: Odometry,
    /// A network and rasters to mask: scans x n x n.
    network: Option<(Network, Array3<f32>)>,
    searches: bool,
    scans: Vec<OwnedScan>,
    next: usize,
    halves_ms: [Vec<f64>; 2],
}

impl Timer {
    /// The same area at every size: that of the row's own configuration, or that of its network.
    pub fn new(
        sequence: &Sequence,
        row: &Row,
        changes: &[String],
        model: Option<Model>,
        n: usize,
        scans: &[OwnedScan],
    ) -> Result<Self, Failure> {
        let mut configuration = sequence.configuration(changes)?;
        let raster = &mut configuration.odometry.raster;
        let scaled = raster.cell_m * raster.n as f32 / n as f32;
        (raster.n, raster.cell_m) = (n, model.as_ref().map_or(scaled, |model| model.cell_m));
        configuration.odometry.masking.threads = 1;
        let timer = Self::of(&configuration, !row.mask_alone, scans);
        let timer =
            timer.map_err(|reason| format!("{} at {n} cells a side: {reason}", row.name))?;
        Ok(Self { model, ..timer })
    }

    fn of(
        configuration: &Configuration,
        searches: bool,
        scans: &[OwnedScan],
    ) -> Result<Self, Failure> {
        let (raster, masking) = (
            &configuration.odometry.raster,
            &configuration.odometry.masking,
        );
        let network = match masking.kind {
            MaskKind::Learned => {
                let network = Network::load(masking, raster)?;
                let rasters = Array3::zeros((network.scans(), raster.n, raster.n));
                Some((network, rasters))
            }
            _ => None,
        };
        let exhaustive =
            configuration.odometry.search.kind == SearchKind::Exhaustive && network.is_none();
        Ok(Self {
            model: None,
            cell_m: raster.cell_m,
            angles: exhaustive.then(|| configuration.odometry.exhaustive.candidates()),
            odometry: Odometry::new(&configuration.odometry)?,
            network,
            searches,
            scans: scans.to_vec(),
            next: 0,
            halves_ms: [Vec::new(), Vec::new()],
        })
    }

    /// Times `passes` passes: those of the first half, then those of the second.
    pub fn half(&mut self, passes: usize) -> Result<(), Failure> {
        for _ in 0..BURN_IN {
            self.pass()?;
        }
        let times: Result<Vec<f64>, Failure> = (0..passes).map(|_| self.pass()).collect();
        let half = usize::from(!self.halves_ms[0].is_empty());
        self.halves_ms[half] = times?;
        Ok(())
    }

    /// Masks, searches and refines the next pair, as far as the row does; the time it took, ms.
    fn pass(&mut self) -> Result<f64, Failure> {
        if self.next == self.scans.len() {
            // Nobody drove from the last scan to the first.
            self.next = 0;
            self.odometry.restart();
        }
        if self.next == 0 {
            self.odometry.mask(&self.scans[0].view(), None)?;
            let start = self.odometry.search()?;
            self.odometry.integrate(start, None);
            self.next = 1;
        }
        self.odometry.mask(&self.scans[self.next].view(), None)?;
        if let Some((_, rasters)) = &mut self.network {
            rasters.assign(&self.odometry.masked_mut());
        }
        let start = Instant::now();
        if let Some((network, rasters)) = &mut self.network {
            black_box(network.run(rasters.view())?);
        }
        let found = match self.searches {
            true => black_box(self.odometry.search()?),
            false => None,
        };
        let refined = found.as_ref().and_then(|found| self.odometry.refine(found));
        let time_ms = start.elapsed().as_secs_f64() * 1e3;
        self.odometry.integrate(found, black_box(refined));
        self.next += 1;
        Ok(time_ms)
    }

    /// The medians of all passes and of each half.
    pub fn median(self) -> Median {
        let median = |times: Vec<f64>| gyre_radar::median(times).unwrap_or(0.0);
        let halves_ms = self.halves_ms.clone().map(median);
        Median {
            cell_m: self.cell_m,
            angles: self.angles,
            ms: median(self.halves_ms.concat()),
            halves_ms,
        }
    }
}
