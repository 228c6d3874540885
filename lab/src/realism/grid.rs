//! One grid of range for sensors of different resolution.

use gyre_radar::{OwnedScan, PolarScan, ScanError, SweepGeometry};

/// Equal cells of range, from the first bin's near edge on: ranges as the sensor counts them,
/// without any offset, so that what the sensor itself puts into a scan (ringing, noise) falls into
/// the same cells whatever offset a configuration names.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RangeGrid {
    /// Metres a cell.
    pub resolution_m: f32,
    /// Cells.
    pub cells: usize,
}

impl RangeGrid {
    /// The grid that scans of all these kinds can be averaged to: the coarsest resolution over the
    /// shortest range. `None` where there is no scan, or one without bins.
    pub fn common(geometries: &[SweepGeometry]) -> Option<Self> {
        let resolutions_m = geometries.iter().map(|g| g.range_resolution_m);
        let resolution_m = resolutions_m.reduce(f32::max)?;
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

/// Averages the powers of a scan over each cell of a grid, a bin that two cells share by its parts,
/// and rounds to whole counts. Azimuths, times and flags stay as they are. Where the scan has no
/// more bins there is nothing: power 0.
pub fn resample(scan: &PolarScan<'_>, grid: RangeGrid) -> Result<OwnedScan, ScanError> {
    scan.check()?;
    let azimuths = scan.geometry.azimuths;
    let bins_a_cell = f64::from(grid.resolution_m) / f64::from(scan.geometry.range_resolution_m);
    let mut bytes = vec![0; azimuths * grid.cells];
    for (azimuth, cells) in bytes.chunks_exact_mut(grid.cells).enumerate() {
        average(scan.row(azimuth), bins_a_cell, cells);
    }
    Ok(OwnedScan {
        geometry: SweepGeometry {
            bins: grid.cells,
            stride: grid.cells,
            first_byte: 0,
            range_resolution_m: grid.resolution_m,
            ..scan.geometry
        },
        bytes,
        azimuth_rad: scan.azimuth_rad[..azimuths].to_vec(),
        stamp_ns: scan.stamp_ns[..azimuths].to_vec(),
        flags: scan.flags[..azimuths].to_vec(),
    })
}

/// Writes to `cells` the mean of `bins` over stretches of `bins_a_cell`.
fn average(bins: &[u8], bins_a_cell: f64, cells: &mut [u8]) {
    let sum = bins.iter().scan(0.0, |sum, power| {
        *sum += f64::from(*power);
        Some(*sum)
    });
    let sums: Vec<f64> = std::iter::once(0.0).chain(sum).collect();
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
