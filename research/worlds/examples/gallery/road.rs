//! The effects of a real road, which `simulation.realism` switches on.

use std::f64::consts::PI;
use std::sync::Arc;

use gyre_worlds::profile::Profile;
use gyre_worlds::{Body, Effects, Relief, SimulationConfig, Simulator, SimulatorError, World};

use crate::exhibit::Exhibit;
use crate::picture::{Frame, Picture};
use crate::scenes;
use crate::shot::Shot;

/// Scans that are shown in rows.
const SCANS: usize = 140;

pub fn exhibits() -> Result<Vec<Exhibit>, SimulatorError> {
    Ok(vec![
        hills(),
        slant_range(),
        sway(),
        one_bounce(),
        vibration(),
        dirt(),
        miscalibration(),
        belts()?,
    ])
}

/// Pictures of an effect off and on.
fn switched(
    title: &'static str,
    shot: &Shot,
    frame: &Frame,
    switch: fn(&mut Effects) -> &mut Option<bool>,
) -> Exhibit {
    Exhibit::off_and_on(title, |on| {
        let shot = shot.with_effects(|effects| *switch(effects) = Some(on));
        frame.picture(&[shot.scan()])
    })
}

fn hills() -> Exhibit {
    let posts = || scenes::lattice(8.0, 60.0, 0.05);
    let mut shot = Shot::drawn(posts());
    (shot.effects.ground, shot.effects.elevation) = (true, true);
    let frame = Frame::map(64.0).shades(2.0, 30.0);
    Exhibit::off_and_on("Hills", |on| {
        let relief = if on { Relief::hills(11) } else { Relief::LEVEL };
        let world = Arc::new(World::new(posts()).on(relief));
        let shot = Shot {
            world,
            ..shot.clone()
        };
        frame.picture(&shot.scans(16))
    })
}

fn slant_range() -> Exhibit {
    let shot = Shot::drawn(scenes::ring(5.0, 250, 0.2));
    let frame = Frame::polar(0.0..100.0, 4.0..7.0);
    switched("Slant range", &shot, &frame, |e| &mut e.slant_range)
}

/// The power of a post in each scan, downwards, by azimuth or range.
fn scan_by_scan(shot: &Shot, frame: &Frame) -> Picture {
    let rows: Vec<Picture> = shot
        .scans(SCANS as u64)
        .iter()
        .map(|scan| frame.picture(std::slice::from_ref(scan)))
        .collect();
    Picture::stacked(&rows)
}

fn sway() -> Exhibit {
    let posts = [8.0, 12.0, 16.0, 20.0, 24.0].map(|y: f64| scenes::post(0.0, y, 1e-3 * y * y));
    let shot = Shot::drawn(Body::of(posts.to_vec()));
    let frame = Frame {
        size: (240, 1),
        ..Frame::polar(298.0..300.0, 4.0..28.0).shades(40.0, 110.0)
    };
    Exhibit::off_and_on("Swaying leaves", |on| {
        scan_by_scan(&shot.with_effects(|e| e.sway = Some(on)), &frame)
    })
}

fn one_bounce() -> Exhibit {
    let (from, to) = ((4.0, 6.0), (60.0, 6.0));
    let mut scene = scenes::rough_wall(from, to, 0.002);
    scene.walls.push(scenes::wall(from, to, 1e-4, 0.9));
    let posts = [14.0, 22.0, 30.0, 38.0].map(|x| scenes::post(x, 5.0, 3000.0));
    scene.scatterers.extend(posts);
    let mut shot = Shot::drawn(scene);
    shot.effects.side_lobes = true;
    let frame = Frame::polar(360.0..400.0, 8.0..44.0).shades(20.0, 120.0);
    switched("One bounce", &shot, &frame, |e| &mut e.one_bounce)
}

fn vibration() -> Exhibit {
    let mut shot = Shot::drawn(scenes::posts_at([(20.0, PI / 2.0)], 20.0));
    shot.effects.noise = false;
    // Beside the post, where power falls most steeply.
    let frame = Frame {
        size: (240, 1),
        ..Frame::polar(98.0..99.0, 19.0..21.0).shades(60.0, 105.0)
    };
    Exhibit::off_and_on("Vibrating mount", |on| {
        scan_by_scan(&shot.with_effects(|e| e.vibration = Some(on)), &frame)
    })
}

fn dirt() -> Exhibit {
    let shot = Shot::drawn(scenes::ring(20.0, 400, 3.0));
    let frame = Frame::polar(0.0..400.0, 18.0..22.0).shades(80.0, 110.0);
    switched("Dirty radome", &shot, &frame, |e| &mut e.dirt)
}

fn miscalibration() -> Exhibit {
    let shot = Shot::drawn(scenes::ring(50.0, 100, 30.0));
    let frame = Frame::polar(0.0..400.0, 48.0..52.0);
    switched("Miscalibration", &shot, &frame, |e| &mut e.miscalibration)
}

fn belts() -> Result<Exhibit, SimulatorError> {
    let picture = |belts| -> Result<Picture, SimulatorError> {
        let mut config = SimulationConfig::default();
        config.town.belts = Some(belts);
        config.sensor.profile = Profile::Cts350xRadiate;
        let scan = Simulator::new(&config)?.render_scan(8).scan;
        Ok(Frame::map(70.0).shades(18.0, 90.0).picture(&[scan]))
    };
    let pictures = vec![("none", picture(0.0)?), ("all along", picture(1.0)?)];
    Ok(Exhibit::of("Belts", pictures))
}
