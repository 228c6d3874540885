//! Draws streets, drive and a moment of traffic: `cargo run --release -p gyre-simulator --example plan -- OUT.svg [TRAJECTORY|- [SEED [left|right]]]`.

use std::fmt::Write as _;
use std::path::Path;

use gyre_simulator::streets::Keep;
use gyre_simulator::trajectory::recorded::{Excerpt, read};
use gyre_simulator::{BlockLoop, Streets, Trajectory};
use nalgebra::Point2;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let out = arguments.first().ok_or("usage: plan OUT.svg [TRAJECTORY|- [SEED [left|right]]]")?;
    let seed = arguments.get(2).map_or(Ok(1), |seed| seed.parse())?;
    let drive: Box<dyn Trajectory> = match arguments.get(1).filter(|path| *path != "-") {
        Some(path) => Box::new(read(Path::new(path), Excerpt::default())?),
        None => Box::new(BlockLoop::new(40.0, 32.0, 9.5, 5.0)),
    };
    let duration_s = drive.duration_s().min(60.0 * 60.0);
    let keep = if arguments.get(3).is_some_and(|keep| keep == "right") { Keep::Right } else { Keep::Left };
    let started = std::time::Instant::now();
    let streets = Streets::along(drive.as_ref(), duration_s, keep, seed);
    println!("{} streets in {:.3} s", streets.streets().len(), started.elapsed().as_secs_f64());
    std::fs::write(out, svg(drive.as_ref(), duration_s, &streets)?)?;
    Ok(())
}

fn svg(drive: &dyn Trajectory, duration_s: f64, streets: &Streets) -> Result<String, std::fmt::Error> {
    let points = || streets.streets().iter().flat_map(|street| &street.centre);
    let low = points().fold(Point2::new(f64::MAX, f64::MAX), |a, b| a.inf(b)) - nalgebra::Vector2::repeat(20.0);
    let size = points().fold(Point2::new(f64::MIN, f64::MIN), |a, b| a.sup(b)) - low + nalgebra::Vector2::repeat(20.0);
    let mut svg = format!(
        "<svg xmlns='http://www.w3.org/2000/svg' viewBox='{} {} {} {}'><g transform='scale(1,-1)' fill='none' stroke-linejoin='round'>",
        low.x,
        -low.y - size.y,
        size.x,
        size.y
    );
    write!(svg, "<rect x='{}' y='{}' width='{}' height='{}' fill='white'/>", low.x, low.y, size.x, size.y)?;
    for street in streets.streets() {
        let colour = if street.driven { "#888" } else { "#bbb" };
        write!(svg, "<polyline stroke='{colour}' stroke-width='{}' points='", 2.0 * street.half_width_m)?;
        street.centre.iter().try_for_each(|p| write!(svg, "{:.2},{:.2} ", p.x, p.y))?;
        svg.push_str("'/>");
    }
    write!(svg, "<polyline stroke='red' stroke-width='0.8' points='")?;
    for step in 0..=(duration_s * 4.0) as usize {
        let at = drive.pose(step as f64 * 0.25).translation;
        write!(svg, "{:.2},{:.2} ", at.x, at.y)?;
    }
    svg.push_str("'/></g></svg>");
    Ok(svg)
}
