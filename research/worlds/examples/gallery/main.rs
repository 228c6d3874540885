//! Draws the pictures of `gallery/README.md`, which describes each effect of the sensor:
//! `cargo run --release -p gyre-worlds --example gallery`.
//!
//! The same pictures whenever it runs on one kind of machine, so that a change of the sensor shows
//! in version control.

mod exhibit;
mod picture;
mod radars;
mod road;
mod scenes;
mod shot;
mod surroundings;
mod switches;

use std::path::Path;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("gallery");
    let mut bytes = 0;
    let around = surroundings::exhibits()?.into_iter();
    let road = road::exhibits()?.into_iter();
    let radars = radars::exhibits()?;
    let all = switches::exhibits().into_iter().chain(road).chain(around);
    for exhibit in all.chain(radars) {
        bytes += exhibit.write(&folder)?;
    }
    println!("{}: {} KB of pictures", folder.display(), bytes / 1024);
    Ok(())
}
