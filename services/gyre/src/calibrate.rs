//! `gyre calibrate`: finds the constants of a radar from drives alone, and the clock, the axis and
//! the scale of the sensors beside it.

mod sensors;

use std::{
    path::{Path, PathBuf},
    time::Instant,
};

use clap::Args;
use gyre_calibration::{Configured, Drive, Found, Study, svg, toml};
use gyre_configuration::{
    Configuration, Played, describe_masks_in_process,
    terminal::{Failure, inputs::Inputs, print},
    with_stored_options,
};
use gyre_datasets::{DatasetOptions, ground_truth::read_trajectory};
use gyre_geometry::OwnedScan;
use gyre_matching::odometry::Odometry;
use gyre_radar::Trajectory;
use gyre_results::{Content, Out, judgement::judge, truth_of};
use gyre_storage as storage;
use gyre_tools::bar::Bar;
use sensors::{Section, Sensor};

#[derive(Debug, Args)]
pub struct CalibrateArguments {
    #[command(flatten)]
    pub inputs: Inputs,
    /// Another drive of the same radar, read in the same way: the file has the constants from all
    /// drives together. May be repeated.
    #[arg(long, value_name = "RECORDING")]
    pub with: Vec<PathBuf>,
    /// The folder of calibration.toml and calibration.svg.
    #[arg(long, default_value = "out/calibrate")]
    pub out: PathBuf,
    /// The log of a gyro, a table as CSV: its clock and its axes are found too. Default: what lies
    /// beside the scans.
    #[arg(long, value_name = "FILE", conflicts_with = "with")]
    pub gyro: Option<PathBuf>,
    /// The log of the wheels, a table as CSV: its clock and its scale are found too. Default: what
    /// lies beside the scans.
    #[arg(long, value_name = "FILE", conflicts_with = "with")]
    pub wheels: Option<PathBuf>,
    /// Length of the path by an odometer or GNSS, m: without it the range resolution is
    /// undetermined.
    #[arg(long, value_parser = length, conflicts_with = "with")]
    pub distance_m: Option<f64>,
    /// Maximum number of scans of a drive. Their points are kept in memory.
    #[arg(long, default_value = "2000")]
    pub scans: usize,
}

/// Parses a length: a positive number.
fn length(text: &str) -> Result<f64, String> {
    let length = text.parse().ok();
    let length = length.filter(|length: &f64| length.is_finite() && *length > 0.0);
    length.ok_or_else(|| "a number above 0 is needed".to_owned())
}

const SECTION: &str = "calibration.toml";
const PICTURE: &str = "calibration.svg";

/// Finds the constants, prints them, and writes `calibration.toml`, and a picture of each drive.
pub fn calibrate(arguments: &CalibrateArguments) -> Result<(), Failure> {
    let started = Instant::now();
    let file = arguments.out.join(SECTION);
    let _locked = Out::lock_for(&arguments.out, Content::CALIBRATION)?;
    let drives = read_drives(arguments)?;
    let sensors = Section::of(&drives)?;
    let radar = found_by(drives, &arguments.out);
    let found = radar.as_ref().ok();
    let ates_m = found.and_then(|it| ates_m(arguments, it));
    let is_worse = ates_m.is_some_and(|[before, after]| after > before);
    let better = if is_worse { "NOT better" } else { "better" };
    let check = ates_m.map_or(
        "compare runs with the file and without".to_owned(),
        |[a, b]| format!("ATE {a:.3} m as configured, {b:.3} m with the file: {better}"),
    );
    let text = match &radar {
        Ok(found) if is_worse => format!("# NOT recommended: {check}\n{}", toml(found)),
        Ok(found) => toml(found),
        // A drive may determine only the other constants: a drive that stands and turns determines
        // only the gyro.
        Err(error) if sensors.is_told => {
            print::note(format_args!("the radar is not calibrated: {error}"));
            format!("# Found by gyre calibrate. The radar is not calibrated: {error}\n")
        }
        Err(_) => return radar.map(drop),
    };
    storage::write(&file, text + &sensors.text)?;
    let (seconds, file) = (started.elapsed().as_secs_f64(), file.display());
    let advice = match is_worse {
        true => "is NOT recommended",
        false => "for `gyre run --calibration`",
    };
    print::line(format_args!("{seconds:.0} s; {file} {advice}"))?;
    if let Ok(found) = radar {
        print::line(format_args!("{:<21} {check}", "check"))?;
        print::line(found.overlap())?;
    }
    sensors.refused.map_or(Ok(()), Err)
}

fn read_drives(arguments: &CalibrateArguments) -> Result<Vec<Recorded>, Failure> {
    let configuration = arguments.inputs.configuration()?;
    let mut drives = vec![Recorded::read(configuration, arguments)?];
    for data in &arguments.with {
        let configuration = arguments.inputs.configuration_with(data)?;
        let other = Recorded::read(configuration, arguments)?;
        drives[0].require_same_constants(&other)?;
        drives.push(other);
    }
    Ok(drives)
}

fn found_by(drives: Vec<Recorded>, out: &Path) -> Result<Found, Failure> {
    let studies = drives.into_iter().enumerate().map(|(k, drive)| match k {
        0 => drive.study(&out.join(PICTURE)),
        _ => drive.study(&out.join(format!("calibration-{}.svg", k + 1))),
    });
    let mut studies: Vec<Study> = studies.collect::<Result<_, _>>()?;
    if studies.len() == 1 {
        return Ok(studies.remove(0).found);
    }
    let found = Study::combined(&studies)?;
    print::line(format_args!("all together: {found}"))?;
    Ok(found)
}

