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
# What the simulated radar does

Each effect off and on: the same scene, radar and seed, and only that effect differs. Made by
`cargo run --release -p gyre-simulator --example gallery`.

Pictures are either polar (a row for each azimuth, range to the right) or seen from above (the sensor in the middle, ahead is up). Grey
is power on the sensor's own scale, in half decibels. Unless said otherwise the radar is Oxford's CTS350-X, at rest in a drawn scene,
with noise and no other effect. A key `effects.x` is the switch in a configuration's section `[simulation.effects]`.
";

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("gallery");
    fs::create_dir_all(&folder)?;
    let mut page = INTRODUCTION.to_owned();
    let mut bytes = 0;
    let sections: [(&str, Vec<Exhibit>); 3] = [
        ("Effects that can be switched", switches::exhibits()),
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
