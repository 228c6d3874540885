//! `gyre ros2`: publishes a running run to ROS 2.

use std::path::Path;

use gyre_client::Run;
use gyre_configuration::{
    Configuration,
    terminal::{Failure, print},
};
use gyre_results::{absolute, map_options};
use gyre_ros2_bridge::{Bridge, MapSettings, Settings};
use gyre_ros2_messages::Domain;
use gyre_transport::wake::Signals;

use crate::arguments::Ros2Arguments;

pub fn publish(arguments: &Ros2Arguments) -> Result<(), Failure> {
    // A wrong folder is reported at once.
    let run = arguments.run.folder()?;
    if !arguments.wait {
        Run::open(&run)?;
    }
    let domain = Domain::new(arguments.domain, arguments.interface.as_deref())?;
    let bridge = Bridge::open(Settings {
        out: absolute(&run)?,
        domain,
        namespace: arguments.namespace.clone(),
        vehicle: arguments.frames.vehicle()?,
        transforms: !arguments.no_tf,
        map: (!arguments.no_map).then_some(map_settings),
    })?;
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
    let signals = Signals::install()?;
    bridge.publish(&signals, |sentence| {
        print::note(format_args!("gyre: {sentence}"));
    })?;
    Ok(())
}

fn map_settings(out: &Path) -> Result<MapSettings, String> {
    let configuration = Configuration::read(&out.join("config.toml"), &[]);
    let configuration = configuration.map_err(|error| error.to_string())?;
    let estimator = configuration.slam.kind.estimator();
    Ok(MapSettings {
        options: map_options(&configuration),
        estimator: estimator.ok_or("slam.kind is none")?,
    })
}
