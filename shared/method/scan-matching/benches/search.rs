//! Times of the search on this machine, one thread, medians: the transforms that no search of this
//! form avoids, and each step. `gyre-lab tables` compares the whole with the papers and a baseline.
#![allow(clippy::unwrap_used)]

#[path = "../tests/common/mod.rs"]
mod common;

use std::hint::black_box;
use std::time::Instant;

use common::{Motion, pair};
use gyre_radar::fourier::{Complex32, FftDirection};
use gyre_scan_matching::{
    ExhaustiveConfig, ExhaustiveSearch, Overlap, RotationConfig, RotationSearch, TranslationConfig,
    TranslationSearch, fast_size,
};

const SIZES: [usize; 3] = [127, 255, 511];
const REACH_M: f64 = 12.0;
const PASSES: usize = 101;
const BURN_IN: usize = 10;

fn main() {
    floor();
    steps();
    candidates();
}

/// Median of many passes, ms.
fn median_ms(mut work: impl FnMut()) -> f64 {
    (0..BURN_IN).for_each(|_| work());
    let mut times: Vec<f64> = (0..PASSES)
        .map(|_| {
            let start = Instant::now();
            work();
            start.elapsed().as_secs_f64() * 1e3
        })
        .collect();
    times.sort_by(f64::total_cmp);
    times[PASSES / 2]
}

/// `count` complex transforms of `size`.
fn complex_ms(size: usize, count: usize) -> f64 {
    let fft = gyre_radar::fourier::complex(size, FftDirection::Forward);
    let data: Vec<Complex32> = (0..size).map(|k| Complex32::new(k as f32, 1.0)).collect();
    let mut work = data.clone();
    let mut scratch = vec![Complex32::default(); fft.get_inplace_scratch_len()];
    median_ms(|| {
        for _ in 0..count {
            work.copy_from_slice(&data);
            fft.process_with_scratch(black_box(&mut work), &mut scratch);
        }
    })
}

/// `count` real transforms of `size`.
fn real_ms(size: usize, count: usize) -> f64 {
    let fft = gyre_radar::fourier::real(size);
    let (mut work, mut out, mut scratch) = (
        fft.make_input_vec(),
        fft.make_output_vec(),
        fft.make_scratch_vec(),
    );
    median_ms(|| {
        for _ in 0..count {
            work.fill(1.0);
            fft.process_with_scratch(black_box(&mut work), &mut out, &mut scratch)
                .unwrap();
        }
    })
}

/// Prints the times of the one-dimensional transforms alone, without a transpose, a copy or a
/// lookup between them.
fn floor() {
    println!(
        "floor: transforms alone, ms\n{:>5} {:>11} {:>9} {:>13} {:>9} {:>9}",
        "n", "2-D, scan", "rings", "2-D, pair", "inverse", "sum"
    );
    let config = RotationConfig::default();
    for n in SIZES {
        let (size, cells) = (fast_size(n), cell_m(n));
        let radii = ((config.band_high - config.band_low) * n as f64).ceil() as usize;
        let reach = (REACH_M / cells) as usize + 3;
        let padded = fast_size(n + reach);
        let scan =
            real_ms(size, n) + complex_ms(size, (config.band_high * size as f64) as usize + 2);
        let rings = real_ms(config.angles, radii);
        let both = complex_ms(padded, n + padded);
        let back = complex_ms(padded, padded / 2 + 1) + real_ms(padded, 2 * reach + 1);
        println!(
            "{n:5} {scan:11.3} {rings:9.3} {both:13.3} {back:9.3} {:9.3}",
            scan + rings + both + back
        );
    }
}

/// The cell size for the same area at every n: 102 m a side, 0.4 m at 255 as in the paper.
fn cell_m(n: usize) -> f64 {
    0.4 * 255.0 / n as f64
}

/// Prints the times of each step.
fn steps() {
    println!("\nsearch: reach 20 deg and {REACH_M} m, earlier spectrum kept, ms");
    println!(
        "{:>5} {:>7} {:>9} {:>9} {:>12} {:>9}",
        "n", "cell", "spectrum", "angle", "translation", "total"
    );
    for n in SIZES {
        let (cell, motion) = (cell_m(n), Motion::degrees(2.5, 0.1, 3.0));
        let (earlier, later) = pair(n, cell, motion, 1);
        let mut rotation = RotationSearch::new(n, &RotationConfig::default()).unwrap();
        let config = TranslationConfig {
            reach_m: REACH_M,
            ..TranslationConfig::default()
        };
        let mut translation = TranslationSearch::new(n, cell, &config).unwrap();
        let (mut f, mut g) = (rotation.new_spectrum(), rotation.new_spectrum());
        rotation.spectrum(earlier.view(), &mut g).unwrap();
        let spectrum = median_ms(|| rotation.spectrum(black_box(later.view()), &mut f).unwrap());
        let angle = median_ms(|| _ = black_box(rotation.search(&f, &g, None).unwrap()));
        let estimate = rotation.search(&f, &g, None).unwrap();
        let shift = median_ms(|| {
            _ = black_box(
                translation
                    .search(later.view(), earlier.view(), &estimate)
                    .unwrap(),
            )
        });
        let total = median_ms(|| {
            rotation.spectrum(black_box(later.view()), &mut f).unwrap();
            let estimate = rotation.search(&f, &g, None).unwrap();
            black_box(
                translation
                    .search(later.view(), earlier.view(), &estimate)
                    .unwrap(),
            );
        });
        println!("{n:5} {cell:7.3} {spectrum:9.3} {angle:9.3} {shift:12.3} {total:9.3}");
    }
}

/// Prints the times of the exhaustive search.
fn candidates() {
    println!("\nexhaustive search: reach 15 deg in steps of 1 deg and {REACH_M} m, ms");
    println!(
        "{:>5} {:>7} {:>9} {:>9} {:>13} {:>12}",
        "n", "angles", "total", "an angle", "at transforms", "unnormalised"
    );
    for n in SIZES {
        let (cell, motion) = (cell_m(n), Motion::degrees(2.5, 0.1, 3.0));
        let (earlier, later) = pair(n, cell, motion, 1);
        let time = |config: &ExhaustiveConfig| {
            let mut search = ExhaustiveSearch::new(n, cell, config).unwrap();
            let total = median_ms(|| {
                _ = black_box(
                    search
                        .search(black_box(later.view()), earlier.view())
                        .unwrap(),
                )
            });
            (total, total / search.candidates() as f64)
        };
        let default = ExhaustiveConfig {
            reach_m: REACH_M,
            ..ExhaustiveConfig::default()
        };
        let (total, one) = time(&default);
        let (_, bare) = time(&ExhaustiveConfig {
            overlap: Overlap::None,
            ..default.clone()
        });
        // Two angles share a transform: the rows of one, all columns forward and back, the rows
        // within reach.
        let reach = (REACH_M / cell) as usize + 3;
        let size = fast_size(n + reach);
        let floor = complex_ms(size, n + 2 * size + 2 * reach + 1) / 2.0;
        println!(
            "{n:5} {:7} {total:9.2} {one:9.3} {floor:13.3} {bare:12.3}",
            default.candidates()
        );
    }
}