struct Recorded {
    name: String,
    drive: Drive,
    configured: Configured,
    /// In the order of the kinds.
    sensors: Vec<Option<Sensor>>,
}

impl Recorded {
    /// Registers the scans of a recording, as many as are asked for at most.
    fn read(
        mut configuration: Configuration,
        arguments: &CalibrateArguments,
    ) -> Result<Self, Failure> {
        let sensors = Sensor::read_all(&configuration, arguments)?;
        sensors::leave_out(&mut configuration.odometry.sensors);
        let Played { mut dataset, .. } = gyre_configuration::open(&configuration)?;
        describe_masks_in_process(&configuration)?
            .iter()
            .for_each(print::note);
        let mut scan = OwnedScan::with_limits(dataset.limits());
        let mut drive = Drive::new(&configuration.odometry)?;
        let played = configuration.source.played(dataset.scans());
        let (all, count) = (played.len(), played.len().min(arguments.scans));
        if count < all {
            let sentence = format!(
                "only the first {count} of {all} scans are used: --scans {all} takes them all"
            );
            if arguments.distance_m.is_some() {
                return Err(format!("{sentence}, which --distance-m needs").into());
            }
            print::note(sentence);
        }
        let mut progress = Bar::new(Some(count));
        for (done, number) in played.take(count).enumerate() {
            let pushed = match dataset.read(number, scan.slot()) {
                Ok(geometry) => {
                    scan.geometry = geometry;
                    drive.push(number, &scan).map_err(|error| error.to_string())
                }
                Err(error) => Err(error.to_string()),
            };
            if let Err(reason) = pushed {
                progress.say(&format!("left out scan {number}: {reason}"));
            }
            progress.scans(done as u64, done as u64, "read".to_owned());
        }
        progress.finish();
        let options = with_stored_options(&configuration)?.dataset;
        Ok(Self {
            name: configuration.data(),
            drive,
            configured: Configured {
                geometry: scan.geometry,
                eccentricity_rad: options.azimuth_eccentricity_rad.unwrap_or(0.0).into(),
                min_range_m: configuration.odometry.points.min_range_m.into(),
                distance_m: arguments.distance_m,
            },
            sensors,
        })
    }

    /// The findings are changes to the constants that a drive was read with.
    fn require_same_constants(&self, other: &Self) -> Result<(), Failure> {
        let constants = [self, other].map(|it| {
            let geometry = &it.configured.geometry;
            [
                ("range_resolution_m", geometry.range_resolution_m),
                ("range_offset_m", geometry.range_offset_m),
                ("doppler_s", geometry.doppler_s),
                (
                    "azimuth_eccentricity_rad",
                    it.configured.eccentricity_rad as f32,
                ),
            ]
        });
        let mut both = constants[0].iter().zip(constants[1]);
        match both.find(|(one, another)| one.1 != another.1) {
            None => Ok(()),
            Some(((key, one), (_, another))) => Err(format!(
                "{} is read with {key} = {one} and {} with {another}, which is not one radar: set dataset.{key}",
                self.name, other.name
            )
            .into()),
        }
    }

    fn study(self, picture: &Path) -> Result<Study, Failure> {
        print::note(format_args!("comparing {}, 1 s a scan", self.name));
        let study = Study::new(self.drive, &self.configured)?;
        print::line(format_args!("{}: {}", self.name, study.found))?;
        storage::write(picture, svg(&study.drive, &study.calibration))?;
        Ok(study)
    }
}

/// Returns the ATE by radar alone as configured and as found, m; `None` without a ground truth.
fn ates_m(arguments: &CalibrateArguments, found: &Found) -> Option<[f64; 2]> {
    let mut configuration = arguments.inputs.configuration().ok()?;
    sensors::leave_out(&mut configuration.odometry.sensors);
    let truth = read_trajectory(&truth_of(&configuration, &arguments.out)?).ok()?;
    let before = ate_m(&configuration, arguments.scans, &truth).ok()?;
    let file: ::toml::Table = toml(found).parse().ok()?;
    let constants: DatasetOptions = file["dataset"].clone().try_into().ok()?;
    configuration.dataset = constants.or(&configuration.dataset);
    if let Some(min_range_m) = found.min_range_m {
        configuration.odometry.points.min_range_m = min_range_m as f32;
        configuration.odometry.raster.min_range_m = min_range_m as f32;
    }
    // If the drive cannot be registered with the constants, they are worse.
    let after = ate_m(&configuration, arguments.scans, &truth);
    Some([before, after.unwrap_or(f64::INFINITY)])
}

fn ate_m(configuration: &Configuration, scans: usize, truth: &Trajectory) -> Result<f64, Failure> {
    let mut dataset = gyre_configuration::open(configuration)?.dataset;
    let mut odometry = Odometry::new(&configuration.odometry)?;
    let mut scan = OwnedScan::with_limits(dataset.limits());
    let (mut poses, mut stamps_ns) = (Vec::new(), Vec::new());
    for number in configuration.source.played(dataset.scans()).take(scans) {
        // What cannot be read was named when the drive was read.
        if let Ok(geometry) = dataset.read(number, scan.slot()) {
            scan.geometry = geometry;
            if let Ok(registered) = odometry.register(&scan.view(), &[]) {
                stamps_ns.push(geometry.stamp_ns);
                poses.push(registered.pose.motion);
            }
        }
    }
    let stamp_ns = Some(stamps_ns);
    let estimate = Trajectory { stamp_ns, poses };
    Ok(judge(&estimate, truth)?.ate.rmse_m)
}
