//! The configuration of a simulation, which a recording keeps beside its images.

use bolero::check;
use gyre_datasets::ImageSource as _;
use gyre_fuzz::{
    Failure, Target,
    edit::{TextEdit, edit_text},
};
use gyre_simulator::{SimulatedDrive, SimulationConfig};

/// Images up to this size are drawn, bytes.
const LARGEST_IMAGE: usize = 1 << 20;

/// Builds the town and draws the first scan.
fn use_simulation(text: &str) -> Result<(), Failure> {
    let config: SimulationConfig =
        toml::from_str(text).map_err(|error| error.message().to_owned())?;
    let drive = SimulatedDrive::new(&config)?;
    let bytes = drive.image_size().bytes();
    assert!(drive.scans() > 0);
    if bytes <= LARGEST_IMAGE {
        drive.renderer().draw(0, &mut vec![0; bytes]);
    }
    Ok(())
}

#[test]
fn simulations() {
    let target = Target::new(512);
    let config = SimulationConfig {
        scans: Some(1),
        ..SimulationConfig::default()
    };
    let text = toml::to_string(&config).unwrap();
    use_simulation(&text).unwrap();
    check!()
        .with_type::<Vec<TextEdit>>()
        .for_each(|edits| target.run(|| use_simulation(&edit_text(&text, edits))));
}
