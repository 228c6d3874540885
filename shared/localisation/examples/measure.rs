//! Measures localisation in the map of one recording by another: `cargo run --release -p gyre-localisation --example measure -- CONFIG
//! MAP FIRST..END DRIVE FIRST..END [OUT.csv]`.
//!
//! Scans FIRST..END of the recording MAP are the map, with the poses of its ground truth. Each scan of DRIVE is first looked up alone, then
//! again with half of it blank; then all are tracked. Odometry is that of the configuration. Both ground truths have to be in one frame.

use std::error::Error;
use std::fmt::Write as _;
use std::path::Path;

use gyre_estimation::places::KeyframeSelector;
use gyre_geometry::{Pose, SparsePoint, Twist, UncertainMotion};
use gyre_localisation::{Fix, Localiser, LocaliserOptions, Map, Observation, Status};
use gyre_masking::Masker;
use gyre_odometry::{Odometry, OdometryConfig};
use gyre_radar::{DatasetOptions, OwnedScan, find_ground_truth, read_trajectory};
use gyre_slam::Keyframe;

/// Poses belong to a scan if they are this near in time.
const SAME_TIME_NS: u64 = 50_000_000;
/// A fix is right within these.
const RIGHT: (f64, f64) = (2.0, 5.0);

struct Scan {
    stamp_ns: i64,
    points: Vec<SparsePoint>,
    twist: Twist,
    motion: UncertainMotion,
    pose: UncertainMotion,
    truth: Option<Pose>,
}

#[derive(serde::Deserialize, Default)]
#[serde(default)]
struct Sections {
    dataset: DatasetOptions,
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [config, map, map_range, drive, range] = &arguments[..5] else {
        return Err("usage: measure CONFIG MAP FIRST..END DRIVE FIRST..END [OUT.csv]".into());
    };
    let text = std::fs::read_to_string(config)?;
    let odometry: OdometryConfig = toml::from_str(&text)?;
    let sections: Sections = toml::from_str(&text)?;
    let mapped = scans(Path::new(map), map_range, &odometry, &sections.dataset)?;
    let driven = scans(Path::new(drive), range, &odometry, &sections.dataset)?;
    let options = LocaliserOptions::default();
    let (map, truths) = map_of(&mapped, &options)?;
    println!(
        "map: {} keyframes of {} scans",
        map.keyframes().len(),
        mapped.len()
    );
    let mut localiser =
        Localiser::new(map, options, &odometry.refinement, odometry.points.capacity)?;
    let mut rows = String::from(
        "kind,scan,status,correlation,margin,error_x_m,error_y_m,error_deg,off_map_m,nees\n",
    );
    for (kind, blank) in [("single", 0.0), ("half blank", 0.5)] {
        for (k, scan) in driven.iter().enumerate() {
            let points: Vec<_> = scan
                .points
                .iter()
                .copied()
                .filter(|p| seen(p, blank))
                .collect();
            let fix = localiser.most_similar(&points, &scan.twist);
            row(
                &mut rows,
                kind,
                k,
                "",
                fix.as_ref(),
                scan,
                &localiser,
                &truths,
            )?;
        }
    }
    let mut counts = [0; 4];
    for (k, scan) in driven.iter().enumerate() {
        let found = localiser.locate(&Observation {
            stamp_ns: scan.stamp_ns,
            points: &scan.points,
            twist: scan.twist,
            motion: scan.motion,
        });
        counts[match found.status {
            Status::Lost => 0,
            Status::Found => 1,
            Status::Tracked => 2,
            Status::Predicted => 3,
        }] += 1;
        let status = format!("{:?}", found.status);
        row(
            &mut rows,
            "track",
            k,
            &status,
            found.fix.as_ref(),
            scan,
            &localiser,
            &truths,
        )?;
    }
    println!("lost, found, tracked, predicted: {counts:?}");
    if let Some(out) = arguments.get(5) {
        std::fs::write(out, rows)?;
    }
    Ok(())
}

/// Whether a point is left when a share of the turn, from the left to behind, is blank.
fn seen(point: &SparsePoint, blank: f64) -> bool {
    let [x, y, ..] = <[f32; 5]>::from(*point);
    let turn = f64::from(y.atan2(x)) / std::f64::consts::TAU;
    turn.rem_euclid(1.0) >= blank
}

