//! Non-maximum suppression across azimuths.

use super::range_cells::RangeCells;
use gyre_geometry::scan::PolarScan;
use std::f32::consts::{PI, TAU};

const BLOCK: usize = 16;

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Peak {
    pub azimuth: u16,
    pub cell: u32,
    /// In the units of [`RangeCells`].
    pub power: i16,
}

#[derive(Debug)]
pub(super) struct Beam {
    half_width_rad: f32,
    row: Vec<i16>,
    found: Vec<Peak>,
}

impl Beam {
    pub fn new(half_width_rad: f32) -> Self {
        Self {
            half_width_rad,
            row: Vec::new(),
            found: Vec::new(),
        }
    }

    /// Returns the cells of all azimuths, in order, that have power and are not exceeded within the
    /// beam.
    pub fn peaks(&mut self, scan: &PolarScan<'_>, cells: &RangeCells) -> &[Peak] {
        let azimuths = scan.geometry.azimuths;
        self.found.clear();
        // The upper bound, so that no later scan of this size allocates. Untouched memory is not
        // committed.
        self.found.reserve(azimuths * cells.layout.cells);
        for azimuth in 0..azimuths {
            let Some(powers) = cells.powers(azimuth) else {
                continue;
            };
            self.row.clear();
            self.row.extend_from_slice(powers);
            for neighbour in neighbours(scan, azimuth, self.half_width_rad) {
                if let Some(powers) = cells.powers(neighbour) {
                    suppress(&mut self.row, powers);
                }
            }
            collect(&self.row, azimuth as u16, &mut self.found);
        }
        &self.found
    }
}

/// Returns the other azimuths within a half width on either side, also across the end of the sweep,
/// each once. Half of the mean spacing is added, since antennas do not turn quite uniformly.
fn neighbours(
    scan: &PolarScan<'_>,
    azimuth: usize,
    half_width_rad: f32,
) -> impl Iterator<Item = usize> {
    let azimuths = scan.geometry.azimuths;
    let max_rad = half_width_rad + 0.5 * TAU / azimuths as f32;
    let (centre_rad, bearings) = (scan.azimuth_rad[azimuth], scan.azimuth_rad);
    let within = move |&other: &usize| {
        let turn = bearings[other] - centre_rad;
        ((turn + PI).rem_euclid(TAU) - PI).abs() <= max_rad
    };
    let later = (1..=azimuths / 2)
        .map(move |step| (azimuth + step) % azimuths)
        .take_while(within);
    let earlier = (1..=(azimuths - 1) / 2)
        .map(move |step| (azimuth + azimuths - step) % azimuths)
        .take_while(within);
    later.chain(earlier)
}

fn suppress(row: &mut [i16], neighbour: &[i16]) {
    for (power, &other) in row.iter_mut().zip(neighbour) {
        *power = if other > *power { 0 } else { *power };
    }
}

fn collect(row: &[i16], azimuth: u16, found: &mut Vec<Peak>) {
    for (block, powers) in row.chunks(BLOCK).enumerate() {
        if powers.iter().fold(0, |any, power| any | power) == 0 {
            continue;
        }
        for (k, &power) in powers.iter().enumerate().filter(|(_, power)| **power > 0) {
            found.push(Peak {
                azimuth,
                cell: (block * BLOCK + k) as u32,
                power,
            });
        }
    }
}
