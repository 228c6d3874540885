//! One grid of range for sensors of different resolution.

use gyre_radar::{OwnedScan, PolarScan, ScanError, ScanLimits, SweepGeometry};
use serde::Serialize;

/// Equal cells of range, from the first bin's near edge on: ranges as the sensor counts them, without any offset, so that what the
/// sensor itself puts into a scan (ringing, noise) falls into the same cells whatever offset a configuration names.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct RangeGrid {
    /// Metres a cell.
    pub resolution_m: f32,
    /// Cells.
    pub cells: usize,
}

impl RangeGrid {
    /// The grid that scans of all these kinds can be averaged to: the coarsest resolution over the shortest range. `None` where there
    /// is no scan, or one without bins.
    pub fn common(geometries: &[SweepGeometry]) -> Option<Self> {
        let resolution_m = geometries
            .iter()
            .map(|g| g.range_resolution_m)
            .reduce(f32::max)?;
        let range_m = |g: &SweepGeometry| g.bins as f64 * f64::from(g.range_resolution_m);
        let shortest_m = geometries.iter().map(range_m).reduce(f64::min)?;
        // A resolution as f32 must not cost the last cell.
        let cells = (shortest_m / f64::from(resolution_m) + 1e-4) as usize;
        (cells > 0).then_some(Self {
            resolution_m,
            cells,
        })
    }

    /// The cell at a range; `None` beyond the grid.
    pub fn cell_at(&self, range_m: f64) -> Option<usize> {
        let cell = range_m / f64::from(self.resolution_m);
        (cell >= 0.0 && cell < self.cells as f64).then_some(cell as usize)
    }

    /// Metres from the sensor to the last cell's far edge.
    pub fn range_m(&self) -> f64 {
        self.cells as f64 * f64::from(self.resolution_m)
    }
}

/// Brings scans onto a grid, in memory of its own.
#[derive(Debug)]
pub struct Resampler {
    grid: RangeGrid,
    scan: OwnedScan,
    /// Sum of a row's powers before each bin, and of all.
    sums: Vec<f64>,
}

impl Resampler {
    /// For scans of any size.
    pub fn new(grid: RangeGrid) -> Self {
        let empty = ScanLimits {
            bytes: 0,
            azimuths: 0,
        };
        Self {
            grid,
            scan: OwnedScan::with_limits(empty),
            sums: Vec::new(),
        }
    }

    /// Averages the powers over each cell, a bin that two cells share by its parts, and rounds to whole counts. Azimuths, times and
    /// flags stay as they are. Where the scan has no more bins there is nothing: power 0.
    ///
    /// # Errors
    /// A scan that contradicts itself.
    pub fn resample(&mut self, scan: &PolarScan<'_>) -> Result<(), ScanError> {
        scan.check()?;
        let azimuths = scan.geometry.azimuths;
        self.scan.geometry = SweepGeometry {
            bins: self.grid.cells,
            stride: self.grid.cells,
            first_byte: 0,
            range_resolution_m: self.grid.resolution_m,
            ..scan.geometry
        };
        self.scan.azimuth_rad.clear();
        self.scan
            .azimuth_rad
            .extend_from_slice(&scan.azimuth_rad[..azimuths]);
        self.scan.stamp_ns.clear();
        self.scan
            .stamp_ns
            .extend_from_slice(&scan.stamp_ns[..azimuths]);
        self.scan.flags.clear();
        self.scan.flags.extend_from_slice(&scan.flags[..azimuths]);
        self.scan.bytes.resize(azimuths * self.grid.cells, 0);
        let bins_a_cell =
            f64::from(self.grid.resolution_m) / f64::from(scan.geometry.range_resolution_m);
        for (azimuth, cells) in self
            .scan
            .bytes
            .chunks_exact_mut(self.grid.cells)
            .enumerate()
        {
            average(scan.row(azimuth), bins_a_cell, &mut self.sums, cells);
        }
        Ok(())
    }

    /// The scan that was resampled last.
    pub fn scan(&self) -> PolarScan<'_> {
        self.scan.view()
    }
}

/// Writes to `cells` the mean of `bins` over stretches of `bins_a_cell`.
fn average(bins: &[u8], bins_a_cell: f64, sums: &mut Vec<f64>, cells: &mut [u8]) {
    sums.clear();
    sums.push(0.0);
    let mut sum = 0.0;
    sums.extend(bins.iter().map(|power| {
        sum += f64::from(*power);
        sum
    }));
    let sum_before = |bin: f64| {
        let whole = bin as usize;
        match (sums.get(whole), bins.get(whole)) {
            (Some(sum), Some(power)) => sum + (bin - whole as f64) * f64::from(*power),
            _ => sums[bins.len()],
        }
    };
    let mut near = sum_before(0.0);
    for (cell, power) in cells.iter_mut().enumerate() {
        let far = sum_before((cell + 1) as f64 * bins_a_cell);
        *power = ((far - near) / bins_a_cell).round() as u8;
        near = far;
    }
}
