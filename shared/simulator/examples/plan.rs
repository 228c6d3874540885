//! Draws the streets, the drive and the traffic at some times: `cargo run --release -p gyre-simulator --example plan -- OUT.svg [TRAJECTORY|town|campus|block [SEED [left|right]]]`.

use std::fmt::Write as _;
use std::sync::Arc;

use gyre_simulator::drive::{DriveConfig, DriveKind};
use gyre_simulator::traffic::{Traffic, TrafficConfig};
use gyre_simulator::{DrivingSide, Movers, Path, Streets};
use nalgebra::Point2;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let out = arguments
        .first()
        .ok_or("usage: plan OUT.svg [TRAJECTORY|town|campus|block [SEED [left|right]]]")?;
    let seed = arguments.get(2).map_or(Ok(1), |seed| seed.parse())?;
    let kind = match arguments.get(1).map(String::as_str) {
        None | Some("block") => DriveConfig::default(),
        Some("campus") => DriveConfig::campus(),
        Some("town") => DriveConfig {
            kind: DriveKind::Town,
            length_m: 8000.0,
            speed_mps: 13.9,
            ..DriveConfig::default()
        },
        Some(file) => DriveConfig::along_file(file.into()),
    };
    let drive = kind.path(seed, None)?;
    let duration_s = drive.duration_s().min(60.0 * 60.0);
    let keep = if arguments.get(3).is_some_and(|keep| keep == "right") {
        DrivingSide::Right
    } else {
        DrivingSide::Left
    };
    let started = std::time::Instant::now();
    let streets = Streets::along(drive.as_ref(), duration_s, keep, seed);
    println!(
        "{} streets in {:.3} s",
        streets.streets().len(),
        started.elapsed().as_secs_f64()
    );
    let mut drawing = svg(drive.as_ref(), duration_s, &streets)?;
    let started = std::time::Instant::now();
    let drive: Arc<dyn Path> = drive.into();
    let traffic = Traffic::new(
        &TrafficConfig::default(),
        drive.clone(),
        duration_s,
        &streets,
        keep,
        seed,
    );
    println!("traffic in {:.3} s", started.elapsed().as_secs_f64());
    let moments = (duration_s / 60.0) as usize;
    for moment in 1..=moments.max(1) {
        add_moment(
            &mut drawing,
            &traffic,
            drive.as_ref(),
            duration_s * moment as f64 / (moments + 1) as f64,
        )?;
    }
    drawing.push_str("</g></svg>");
    std::fs::write(out, drawing)?;
    Ok(())
}

/// Adds the ego vehicle and the traffic at a time: a dot for each scatterer, a line for one second of motion.
fn add_moment(
    svg: &mut String,
    traffic: &Traffic,
    drive: &dyn Path,
    time_s: f64,
) -> std::fmt::Result {
    let own = drive.pose(time_s).translation;
    write!(
        svg,
        "<circle cx='{:.2}' cy='{:.2}' r='2' fill='red'/>",
        own.x, own.y
    )?;
    let mut result = Ok(());
    traffic.visit(time_s, Point2::from(own.vector), 165.0, &mut |mover| {
        let at = mover.pose.translation.vector;
        let ahead = at + mover.velocity;
        result = result.and(write!(
            svg,
            "<path stroke='green' stroke-width='.4' d='M{:.2} {:.2}L{:.2} {:.2}'/>",
            at.x, at.y, ahead.x, ahead.y
        ));
        for scatterer in &mover.body.scatterers {
            let place = mover.pose * scatterer.position;
            result = result.and(write!(
                svg,
                "<circle cx='{:.2}' cy='{:.2}' r='.3' fill='blue'/>",
                place.x, place.y
            ));
        }
    });
    result
}

fn svg(drive: &dyn Path, duration_s: f64, streets: &Streets) -> Result<String, std::fmt::Error> {
    let points = || streets.streets().iter().flat_map(|street| &street.centre);
    let low = points().fold(Point2::new(f64::MAX, f64::MAX), |a, b| a.inf(b))
        - nalgebra::Vector2::repeat(20.0);
    let size = points().fold(Point2::new(f64::MIN, f64::MIN), |a, b| a.sup(b)) - low
        + nalgebra::Vector2::repeat(20.0);
    let mut svg = format!(
        "<svg xmlns='http://www.w3.org/2000/svg' viewBox='{} {} {} {}'><g transform='scale(1,-1)' fill='none' stroke-linejoin='round'>",
        low.x,
        -low.y - size.y,
        size.x,
        size.y
    );
    write!(
        svg,
        "<rect x='{}' y='{}' width='{}' height='{}' fill='white'/>",
        low.x, low.y, size.x, size.y
    )?;
    for street in streets.streets() {
        let colour = if street.driven { "#888" } else { "#bbb" };
        write!(
            svg,
            "<polyline stroke='{colour}' stroke-width='{}' points='",
            2.0 * street.half_width_m
        )?;
        street
            .centre
            .iter()
            .try_for_each(|p| write!(svg, "{:.2},{:.2} ", p.x, p.y))?;
        svg.push_str("'/>");
    }
    write!(svg, "<polyline stroke='red' stroke-width='0.8' points='")?;
    for step in 0..=(duration_s * 4.0) as usize {
        let at = drive.pose(step as f64 * 0.25).translation;
        write!(svg, "{:.2},{:.2} ", at.x, at.y)?;
    }
    svg.push_str("'/>");
    Ok(svg)
}
