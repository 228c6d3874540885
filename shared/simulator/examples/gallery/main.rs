//! Draws each of the sensor's effects off and on: `cargo run --release -p gyre-simulator --example gallery`.
//!
//! Writes small pictures and a page with them into the crate's folder `gallery`. The same pictures whenever it runs on one kind of
//! machine, so that a change of the sensor shows in version control.

mod exhibit;
mod picture;
mod radars;
mod scenes;
mod shot;
mod surroundings;
mod switches;

use std::fs;
use std::path::Path;

use exhibit::Exhibit;

const INTRODUCTION: &str = "\
# The effects of the simulated radar

Each effect off and on, with the same scene, radar and seed. Drawn by
`cargo run --release -p gyre-simulator --example gallery`.

Pictures are either polar (a row for each azimuth, range to the right) or maps (the sensor in the centre, ahead is up). Grey is power on
the sensor's scale of half decibels. By default the radar is Oxford's CTS350-X, at rest in a synthetic scene, with noise and no other
effect. `effects.x` is the key of the switch in the configuration's section `[simulation.effects]`.
";

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("gallery");
    fs::create_dir_all(&folder)?;
    let mut page = INTRODUCTION.to_owned();
    let mut bytes = 0;
    let sections: [(&str, Vec<Exhibit>); 3] = [
        ("Effects with a switch", switches::exhibits()),
        ("Weather, traffic and the host", surroundings::exhibits()?),
        ("Radars and their receivers", radars::exhibits()?),
    ];
    for (title, exhibits) in sections {
        page += &format!("\n## {title}\n");
        for exhibit in exhibits {
            page += &exhibit.markdown();
            bytes += exhibit.write(&folder)?;
        }
    }
    fs::write(folder.join("README.md"), page)?;
    println!("{}: {} KB of pictures", folder.display(), bytes / 1024);
    Ok(())
}
