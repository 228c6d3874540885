//! `gyre ros2`: publishes a running run to ROS 2.

use std::path::Path;

use gyre_client::Run;
use gyre_configuration::{
    Configuration,
    terminal::{Failure, print},
};
use gyre_geometry::samples::SensorKind;
use gyre_results::{absolute, map_options};
use gyre_ros2_bridge::{Bridge, MapSettings, RunSettings, Settings};
use gyre_ros2_messages::Domain;
use gyre_transport::wake::Signals;

use crate::{arguments::Ros2Arguments, ros_args::RosArguments};

const NODE: &str = "gyre";

pub fn publish(arguments: &Ros2Arguments) -> Result<(), Failure> {
    // A wrong folder is reported at once.
    let run = arguments.run.folder()?;
    if !arguments.wait {
        Run::open(&run)?;
    }
    let domain = Domain::new(arguments.domain, arguments.interface.as_deref())?;
    let given = RosArguments::parse(&arguments.ros_args)?;
    let mut vehicle = arguments.frames.vehicle()?;
    given.rename(&mut vehicle.frames);
    let bridge = Bridge::open(Settings {
        out: absolute(&run)?,
        domain,
        namespace: given
            .namespace
            .unwrap_or_else(|| arguments.namespace.clone()),
        name: given.node.unwrap_or_else(|| NODE.to_owned()),
        vehicle,
        transforms: !arguments.no_tf && given.publish_odom_tf.unwrap_or(true),
        ahead_ns: arguments.tf_ahead_s.as_nanos() as i64,
        map: !arguments.no_map,
        clock: arguments.clock,
        is_managed: arguments.managed,
        say: |sentence| print::note(format_args!("gyre: {sentence}")),
        of_run: run_settings,
    })?;
    let signals = Signals::install()?;
    let out = run.display();
    print::note(format_args!(
        "gyre: {out} is published in domain {} of ROS 2",
        domain.id
    ));
    if domain.is_open() {
        print::note(
            "gyre: whoever is on this network can read it, and DDS carries it unencrypted; --interface 127.0.0.1 keeps it on this computer",
        );
    }
    Ok(bridge.publish(&signals)?)
}

/// Returns the topics of ROS 2 with the samples of a run's other sensors.
fn sensors_in_ros2(configuration: &Configuration) -> Vec<String> {
    let sensors = configuration.odometry.sensors.sampled();
    let in_ros2 = sensors.iter().filter(|it| it.kind() == SensorKind::Ros2);
    let topics = in_ros2.filter_map(|it| it.live_topic());
    topics.map(str::to_owned).collect()
}

fn run_settings(out: &Path) -> Result<RunSettings, String> {
    let configuration = Configuration::read(&out.join("config.toml"), &[]);
    let configuration = configuration.map_err(|error| error.to_string())?;
    let estimator = configuration.slam.kind.estimator();
    Ok(RunSettings {
        map: estimator.map(|estimator| MapSettings {
            options: map_options(&configuration),
            estimator,
        }),
        has_doppler: configuration.odometry.sensors.doppler.is_used(),
        is_replay: !configuration.is_radar(),
        predicts: configuration.run.predict_hz > 0.0,
        sensor_topics: sensors_in_ros2(&configuration),
    })
}
