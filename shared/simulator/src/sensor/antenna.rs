/// Two-way side lobes: dB below the main lobe by the angle in half-power widths.
/// The envelope measured on Oxford's, RADIATE's and Boreas-RT's scans: medians of the azimuths
/// beside isolated strong echoes.
const SIDE_LOBES: [(f64, f64); 8] = [
    (1.0, -11.5),
    (1.64, -20.5),
    (2.45, -29.5),
    (3.27, -37.5),
    (4.1, -42.5),
    (4.9, -46.0),
    (6.5, -52.0),
    (8.0, -57.0),
];
/// Entries of the table for each half-power width.
const STEPS: f64 = 64.0;
/// Half-power widths on each side that the table covers.
const REACH: f64 = 8.0;

/// Two-way amplitude gain by the angle from the beam's axis.
#[derive(Clone, Debug)]
pub struct Antenna {
    /// Entries a radian.
    scale: f64,
    amplitudes: Vec<f32>,
}

impl Antenna {
    /// An antenna whose two-way power falls to one half at `width_rad / 2` from its axis.
    pub fn new(width_rad: f64) -> Self {
        let power = |widths: f64| {
            // One half at half a width.
            let main_db = -12.04 * widths * widths;
            let db = main_db.max(interpolate(&SIDE_LOBES, widths));
            10f64.powf(db / 10.0)
        };
        let entries = (REACH * STEPS) as usize + 1;
        let amplitudes = (0..entries)
            .map(|i| power(i as f64 / STEPS).sqrt() as f32)
            .collect();
        Self {
            scale: STEPS / width_rad,
            amplitudes,
        }
    }

    /// Amplitude gain `off_rad` from the axis; 0 far from it.
    pub fn gain(&self, off_rad: f64) -> f64 {
        let at = (off_rad.abs() * self.scale) as usize;
        self.amplitudes.get(at).copied().map_or(0.0, f64::from)
    }

    /// The angle beyond which the amplitude gain stays below `min_gain`, radians.
    pub fn reach_rad(&self, min_gain: f64) -> f64 {
        let beyond = self
            .amplitudes
            .partition_point(|&gain| f64::from(gain) >= min_gain);
        beyond as f64 / self.scale
    }
}

/// The value of a table at a place: linear between its entries, constant before the first and after
/// the last.
pub(super) fn interpolate(table: &[(f64, f64)], at: f64) -> f64 {
    let next = table.partition_point(|entry| entry.0 <= at);
    match (next, table.get(next)) {
        (_, None) => table[table.len() - 1].1,
        (0, Some(first)) => first.1,
        (_, Some(after)) => {
            let before = table[next - 1];
            before.1 + (after.1 - before.1) * (at - before.0) / (after.0 - before.0)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn power_falls_monotonically_and_to_one_half_at_half_the_width() {
        let antenna = Antenna::new(0.03);
        assert_eq!(antenna.gain(0.0), 1.0);
        assert!((antenna.gain(-0.015).powi(2) - 0.5).abs() < 0.01);
        assert!(antenna.amplitudes.windows(2).all(|pair| pair[1] <= pair[0]));
        assert_eq!(antenna.gain(3.0), 0.0);
    }

    #[test]
    fn gain_is_below_the_minimum_beyond_the_reach() {
        let antenna = Antenna::new(0.03);
        for min_gain in [0.5, 0.05, 0.005, 0.0001] {
            let reach = antenna.reach_rad(min_gain);
            assert!(antenna.gain(reach - 1e-3) >= min_gain || reach > 0.23);
            assert!(antenna.gain(reach + 1e-9) < min_gain);
        }
    }
}
