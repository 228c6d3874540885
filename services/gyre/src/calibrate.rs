//! `gyre calibrate`: finds the constants of a radar from drives alone, and the clock, the axis and
//! the scale of the sensors beside it.

mod sensors;

use std::{
    cell::RefCell,
    path::{Path, PathBuf},
    time::Instant,
};

use clap::Args;
use gyre_calibration::{Configured, Drive, Found, Reversal, Study, Track};
use gyre_configuration::{
    Configuration, Played, describe_masks_in_process,
    terminal::{Failure, inputs::Inputs, print},
    with_stored_options,
};
use gyre_datasets::Format;
use gyre_geometry::OwnedScan;
use gyre_results::{Content, Out};
use gyre_storage as storage;
use gyre_tools::bar::Bar;
use sensors::Section;
pub(crate) use sensors::Sensor;

const MAX_SCANS: usize = 2000;

#[derive(Debug, Args)]
pub struct CalibrateArguments {
    #[command(flatten)]
    pub inputs: Inputs,
    /// Another drive of the same radar, read in the same way: the file has the constants from all
    /// drives together. May be repeated.
    #[arg(long, value_name = "RECORDING")]
    pub with: Vec<PathBuf>,
    /// The folder of calibration.toml.
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
    #[arg(long, default_value_t = MAX_SCANS)]
    pub scans: usize,
}

impl CalibrateArguments {
    /// All defaults, for the drive of a run.
    pub(crate) fn of_run(run: &Path) -> Self {
        Self {
            inputs: Inputs::default(),
            with: Vec::new(),
            out: run.to_owned(),
            gyro: None,
            wheels: None,
            distance_m: None,
            scans: MAX_SCANS,
        }
    }
}

/// Parses a length: a positive number.
fn length(text: &str) -> Result<f64, String> {
    let length = text.parse().ok();
    let length = length.filter(|length: &f64| length.is_finite() && *length > 0.0);
    length.ok_or_else(|| "a number above 0 is needed".to_owned())
}

const SECTION: &str = "calibration.toml";

/// Finds the constants, prints them, and writes `calibration.toml`.
pub fn calibrate(arguments: &CalibrateArguments) -> Result<(), Failure> {
    let started = Instant::now();
    let file = arguments.out.join(SECTION);
    let _locked = Out::lock_for(&arguments.out, Content::CALIBRATION)?;
    let drives = read_drives(arguments)?;
    let sensors = Section::of(&drives)?;
    let radar = found_by(drives);
    let text = match &radar {
        Ok(found) => found.toml(),
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
    print::line(format_args!(
        "{seconds:.0} s; {file} for `gyre run --calibration`"
    ))?;
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

fn found_by(drives: Vec<Recorded>) -> Result<Found, Failure> {
    let studies = drives.into_iter().map(|drive| {
        let name = drive.name.clone();
        let study = drive.study()?;
        print::line(format_args!("{name}: {}", study.found))?;
        Ok(study)
    });
    let mut studies: Vec<Study> = studies.collect::<Result<_, Failure>>()?;
    if studies.len() == 1 {
        return Ok(studies.remove(0).found);
    }
    let found = Study::combined(&studies)?;
    print::line(format_args!("all together: {found}"))?;
    Ok(found)
}

pub(crate) struct Recorded {
    name: String,
    pub(crate) format: Format,
    pub(crate) drive: Drive,
    pub(crate) track: Track,
    pub(crate) reversal: Reversal,
    configured: Configured,
    /// In the order of the kinds.
    pub(crate) sensors: Vec<Option<Sensor>>,
}

impl Recorded {
    /// Registers the scans of a recording, as many as are asked for at most.
    pub(crate) fn read(
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
            let sentence = format!("only the first {count} of {all} scans are used");
            if arguments.distance_m.is_some() {
                return Err(format!("{sentence}, and --distance-m is the length of the whole drive: use all, --scans {all}").into());
            }
            print::note(sentence);
        }
        let mut progress = Bar::new(Some(count));
        for (done, number) in played.take(count).enumerate() {
            let pushed = match dataset.read(number, scan.slot()) {
                Ok(geometry) => {
                    scan.geometry = geometry;
                    drive.push(&scan).map_err(|error| error.to_string())
                }
                Err(error) => Err(error.to_string()),
            };
            if let Err(reason) = pushed {
                progress.say(&format!("left out scan {number}: {reason}"));
            }
            progress.scans(done as u64, done as u64, "read".to_owned());
        }
        progress.finish();
        let (track, reversal) = drive.mean_track()?;
        let options = with_stored_options(&configuration)?.dataset;
        Ok(Self {
            name: configuration.data(),
            format: dataset.format(),
            drive,
            track,
            reversal,
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

    pub(crate) fn study(self) -> Result<Study, Failure> {
        let scans = self.drive.sweeps.len() as u64;
        let progress = RefCell::new((Bar::new(None), 0));
        let study = Study::new(self.drive, self.track, &self.configured, &|| {
            let (bar, done) = &mut *progress.borrow_mut();
            *done += 1;
            bar.scans(scans, scans, format!("comparison {done} of their parts"));
        });
        progress.into_inner().0.finish();
        Ok(study?)
    }
}
