//! The radars and their receivers.

use std::f64::consts::PI;

use gyre_worlds::SimulatorError;
use gyre_worlds::profile::Profile;
use gyre_worlds::sensor::spectrum::counts;

use crate::exhibit::Exhibit;
use crate::picture::{BLACK, Frame, Picture};
use crate::scenes;
use crate::shot::Shot;

pub fn exhibits() -> Result<Vec<Exhibit>, SimulatorError> {
    Ok(vec![
        range_point_spread(),
        range_law(),
        quantisation(),
        profiles()?,
    ])
}

fn range_point_spread() -> Exhibit {
    let pairs = [(20.0, 0.0), (20.5, 0.0), (24.0, 0.0), (25.2, 0.0)]
        .map(|(range_m, side)| (range_m, PI / 2.0 + side));
    let shot = Shot::drawn(scenes::posts_at(pairs, 1.0));
    let picture = |profile: Profile| {
        let middle = (profile.sampling().azimuths / 4) as f64;
        let around = profile.sampling().azimuths as f64 / 100.0;
        let frame = Frame::polar(middle - around..middle + around, 17.0..29.0);
        frame.picture(&[shot.clone().with(profile).scan()])
    };
    Exhibit::of(
        "Range point spread",
        vec![
            ("Oxford's, 0.24 m", picture(Profile::Cts350xOxford)),
            ("Boreas', 0.33 m", picture(Profile::Cir204h)),
            ("K2Pi's, 0.75 m", picture(Profile::K2pi)),
        ],
    )
}

fn range_law() -> Exhibit {
    let ranges = [2.5, 5.0, 10.0, 20.0, 40.0, 80.0, 160.0];
    let places = ranges
        .into_iter()
        .enumerate()
        .map(|(i, range_m)| (range_m, (4.0 + 8.0 * i as f64) * PI / 200.0));
    let shot = Shot::drawn(scenes::posts_at(places, 10.0));
    let frame = Frame::polar(0.0..56.0, 0.0..165.0).shades(BLACK, 140.0);
    Exhibit::of(
        "Power against range",
        vec![("posts of 10 m²", frame.picture(&[shot.scan()]))],
    )
}

fn quantisation() -> Exhibit {
    let ramp = |whole: bool| {
        Picture::of((240, 60), |column, _| {
            let power = 10f32.powf(column as f32 / 240.0 * 1.5);
            f64::from(counts(power, 1e7, whole)) / 30.0
        })
    };
    Exhibit::of(
        "Quantisation",
        vec![
            ("RADIATE's, K2Pi's", ramp(false)),
            ("Oxford's, Boreas'", ramp(true)),
        ],
    )
}

fn profiles() -> Result<Exhibit, SimulatorError> {
    let strip = |name: &'static str, profile: Profile| {
        let shot = Shot::town(profile)?;
        let azimuths = profile.sampling().azimuths as f64;
        let frame = Frame::polar(0.0..azimuths, 0.0..profile.sampling().reach_m().min(165.0));
        Ok::<_, SimulatorError>((name, frame.shades(5.0, 110.0).picture(&[shot.scan()])))
    };
    Ok(Exhibit::of(
        "One street, five radars",
        vec![
            strip("cts350x-oxford", Profile::Cts350xOxford)?,
            strip("cts350x-radiate", Profile::Cts350xRadiate)?,
            strip("cir204h", Profile::Cir204h)?,
            strip("ras6", Profile::Ras6)?,
            strip("k2pi", Profile::K2pi)?,
        ],
    ))
}
