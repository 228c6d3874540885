//! Time of a learned mask on one thread, and of each part of the masking stage around it: the
//! fastest tenth and the median over scans of RADIATE's recording in `GYRE_DATA`, with each backend
//! in turn.
//!
//! `cargo run --release --manifest-path research/Cargo.toml -p gyre-lab --example mask_bench`

use std::{error::Error, hint::black_box, path::Path, time::Instant};

use gyre_datasets::DatasetOptions;
use gyre_geometry::{SparsePoint, Twist, OwnedScan};
use gyre_masking::{Backend, MaskKind, Masker, MaskingConfig, Sweep, network::Network};
use gyre_radar::{PointsConfig, RasterConfig};
use ndarray::{Array2, Axis};

const SCANS: usize = 100;
const TWIST: Twist = Twist {
    vx_mps: 7.0,
    vy_mps: 0.0,
    yaw_rate_radps: 0.02,
};

fn main() -> Result<(), Box<dyn Error>> {
    let Some(data) = std::env::var_os("GYRE_DATA") else {
        println!("skipped: GYRE_DATA is not set");
        return Ok(());
    };
    let model = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../models/gyre-255.toml");
    let learned = |backend| MaskingConfig {
        kind: MaskKind::Learned,
        model: Some(model.clone()),
        backend,
        ..MaskingConfig::default()
    };
    let (raster, points) = (RasterConfig::default(), PointsConfig::default());
    let mut plain = Masker::new(&raster, &points, &MaskingConfig::default())?;
    let mut networks = Vec::new();
    let mut maskers = Vec::new();
    for backend in [Backend::OnnxRuntime, Backend::Rten] {
        networks.push(Network::load(&learned(backend), &raster)?);
        maskers.push(Masker::new(&raster, &points, &learned(backend))?);
    }
    let folder = Path::new(&data).join("radiate-2019-02-12");
    let mut dataset = gyre_datasets::open(&folder, &DatasetOptions::default())?;
    let mut scan = OwnedScan::with_limits(dataset.limits());
    let mut out = Array2::zeros((raster.n, raster.n));
    let mut sparse = vec![SparsePoint::default(); points.capacity];
    let mut times: [Vec<f64>; 8] = Default::default();
    let (mut most, mut sum) = (0.0_f32, 0.0_f64);
    for index in 0..SCANS.min(dataset.len()) {
        scan.geometry = dataset.read(index, scan.slot())?;
        let sweep = Sweep {
            number: index as u64,
            scan: scan.view(),
            twist: Some(TWIST),
        };
        times[0].push(ms(|| {
            plain.mask(&sweep, None, out.view_mut(), None).map(drop)
        })?);
        let points = |masker: &mut Masker, sparse: &mut [SparsePoint]| {
            let found = masker.points(&sweep.scan, Some(TWIST), sparse);
            found.map(|count| {
                black_box(count);
            })
        };
        times[1].push(ms(|| points(&mut plain, &mut sparse))?);
        let rasters = out.clone().insert_axis(Axis(0));
        for (which, network) in networks.iter_mut().enumerate() {
            times[2 + which].push(ms(|| network.run(rasters.view()).map(drop))?);
        }
        for (which, masker) in maskers.iter_mut().enumerate() {
            times[4 + which].push(ms(|| {
                masker.mask(&sweep, None, out.view_mut(), None).map(drop)
            })?);
            times[6 + which].push(ms(|| points(masker, &mut sparse))?);
        }
        let apart = &networks[0].masks() - &networks[1].masks();
        most = apart.iter().fold(most, |most, apart| most.max(apart.abs()));
        sum += f64::from(apart.mapv(f32::abs).mean().unwrap_or(0.0));
    }
    let names = [
        "raster",
        "points",
        "network, ONNX Runtime",
        "network, built in",
        "masked raster, ONNX Runtime",
        "masked raster, built in",
        "weighted points, ONNX Runtime",
        "weighted points, built in",
    ];
    for (name, times) in names.into_iter().zip(&mut times) {
        times.sort_by(f64::total_cmp);
        println!(
            "{name:>30} {:>7.3} {:>7.3} ms",
            times[times.len() / 10],
            times[times.len() / 2]
        );
    }
    println!(
        "masks apart: at most {most}, in the mean {}",
        sum / SCANS as f64
    );
    Ok(())
}

fn ms<E>(work: impl FnOnce() -> Result<(), E>) -> Result<f64, E> {
    let start = Instant::now();
    work()?;
    Ok(start.elapsed().as_secs_f64() * 1e3)
}
