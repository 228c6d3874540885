//! Checks before the first process is started.

use std::{
    path::{Path, PathBuf},
    time::Duration,
};

use gyre_configuration::{
    Configuration, Played, gnss_log, open,
    terminal::{Failure, print},
};
use gyre_contract::{
    Footprint, Limits, StageId, Window,
    run::{LinkConfig, MOST_OPEN_FILES, Mode, PlayedFrom, Side, SourceKind},
};
use gyre_datasets::{DEFAULT_TURN_NS, Dataset, Fingerprint, Format, turn_ns};
use gyre_geometry::samples::{MAX_SAMPLES, SensorKind};
use gyre_masking::Masker;
use gyre_stage::datagrams::check_addresses;
use gyre_stages::{
    live_radar::{Settings, Sizes},
    radar_replay::{Listing, Player},
};
use gyre_tools::maps::localise::localiser;
use gyre_transport::Manifest;
use rustix::process::{Resource, getrlimit};

pub struct Preflight {
    pub scans: Scans,
    pub window: Window,
    pub limits: Limits,
    pub footprint: Footprint,
}

impl Preflight {
    pub fn manifest(&self, configuration: &Configuration, out: &Path, build: String) -> Manifest {
        Manifest {
            prefix: String::new(),
            root: PathBuf::new(),
            out: out.to_owned(),
            window: self.window,
            limits: self.limits,
            live: configuration.run.mode == Mode::Live,
            refines: configuration.has(StageId::Refinement),
            rate: configuration.run.rate.factor(),
            build,
        }
    }
}

pub struct Recording {
    pub fingerprint: Fingerprint,
    pub listing: Listing,
}

pub type Ask<'a> = dyn FnMut(&Configuration) -> Result<Sizes, Failure> + 'a;

/// Checks the dataset and the mask; `ask` may wait for the radar and the network, and comes last.
pub fn check(configuration: &Configuration, ask: &mut Ask<'_>) -> Result<Preflight, Failure> {
    check_link(&configuration.link)?;
    let masker = Masker::new(
        &configuration.odometry.raster,
        &configuration.odometry.points,
        &configuration.odometry.masking,
    )?;
    if configuration.objects.is_on() {
        gyre_stages::followers::objects::tracker(&configuration.odometry.masking)?;
    }
    if !configuration.gnss.is_live() {
        // Where the results lie does not matter to a log.
        gnss_log(configuration, Path::new(""))?;
    }
    if !configuration.is_radar() {
        check_addresses(&[&configuration.gnss])?;
    }
    if configuration.slam.is_localised() {
        localiser(&configuration.slam.map, configuration)?;
    }
    let scans = match configuration.is_radar() {
        true => Scans::of_radar(configuration, ask)?,
        false if configuration.is_side(Side::Base) => Scans::of_base(&configuration.link)?,
        false if configuration.source.from != PlayedFrom::Scan => {
            Scans::of_messages(configuration)?
        }
        false => Scans::of_recording(configuration)?,
    };
    let period = Duration::from_nanos(scans.period_ns.max(0) as u64);
    let window = configuration.window(Some(period), masker.scans());
    let limits = Limits {
        scan_bytes: scans.bytes,
        raster_cells: configuration.odometry.raster.n * configuration.odometry.raster.n,
        cell_m: configuration.odometry.raster.cell_m,
        rasters: masker.scans(),
        points: configuration.odometry.points.capacity,
        samples: match configuration.odometry.has_samples() {
            true => MAX_SAMPLES,
            false => 0,
        },
    };
    let footprint = Footprint::new(&window, &limits);
    Ok(Preflight {
        scans,
        window,
        limits,
        footprint,
    })
}

/// The properties of the scans that the source knows before the run.
#[derive(Default)]
pub struct Scans {
    /// `None`: without end.
    pub count: Option<usize>,
    period_ns: i64,
    bytes: usize,
    /// `ground_truth.tum` of a simulation.
    pub truth: Option<Vec<u8>>,
    pub recording: Option<Recording>,
    /// See [`Session::damage`](gyre_results::Session).
    pub damage: Option<String>,
    /// See [`Session::needs_all`](gyre_results::Session).
    pub needs_all: bool,
}

impl Scans {
    fn of_recording(configuration: &Configuration) -> Result<Self, Failure> {
        let Played {
            dataset,
            samples,
            truth,
            ..
        } = open(configuration)?;
        for fault in samples.faults() {
            print::note(fault);
        }
        let count = configuration.source.stream_len(dataset.scans());
        if let Some(scans @ 0..2) = count {
            let (path, plural) = (configuration.data(), if scans == 1 { "" } else { "s" });
            return Err(format!(
                "{path} has {scans} scan{plural}: a motion is between two, so there is nothing to run; `gyre inspect` shows its content"
            )
            .into());
        }
        let recording = match truth {
            Some(_) => None,
            None => Some(Recording {
                fingerprint: Fingerprint::of(dataset.as_ref())?,
                listing: Listing::of(dataset.as_ref()),
            }),
        };
        Ok(Self {
            count,
            period_ns: dataset.period_ns(),
            bytes: dataset.limits().bytes,
            damage: dataset.damage().map(str::to_owned),
            needs_all: needs_all(dataset.as_ref()),
            truth,
            recording,
        })
    }

