use super::{LostAzimuths, stale_rows};
use gyre_geometry::scan::PolarScan;

/// Writes the powers of a scan, azimuth x range bin: the powers of each measured row at its
/// azimuth, and between two rows an interpolation of both by their distance. `lost` has as many as
/// the scan has stale rows.
pub fn repair(scan: &PolarScan<'_>, lost: &LostAzimuths, into: &mut [u8]) {
    let (azimuths, bins) = (scan.geometry.azimuths, scan.geometry.bins);
    let measured = azimuths - stale_rows(scan);
    let at = |row: usize| match row < measured {
        true => lost.azimuth_of(row as f32),
        // The first row again, one turn on.
        false => azimuths as f32 + lost.azimuth_of(0.0),
    };
    let mut row = 0;
    // From the azimuth of the first row on, so that the turn closes between its last row and that.
    let first = at(0).ceil() as usize;
    for azimuth in first..first + azimuths {
        while at(row + 1) <= azimuth as f32 && row + 1 < measured {
            row += 1;
        }
        let share = ((azimuth as f32 - at(row)) / (at(row + 1) - at(row))).clamp(0.0, 1.0);
        let (before, after) = (scan.row(row), scan.row((row + 1) % measured));
        let powers = before.iter().zip(after);
        let to = &mut into[azimuth % azimuths * bins..][..bins];
        for (power, (before, after)) in to.iter_mut().zip(powers) {
            let (before, after) = (f32::from(*before), f32::from(*after));
            *power = (before + share * (after - before)).round() as u8;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gyre_geometry::scan::{OwnedScan, SweepGeometry, flag};

    const AZIMUTHS: usize = 12;
    const BINS: usize = 2;

    /// Returns the first bins of the repaired azimuths of a scan whose rows have these powers, with
    /// `stale` ones behind.
    fn repaired(rows: &[u8], stale: usize, lost: &[[u16; 2]]) -> Vec<u8> {
        let mut scan = OwnedScan::of(SweepGeometry {
            azimuths: AZIMUTHS,
            bins: BINS,
            stride: BINS,
            ..SweepGeometry::default()
        });
        scan.flags.fill(flag::MEASURED | flag::ASSUMED);
        scan.flags[AZIMUTHS - stale..].fill(flag::STALE | flag::ASSUMED);
        for (row, power) in rows.iter().enumerate() {
            scan.bytes[row * BINS..][..BINS].copy_from_slice(&[*power, 255 - *power]);
        }
        let mut into = vec![0; AZIMUTHS * BINS];
        let lost = LostAzimuths::between(lost.iter().copied());
        repair(&scan.view(), &lost, &mut into);
        assert!(into.chunks(BINS).all(|bins| bins[0] + bins[1] == 255));
        into.into_iter().step_by(BINS).collect()
    }

    #[test]
    fn rows_lie_at_their_azimuths_and_lost_ones_between_their_neighbours() {
        let rows = [0, 10, 20, 30, 60, 70, 80, 90, 100, 110, 7, 7];
        assert_eq!(repaired(&rows, 0, &[]), rows);
        let expected = [0, 10, 20, 30, 40, 50, 60, 70, 80, 90, 100, 110];
        assert_eq!(repaired(&rows, 2, &[[4, 4], [4, 4]]), expected);
    }

    #[test]
    fn the_first_and_the_last_azimuth_lie_between_the_ends_of_the_turn() {
        let rows = [20, 30, 40, 50, 60, 70, 80, 90, 100, 110, 120, 7];
        let first = [70, 20, 30, 40, 50, 60, 70, 80, 90, 100, 110, 120];
        assert_eq!(repaired(&rows, 1, &[[0, 0]]), first);
        let last = [20, 30, 40, 50, 60, 70, 80, 90, 100, 110, 120, 70];
        assert_eq!(repaired(&rows, 1, &[[11, 11]]), last);
    }

    #[test]
    fn rows_between_which_one_may_have_been_lost_are_stretched() {
        let rows = [0, 10, 20, 30, 40, 60, 80, 100, 110, 120, 130, 7];
        // Rows 5, 6 and 7 lie at 5.25, 6.5 and 7.75, and row 8 at 9.
        let expected = [0, 10, 20, 30, 40, 56, 72, 88, 102, 110, 120, 130];
        assert_eq!(repaired(&rows, 1, &[[5, 8]]), expected);
    }
}
