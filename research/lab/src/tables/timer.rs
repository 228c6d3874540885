//! A row of Table IIIa at one size: its passes, and how long they took.

use std::{hint::black_box, time::Instant};

use gyre_configuration::{Configuration, terminal::Failure};
use gyre_masking::{MaskKind, network::Network};
use gyre_matching::{odometry::Odometry, JointMatch, Refined};
use gyre_geometry::OwnedScan;
use ndarray::Array3;

use crate::models::Model;

/// Passes that are not counted before those that are.
const BURN_IN: usize = 5;

/// Times a row after rasterising: the network's mask, the search, the refinement.
pub struct Timer {
    /// The network that masks.
    pub model: Option<Model>,
    /// Metres a cell.
    pub cell_m: f32,
    odometry: Odometry,
    /// A network and rasters to mask: scans x n x n.
    network: Option<(Network, Array3<f32>)>,
    searches: bool,
    scans: Vec<OwnedScan>,
    next: usize,
    times_ms: Vec<f64>,
}

impl Timer {
    /// Prepares a row with rasters of `n` cells a side. They cover the same area at every size:
    /// that of the row's own configuration, or that of its network.
    pub fn new(
        mut configuration: Configuration,
        model: Option<Model>,
        searches: bool,
        n: usize,
        scans: &[OwnedScan],
    ) -> Result<Self, Failure> {
        let config = &mut configuration.odometry;
        let scaled = config.raster.cell_m * config.raster.n as f32 / n as f32;
        config.raster.cell_m = model.as_ref().map_or(scaled, |model| model.cell_m);
        config.raster.n = n;
        config.masking.threads = 1;
        let network = match config.masking.kind {
            MaskKind::Learned => {
                let network = Network::load(&config.masking, &config.raster)?;
                let rasters = Array3::zeros((network.scans(), n, n));
                Some((network, rasters))
            }
            _ => None,
        };
        Ok(Self {
            model,
            cell_m: config.raster.cell_m,
            odometry: Odometry::new(config)?,
            network,
            searches,
            scans: scans.to_vec(),
            next: 0,
            times_ms: Vec::new(),
        })
    }

    /// Times `passes` passes.
    pub fn time(&mut self, passes: usize) -> Result<(), Failure> {
        for pass in 0..BURN_IN + passes {
            let time_ms = self.pass()?;
            self.times_ms.extend((pass >= BURN_IN).then_some(time_ms));
        }
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
            self.integrate(start, None);
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
        self.integrate(found, black_box(refined));
        self.next += 1;
        Ok(time_ms)
    }

    fn integrate(&mut self, searched: Option<JointMatch>, refined: Option<Refined>) {
        let registered = self.odometry.integrate(searched, refined);
        self.odometry.advance(&registered);
    }

    /// Returns the median of all passes, ms; NaN without any.
    pub fn median_ms(&self) -> f64 {
        gyre_radar::median(self.times_ms.iter().copied()).unwrap_or(f64::NAN)
    }
}
