//! Draws the town around a place of a drive: `cargo run --release -p gyre-simulator --example town -- OUT.svg [TRAJECTORY|- [CHARACTER [AT_S [SEED]]]]`.
//!
//! Walls are lines (pale where they transmit), scatterers dots whose area grows with their cross-section.

use std::fmt::Write as _;

use gyre_simulator::path::recorded::{Excerpt, read};
use gyre_simulator::town::{self, Character, TownConfig};
use gyre_simulator::{BlockLoop, Body, DrivingSide, Path, Streets};
use nalgebra::Point2;

/// Half of the drawing's side, metres.
const REACH_M: f64 = 165.0;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let out = arguments
        .first()
        .ok_or("usage: town OUT.svg [TRAJECTORY|- [CHARACTER [AT_S [SEED]]]]")?;
    let drive: Box<dyn Path> = match arguments.get(1).filter(|path| *path != "-") {
        Some(path) => Box::new(read(std::path::Path::new(path), Excerpt::default())?),
        None => Box::new(BlockLoop::new(40.0, 32.0, 9.5, 5.0)),
    };
    let character = arguments
        .get(2)
        .map_or(Ok(Character::Mixed), |name| character(name))?;
    let at_s = arguments.get(3).map_or(Ok(0.0), |at_s| at_s.parse())?;
    let seed = arguments.get(4).map_or(Ok(1), |seed| seed.parse())?;
    let streets = Streets::along(
        drive.as_ref(),
        drive.duration_s().min(3600.0),
        DrivingSide::Left,
        seed,
    );
    let started = std::time::Instant::now();
    let town = town::build(
        &TownConfig {
            character,
            ..TownConfig::default()
        },
        &streets,
        seed,
    );
    let (scatterers, walls) = (town.scatterers.len(), town.walls.len());
    println!(
        "{scatterers} scatterers and {walls} walls in {:.2} s",
        started.elapsed().as_secs_f64()
    );
    std::fs::write(
        out,
        svg(
            &town,
            &streets,
            Point2::from(drive.pose(at_s).translation.vector),
        )?,
    )?;
    Ok(())
}

fn character(name: &str) -> Result<Character, String> {
    match name {
        "mixed" => Ok(Character::Mixed),
        "city" => Ok(Character::City),
        "suburb" => Ok(Character::Suburb),
        "campus" => Ok(Character::Campus),
        "country" => Ok(Character::Country),
        _ => Err(format!(
            "{name} is not one of mixed, city, suburb, campus, country"
        )),
    }
}

fn svg(town: &Body, streets: &Streets, middle: Point2<f64>) -> Result<String, std::fmt::Error> {
    let (left, top, side) = (middle.x - REACH_M, -middle.y - REACH_M, 2.0 * REACH_M);
    let mut svg = format!(
        "<svg xmlns='http://www.w3.org/2000/svg' width='1200' height='1200' viewBox='{left} {top} {side} {side}'>\n\
         <rect x='{left}' y='{top}' width='{side}' height='{side}' fill='white'/><g transform='scale(1,-1)' fill='none'>\n"
    );
    for street in streets.streets() {
        write!(
            svg,
            "<polyline stroke='#ddd' stroke-width='{}' points='",
            2.0 * street.half_width_m
        )?;
        street
            .centre
            .iter()
            .try_for_each(|p| write!(svg, "{:.1},{:.1} ", p.x, p.y))?;
        svg.push_str("'/>\n");
    }
    let near = |place: Point2<f64>| (place - middle).amax() < REACH_M;
    for wall in town.walls.iter().filter(|wall| near(wall.from)) {
        let (a, b, opacity) = (wall.from, wall.to, 1.0 - wall.transmission);
        writeln!(
            svg,
            "<path d='M{:.2} {:.2}L{:.2} {:.2}' stroke='#048' stroke-width='0.4' opacity='{opacity:.2}'/>",
            a.x, a.y, b.x, b.y
        )?;
    }
    for scatterer in town
        .scatterers
        .iter()
        .filter(|scatterer| near(scatterer.position))
    {
        let (p, radius_m) = (
            scatterer.position,
            (0.15 * scatterer.cross_section_m2.sqrt()).clamp(0.05, 0.8),
        );
        writeln!(
            svg,
            "<circle cx='{:.2}' cy='{:.2}' r='{radius_m:.2}' fill='#c20' opacity='0.5'/>",
            p.x, p.y
        )?;
    }
    svg.push_str("</g></svg>\n");
    Ok(svg)
}