#[allow(clippy::too_many_arguments)]
fn row(
    rows: &mut String,
    kind: &str,
    k: usize,
    status: &str,
    fix: Option<&Fix>,
    scan: &Scan,
    localiser: &Localiser,
    truths: &[Pose],
) -> Result<(), Box<dyn Error>> {
    let Some(truth) = scan.truth else {
        return Ok(());
    };
    let nearest = truths
        .iter()
        .map(|pose| (pose.translation.vector - truth.translation.vector).norm());
    let off_m = nearest.fold(f64::INFINITY, f64::min);
    write!(rows, "{kind},{k},{status},")?;
    let Some(fix) = fix else {
        writeln!(rows, "0,0,,,,{off_m:.2},")?;
        return Ok(());
    };
    let of_keyframe = localiser.map().poses()[fix.keyframe];
    let expected = of_keyframe * truths[fix.keyframe].inv_mul(&truth);
    let error = fix.pose.error(&expected);
    let nees = fix
        .pose
        .covariance
        .try_inverse()
        .map_or(f64::NAN, |inverse| {
            (error.transpose() * inverse * error).x / 3.0
        });
    // Along the vehicle's axes.
    let along = expected.rotation.inverse() * nalgebra::Vector2::new(error.x, error.y);
    writeln!(
        rows,
        "{:.4},{:.4},{:.4},{:.4},{:.4},{off_m:.2},{nees:.3}",
        fix.correlation,
        fix.margin,
        along.x,
        along.y,
        error.z.to_degrees()
    )?;
    let _ = RIGHT;
    Ok(())
}

/// The keyframes of some scans with their true poses, and again the true poses.
fn map_of(scans: &[Scan], options: &LocaliserOptions) -> Result<(Map, Vec<Pose>), Box<dyn Error>> {
    let mut selector = KeyframeSelector::new(&options.places);
    let (mut keyframes, mut truths) = (Vec::new(), Vec::new());
    for (seq, scan) in scans.iter().enumerate() {
        let (Some(truth), Some(path_m)) = (scan.truth, selector.next(&scan.pose.motion)) else {
            continue;
        };
        truths.push(truth);
        keyframes.push(Keyframe {
            seq: seq as u64,
            scan: seq as u64,
            stamp_ns: scan.stamp_ns,
            pose: scan.pose,
            motion: scan.motion,
            twist: scan.twist,
            path_m,
            points: scan.points.clone(),
        });
    }
    let poses = match std::env::var_os("ODOMETRY_POSES") {
        Some(_) => keyframes
            .iter()
            .map(|keyframe| keyframe.pose.motion)
            .collect(),
        None => truths.clone(),
    };
    Ok((
        Map::new(keyframes, poses, options.places.submap_reach_m)?,
        truths,
    ))
}

/// The scans of a recording by odometry.
fn scans(
    data: &Path,
    range: &str,
    config: &OdometryConfig,
    options: &DatasetOptions,
) -> Result<Vec<Scan>, Box<dyn Error>> {
    let (first, end) = range.split_once("..").ok_or("FIRST..END is needed")?;
    let mut dataset = gyre_radar::open(data, options)?;
    let end = end
        .parse::<usize>()
        .unwrap_or(usize::MAX)
        .min(dataset.len());
    let truth = find_ground_truth(data).ok_or("the recording has no ground truth")?;
    let truth = read_trajectory(&truth)?;
    let mut scan = OwnedScan::with_limits(dataset.limits());
    let mut odometry = Odometry::new(config)?;
    let mut masker = Masker::new(&config.raster, &config.points, &config.masking)?;
    let mut points = vec![SparsePoint::default(); config.points.capacity];
    let mut all = Vec::new();
    for index in first.parse()?..end {
        scan.geometry = dataset.read(index, scan.slot())?;
        let registered = odometry.register(&scan.view())?;
        let interval_s = registered.interval_ns as f64 * 1e-9;
        let twist = match registered.seq {
            0 => Twist::default(),
            _ => Twist::from_motion(&registered.motion.motion, interval_s),
        };
        let count = masker.points(&scan.view(), Some(twist), &mut points)?;
        all.push(Scan {
            stamp_ns: scan.geometry.stamp_ns,
            points: points[..count].to_vec(),
            twist,
            motion: registered.motion,
            pose: registered.pose,
            truth: truth.near(scan.geometry.stamp_ns, SAME_TIME_NS),
        });
    }
    Ok(all)
}