    /// The messages of a recording, which take the place of stages.
    fn of_messages(configuration: &Configuration) -> Result<Self, Failure> {
        let source = &configuration.source;
        if !gyre_recording::is_recording(&source.data) {
            let (from, data) = (source.from.name(), configuration.data());
            let fault = match data.is_empty() {
                true => format!("none is named: name it, as in `gyre run NAME.mcap --from {from}`"),
                false => format!(
                    "{data} is no such recording: `gyre record` and `gyre run --record` make one"
                ),
            };
            return Err(format!(
                "--from {from} (source.from) plays the messages of a recorded run, and {fault}"
            )
            .into());
        }
        let refines = configuration.has(StageId::Refinement);
        let topics = source
            .from
            .topics(refines, configuration.window(None, 1).logs_points());
        let player = Player::open(source, topics)?;
        let stamps: Vec<i64> = player.stamps_ns().collect();
        Ok(Self {
            count: Some(stamps.len()),
            period_ns: turn_ns(stamps.into_iter()).unwrap_or(DEFAULT_TURN_NS),
            damage: player.damage(),
            ..Self::default()
        })
    }

    /// Returns the properties of the robot's scans, which a base asks for before the run if scans
    /// are sent.
    fn of_base(link: &LinkConfig) -> Result<Self, Failure> {
        Ok(Self {
            period_ns: DEFAULT_TURN_NS,
            bytes: match link.cut {
                #[cfg(feature = "link")]
                PlayedFrom::Scan => {
                    let name = &link.name;
                    print::note(format_args!(
                        "link {name}: waiting for the robot, which knows how large its scans are"
                    ));
                    gyre_link::ask_robot(link)?
                }
                _ => 0,
            },
            ..Self::default()
        })
    }

    fn of_radar(configuration: &Configuration, ask: &mut Ask<'_>) -> Result<Self, Failure> {
        let is_in_ros2 = configuration.source.kind == SourceKind::Ros2;
        let odometry = &configuration.odometry;
        for sensor in odometry.sensors.sampled() {
            let comes = match sensor.kind() {
                SensorKind::None | SensorKind::Udp => true,
                SensorKind::Ros2 => is_in_ros2,
                SensorKind::Auto | SensorKind::Log => false,
            };
            if !comes {
                let section = sensor.of().section();
                return Err(format!(
                    "{section}.kind is of a recording, but the radar is live: set it to `udp`, to `ros2` for a radar behind its driver in ROS 2, or to `none`"
                )
                .into());
            }
        }
        if odometry.sensors.doppler.is_used() {
            return Err("doppler.kind is `auto`, but a live radar does not report which of its chirps rise: set it to `none`".into());
        }
        configuration.dataset.check()?;
        let radar = ask(configuration)?;
        Ok(Self {
            count: configuration.source.scans,
            period_ns: radar.period_ns,
            bytes: radar.limits.bytes,
            ..Self::default()
        })
    }
}

/// Checks that the other side of a split run can be reached as it is configured.
fn check_link(link: &LinkConfig) -> Result<(), Failure> {
    if link.side.is_none() {
        return Ok(());
    }
    #[cfg(not(feature = "link"))]
    return Err(crate::features::absent(crate::features::LINK).into());
    #[cfg(feature = "link")]
    gyre_link::check(link).map_err(|error| format!("[link]: {error}").into())
}

/// Asks the radar for the sizes of its scans. This machine must have the addresses of the other
/// sensors.
pub fn ask(configuration: &Configuration) -> Result<Sizes, Failure> {
    check_addresses(&configuration.sensors())?;
    let (source, options) = (&configuration.source, &configuration.dataset);
    match source.kind {
        #[cfg(feature = "ros2")]
        SourceKind::Ros2 => {
            use gyre_ros2_bridge::source::{Settings, ask};
            Ok(ask(&Settings::of(source, options)?)?)
        }
        #[cfg(not(feature = "ros2"))]
        SourceKind::Ros2 => Err(crate::features::absent("ROS 2").into()),
        _ => Ok(gyre_stages::live_radar::ask(&Settings::of(
            source, options,
        )?)?),
    }
}

/// See [`Session::needs_all`](gyre_results::Session).
pub(crate) fn needs_all(dataset: &dyn Dataset) -> bool {
    matches!(dataset.format(), Format::Mcap | Format::Ros2Bag)
}

/// The transport's own errors would not name the missing limit.
pub fn check_open_files() -> Result<(), Failure> {
    match getrlimit(Resource::Nofile).current {
        Some(limit) if limit < MOST_OPEN_FILES => Err(format!(
            "a process may have {limit} open files, but one of a run has up to {MOST_OPEN_FILES}: raise the limit with `ulimit -n 1024`"
        )
        .into()),
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use std::net::UdpSocket;

    use super::*;

    #[test]
    fn an_address_that_another_program_has_is_refused_before_the_run() {
        let taken = UdpSocket::bind("127.0.0.1:0").unwrap();
        let address = taken.local_addr().unwrap();
        for section in ["gyro", "wheels", "gnss"] {
            let settings = format!(
                "source.kind=colossus source.address=127.0.0.1:9 run.mode=live run.rate=realtime \
                 slam.kind=graph {section}.kind=udp {section}.listen={address}"
            );
            let settings: Vec<String> = settings.split_whitespace().map(str::to_owned).collect();
            let configuration = Configuration::of_overrides(&settings).unwrap();
            let refused = check_addresses(&configuration.sensors()).unwrap_err();
            let expected = format!("{address} ({section}.listen)");
            assert!(refused.to_string().contains(&expected), "{refused}");
        }
    }
}
