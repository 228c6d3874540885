//! The velocity by Doppler on simulated scans of a RAS6, against the true one. A table.

use gyre_datasets::open_source;
use gyre_geometry::{OwnedScan, samples::Evidence};
use gyre_radar::{DopplerEstimator, NoDoppler, PointsConfig};
use gyre_worlds::{OutputFormat, Profile, Realism, SimulatedDrive, SimulationConfig};
use nalgebra::{Matrix2, Vector2};

/// A drive through a town on a road as hard as a real one.
fn town(seed: u64, vehicles_per_km: f64, rain_mm_h: f64) -> SimulationConfig {
    let text = format!(
        "seed = {seed}\n[drive]\nkind = \"town\"\nspeed_mps = 10.0\nlength_m = 2000.0\n[[weather]]\nrain_mm_h = {rain_mm_h}"
    );
    let mut config: SimulationConfig = toml::from_str(&text).unwrap();
    config.realism = Realism::Road;
    config.sensor.profile = Profile::Ras6;
    config.output.format = Some(OutputFormat::Boreas);
    config.traffic.vehicles_per_km = vehicles_per_km;
    config.effects.miscalibration = Some(false);
    config
}

/// The errors of the velocities of a drive's scans.
#[derive(Default)]
struct Errors {
    scans: usize,
    /// Scans that do not say it.
    silent: usize,
    of_each: Vec<Error>,
}

struct Error {
    /// Along the axes of the radar, m/s.
    off: Vector2<f64>,
    covariance: Matrix2<f64>,
}

impl Errors {
    /// Takes every so-many-th scan of a drive.
    fn add(&mut self, config: &SimulationConfig, every: usize) {
        let drive = SimulatedDrive::new(config).unwrap();
        let options = drive.dataset_options();
        let mut dataset = open_source(Box::new(drive.renderer()), &options).unwrap();
        let mut scan = OwnedScan::with_limits(dataset.limits());
        let mut estimator = DopplerEstimator::default();
        let min_range_m = PointsConfig::default().min_range_m;
        for index in (0..dataset.len()).step_by(every) {
            scan.geometry = dataset.read(index, scan.slot()).unwrap();
            self.scans += 1;
            match estimator.estimate(&scan.view(), min_range_m) {
                Ok(found) => self.of_each.push(Error::of(&found, &drive, index)),
                Err(NoDoppler::TooFewBearings { .. } | NoDoppler::NoAgreement { .. }) => {
                    self.silent += 1;
                }
                Err(error) => panic!("{error}"),
            }
        }
    }

    /// Mean and root of the mean square of both axes, m/s.
    fn mean_and_rms(&self) -> [Vector2<f64>; 2] {
        let scans = self.of_each.len() as f64;
        let sum: Vector2<f64> = self.of_each.iter().map(|it| it.off).sum();
        let squares: Vector2<f64> = self
            .of_each
            .iter()
            .map(|it| it.off.component_mul(&it.off))
            .sum();
        [sum / scans, (squares / scans).map(f64::sqrt)]
    }

    /// The mean of the squared errors over their variances, over the degrees of freedom.
    fn nees(&self) -> f64 {
        let of_each = self.of_each.iter().map(Error::nees);
        of_each.sum::<f64>() / (2.0 * self.of_each.len() as f64)
    }

    fn worst_mps(&self) -> f64 {
        let sizes = self.of_each.iter().map(|it| it.off.norm());
        sizes.fold(0.0, f64::max)
    }

    fn print(&self, name: &str) {
        let [mean, rms] = self.mean_and_rms();
        println!(
            "| {name} | {} of {} | {:+.3}, {:+.3} | {:.3}, {:.3} | {:.2} | {:.2} |",
            self.of_each.len(),
            self.scans,
            mean.x,
            mean.y,
            rms.x,
            rms.y,
            self.worst_mps(),
            self.nees()
        );
    }
}

impl Error {
    fn of(found: &Evidence, drive: &SimulatedDrive, index: usize) -> Self {
        let simulator = drive.simulator();
        let time = simulator.time(index);
        let middle_s = time.drive_time_s(time.middle_us());
        let path = simulator.path();
        let truth = path.pose(middle_s).rotation.inverse() * path.velocity(middle_s);
        let [xx, xy, yy] = found.covariance;
        Self {
            off: Vector2::from(found.value) - truth,
            covariance: Matrix2::new(xx, xy, xy, yy),
        }
    }

    fn nees(&self) -> f64 {
        let inverse = self.covariance.try_inverse().unwrap();
        (self.off.transpose() * inverse * self.off)[0]
    }
}

#[test]
fn scans_of_a_town_say_the_velocity() {
    let mut config = town(1, 20.0, 0.0);
    config.scans = Some(48);
    let mut errors = Errors::default();
    errors.add(&config, 4);
    errors.print("town");
    assert!(errors.silent <= 1 && errors.worst_mps() < 0.5);
}

#[test]
#[ignore = ".ci/nightly: renders 1,200 scans"]
fn velocities_of_towns_in_rain_and_in_traffic() {
    println!("| | scans | mean error ahead, left | RMS | worst | NEES |");
    for (name, vehicles_per_km, rain_mm_h) in [
        ("dry", 20.0, 0.0),
        ("rain, 10 mm/h", 20.0, 10.0),
        ("dense traffic, 80 vehicles/km", 80.0, 0.0),
    ] {
        let mut errors = Errors::default();
        for seed in 1..=4 {
            let config = SimulationConfig {
                scans: Some(400),
                ..town(seed, vehicles_per_km, rain_mm_h)
            };
            errors.add(&config, 4);
        }
        errors.print(name);
        let [mean, rms] = errors.mean_and_rms();
        assert!(mean.norm() < 0.1 && rms.norm() < 0.3);
        assert!(errors.nees() < 3.0 && errors.silent * 20 < errors.scans);
    }
}
