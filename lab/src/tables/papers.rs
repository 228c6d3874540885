//! What the papers print, to stand beside what this machine gives.
//!
//! Checchin et al. (2010) print no such table.

/// Where the figures are from.
pub const SOURCE: &str =
    "Weston, Gadd, De Martini, Newman, Posner: Fast-MbyM, ICRA 2022, Table III";

/// The rasters' sides, cells.
const SIZES: [usize; 3] = [127, 255, 511];

/// One row of the papers' tables: a figure for each of the three sizes. `None`: not given.
#[derive(Debug)]
pub struct Figures {
    /// The row's name there.
    pub row: &'static str,
    /// Table IIIa, a laptop: Intel Core i7 at 2.9 GHz, Hz.
    laptop_hz: [Option<f64>; 3],
    /// Table IIIa, an NVIDIA Jetson Nano with its GPU, Hz.
    jetson_hz: [Option<f64>; 3],
    /// Table IIIb, Oxford Radar RobotCar: KITTI translation error, %.
    translation_percent: [Option<f64>; 3],
    /// Table IIIb: KITTI rotation error, degrees per km.
    rotation_deg_per_km: [Option<f64>; 3],
}

const NONE: [Option<f64>; 3] = [None; 3];

const fn all(figures: [f64; 3]) -> [Option<f64>; 3] {
    let [a, b, c] = figures;
    [Some(a), Some(b), Some(c)]
}

const fn but_the_last(a: f64, b: f64) -> [Option<f64>; 3] {
    [Some(a), Some(b), None]
}

/// Table III. Its second `mbym` is their own training of it, the first is quoted from Barnes et al. (2019).
pub static FIGURES: [Figures; 6] = [
    Figures {
        row: "mask",
        laptop_hz: all([96.2, 33.4, 7.6]),
        jetson_hz: all([24.7, 8.7, 2.4]),
        translation_percent: NONE,
        rotation_deg_per_km: NONE,
    },
    Figures {
        row: "raw",
        laptop_hz: all([14.3, 3.7, 0.8]),
        jetson_hz: but_the_last(6.6, 2.1),
        translation_percent: all([9.55, 6.39, 5.13]),
        rotation_deg_per_km: all([30.93, 20.87, 17.39]),
    },
    Figures {
        row: "f-raw",
        laptop_hz: all([83.2, 58.2, 21.0]),
        jetson_hz: all([28.3, 22.3, 9.4]),
        translation_percent: all([9.58, 8.46, 7.95]),
        rotation_deg_per_km: all([29.60, 27.75, 26.86]),
    },
    Figures {
        row: "mbym (2019)",
        laptop_hz: NONE,
        jetson_hz: NONE,
        translation_percent: all([2.70, 1.80, 1.16]),
        rotation_deg_per_km: all([7.6, 4.7, 3.0]),
    },
    Figures {
        row: "mbym",
        laptop_hz: all([12.2, 3.4, 0.7]),
        jetson_hz: but_the_last(3.7, 1.4),
        translation_percent: but_the_last(2.15, 1.36),
        rotation_deg_per_km: but_the_last(6.46, 3.98),
    },
    Figures {
        row: "f-mbym",
        laptop_hz: all([45.4, 20.6, 5.6]),
        jetson_hz: all([15.7, 6.6, 1.9]),
        translation_percent: all([2.77, 2.01, 2.00]),
        rotation_deg_per_km: all([8.74, 6.3, 6.3]),
    },
];

impl Figures {
    /// Whether the row stands in Table IIIa.
    pub fn has_times(&self) -> bool {
        self.laptop_hz != NONE
    }

    /// Whether the row stands in Table IIIb.
    pub fn has_drift(&self) -> bool {
        self.translation_percent != NONE
    }

    /// Rates (Hz) on the laptop and on the Jetson for rasters of `n` cells a side.
    pub fn hz(&self, n: usize) -> [Option<f64>; 2] {
        [at(&self.laptop_hz, n), at(&self.jetson_hz, n)]
    }

    /// KITTI errors for rasters of `n` cells a side: %, and degrees per km.
    pub fn drift(&self, n: usize) -> [Option<f64>; 2] {
        [
            at(&self.translation_percent, n),
            at(&self.rotation_deg_per_km, n),
        ]
    }
}

fn at(figures: &[Option<f64>; 3], n: usize) -> Option<f64> {
    SIZES
        .iter()
        .position(|&size| size == n)
        .and_then(|k| figures[k])
}
