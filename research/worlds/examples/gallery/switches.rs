//! Each switch of `Effects`, off and on.

use std::f64::consts::PI;
use std::ops::Range;

use gyre_worlds::profile::Profile;
use gyre_worlds::{Body, SensorConfig};

use crate::exhibit::Exhibit;
use crate::picture::{BLACK, Frame, Picture};
use crate::scenes;
use crate::shot::Shot;

/// Number of scans that are searched for random events.
const SCANS: u64 = 50;

pub fn exhibits() -> Vec<Exhibit> {
    vec![
        sweep_motion(),
        doppler(),
        doppler_of_alternating_chirps(),
        encoder_wobble(),
        side_lobes(),
        elevation(),
        aspect(),
        highlights(),
        scintillation(),
        occlusion(),
        multipath(),
        speckle(),
        phase_noise(),
        reverberation(),
        ringing(),
        own_vehicle(),
        ground(),
        noise(),
        spurious_lines(),
        interference(),
        dropped_azimuths(),
    ]
}

fn sweep_motion() -> Exhibit {
    let shot = Shot::drawn(scenes::courtyard(30.0)).driving(15.0, 1.2);
    Exhibit::switched("Motion within a sweep", &shot, &Frame::map(45.0), |e| {
        &mut e.sweep_motion
    })
}

fn doppler() -> Exhibit {
    let shot = Shot::drawn(scenes::ring(30.0, 250, 4.0)).driving(25.0, 0.0);
    let frame = Frame::polar(0.0..400.0, 27.0..33.0);
    Exhibit::switched("Doppler", &shot, &frame, |e| &mut e.doppler)
}

fn doppler_of_alternating_chirps() -> Exhibit {
    let shot = Shot::drawn(scenes::ring(30.0, 250, 4.0))
        .driving(25.0, 0.0)
        .with(Profile::Ras6);
    let frame = Frame::polar(-15.0..15.0, 27.0..33.0).shades(20.0, 110.0);
    Exhibit::switched("Doppler of alternating chirps", &shot, &frame, |e| {
        &mut e.doppler
    })
}

fn encoder_wobble() -> Exhibit {
    let behind = [(12.0, 0.0), (20.0, 0.06), (28.0, -0.06), (36.0, 0.0)]
        .map(|(range_m, side)| (range_m, PI + side));
    let mut shot = Shot::drawn(scenes::posts_at(behind, 50.0));
    shot.sensor = SensorConfig {
        azimuth_eccentricity_rad: 0.05,
        ..shot.sensor
    };
    let frame = Frame::polar(185.0..215.0, 8.0..40.0);
    Exhibit::switched("Encoder wobble", &shot, &frame, |e| &mut e.encoder_wobble)
}

fn side_lobes() -> Exhibit {
    let shot = Shot::drawn(scenes::posts_at([(40.0, PI / 2.0)], 2000.0));
    let frame = Frame::polar(78.0..118.0, 35.0..45.0).shades(0.0, 120.0);
    Exhibit::switched("Side lobes", &shot, &frame, |e| &mut e.side_lobes)
}

fn elevation() -> Exhibit {
    let mut posts = scenes::lattice(3.0, 21.0, 0.1);
    posts.extend(scenes::ring(15.0, 8, 20.0));
    let shot = Shot::drawn(posts);
    let frame = Frame::map(22.0).shades(30.0, 90.0);
    Exhibit::switched("Beam height and pitch", &shot, &frame, |e| &mut e.elevation)
}

fn aspect() -> Exhibit {
    let shot = Shot::drawn(scenes::panels(14.0, 60.0));
    Exhibit::switched("Aspect", &shot, &Frame::map(45.0), |e| &mut e.aspect)
}

fn highlights() -> Exhibit {
    /// Scans during which the car drives 15 m.
    const LATER: u64 = 4;
    let shot = Shot::drawn(scenes::glass_front()).driving(15.0, 0.0);
    let frame = Frame::map(32.0);
    let picture = |on, index| {
        let shot = shot.with_effects(|effects| effects.highlights = on);
        frame.picture(&[Shot { index, ..shot }.scan()])
    };
    let pictures = vec![
        ("off", picture(false, 0)),
        ("off, 15 m on", picture(false, LATER)),
        ("on", picture(true, 0)),
        ("on, 15 m on", picture(true, LATER)),
    ];
    Exhibit::of("Highlights", pictures)
}

fn scintillation() -> Exhibit {
    const SCANS: usize = 140;
    const METRES: Range<f64> = 4.0..28.0;
    // Of nearly equal power.
    let post = |y: f64| scenes::post(8.75, y, 0.02 * y * y);
    let posts = [6.0, 10.0, 14.0, 18.0, 22.0].map(post).to_vec();
    let body = Body::of(posts);
    let shot = Shot::drawn(body).driving(0.5, 0.0);
    Exhibit::off_and_on("Scintillation", |on| {
        let shot = shot.with_effects(|effects| effects.scintillation = on);
        let (scans, sampling) = (shot.scans(SCANS as u64), shot.sensor.sampling());
        let bin = |column: usize| {
            sampling
                .bin(METRES.start + (METRES.end - METRES.start) * column as f64 / 240.0)
                .max(0.0) as usize
        };
        Picture::of((240, SCANS), |column, row| {
            // The posts are on the left.
            let rows = (200..400)
                .map(|azimuth| &scans[row].view().row(azimuth)[bin(column)..=bin(column + 1)]);
            (f64::from(rows.flatten().copied().max().unwrap_or_default()) - 80.0) / 45.0
        })
    })
}

fn occlusion() -> Exhibit {
    let shot = Shot::drawn(scenes::walls_among_posts());
    Exhibit::switched("Occlusion", &shot, &Frame::map(45.0), |e| &mut e.occlusion)
}

fn multipath() -> Exhibit {
    let mut shot = Shot::drawn(scenes::metal_wall());
    shot.effects.occlusion = true;
    Exhibit::switched("Multipath ghosts", &shot, &Frame::map(32.0), |e| {
        &mut e.multipath
    })
}

fn speckle() -> Exhibit {
    let shot = Shot::drawn(scenes::scattered(19.6..20.4, 8000, 0.005));
    let frame = Frame::polar(70.0..130.0, 17.0..23.0).shades(20.0, 100.0);
    Exhibit::switched("Speckle", &shot, &frame, |e| &mut e.speckle)
}

fn phase_noise() -> Exhibit {
    let shot = Shot::drawn(scenes::posts_at(
        [(30.0, PI / 2.0), (60.0, PI / 2.0 + 0.2)],
        3000.0,
    ));
    let frame = Frame::polar(70.0..140.0, 0.0..165.0).shades(0.0, 80.0);
    Exhibit::switched("Phase noise", &shot, &frame, |e| &mut e.phase_noise)
}

fn reverberation() -> Exhibit {
    let mut front = scenes::rough_wall((15.0, -12.0), (15.0, 12.0), 6.0);
    front.extend(scenes::posts_at([(25.0, 0.9), (30.0, -0.9)], 300.0));
    let mut shot = Shot::drawn(front);
    shot.effects.speckle = true;
    let frame = Frame::polar(-80.0..80.0, 0.0..120.0).shades(0.0, 80.0);
    Exhibit::switched("Reverberation", &shot, &frame, |e| &mut e.reverberation)
}

fn ringing() -> Exhibit {
    let shot = Shot::drawn(Body::default());
    let frame = Frame::polar(0.0..400.0, 0.0..10.0).shades(0.0, 60.0);
    Exhibit::switched("Ringing", &shot, &frame, |e| &mut e.ringing)
}

fn own_vehicle() -> Exhibit {
    let shot = Shot::drawn(Body::default());
    let frame = Frame::map(9.0).shades(0.0, 80.0);
    Exhibit::switched("Own vehicle", &shot, &frame, |e| &mut e.own_vehicle)
}

fn ground() -> Exhibit {
    let mut front = scenes::rough_wall((3.0, -20.0), (15.0, -20.0), 1.0);
    front
        .walls
        .push(scenes::wall((3.0, -20.0), (15.0, -20.0), 1e-4, 0.0));
    let shot = Shot::drawn(front);
    let frame = Frame::map(40.0).shades(2.0, 22.0);
    let picture = |ground, occlusion| {
        let shot = shot.with_effects(|effects| {
            (effects.ground, effects.occlusion) = (ground, occlusion);
        });
        frame.picture(&shot.scans(16))
    };
    let pictures = vec![
        ("off", picture(false, true)),
        ("on", picture(true, true)),
        ("on, occlusion off", picture(true, false)),
    ];
    Exhibit::of("Ground", pictures)
}

fn noise() -> Exhibit {
    let shot = Shot::drawn(scenes::lattice(8.0, 56.0, 0.03));
    let frame = Frame::map(60.0).shades(2.0, 50.0);
    Exhibit::switched("Noise", &shot, &frame, |e| &mut e.noise)
}

fn spurious_lines() -> Exhibit {
    let shot = Shot::drawn(Body::default());
    let frame = Frame::polar(0.0..400.0, 50.0..70.0).shades(0.0, 18.0);
    Exhibit::off_and_on("Spurious lines", |on| {
        let shot = shot.with_effects(|effects| effects.spurious_lines = on);
        frame.picture(&shot.scans(16))
    })
}

fn interference() -> Exhibit {
    let shot = Shot::drawn(scenes::lattice(12.0, 90.0, 10.0));
    let scan = |index, on| {
        let shot = shot.with_effects(|effects| effects.interference = on);
        Shot { index, ..shot }.scan()
    };
    // The first scan with a burst, and its azimuth.
    let interfered = |index| {
        let (off, on) = (scan(index, false), scan(index, true));
        let differs = |azimuth: &usize| off.view().row(*azimuth) != on.view().row(*azimuth);
        Some((index, (0..400).find(differs)?))
    };
    let (index, azimuth) = (0..SCANS).find_map(interfered).unwrap_or_default();
    let first = azimuth as f64 - 25.0;
    let frame = Frame::polar(first..first + 56.0, 0.0..165.0).shades(BLACK, 60.0);
    let shot = Shot { index, ..shot };
    Exhibit::switched("Interference", &shot, &frame, |e| &mut e.interference)
}

fn dropped_azimuths() -> Exhibit {
    let shot = Shot::drawn(scenes::scattered(15.0..24.0, 400, 0.5));
    let scan = |index, on| {
        let shot = shot.with_effects(|effects| effects.dropped_azimuths = on);
        Shot { index, ..shot }.scan()
    };
    // The first scan with a lost azimuth, and its index.
    let lost = |index| {
        let scan = scan(index, true);
        Some((index, scan.flags.iter().position(|flags| *flags == 0)?))
    };
    let (index, azimuth) = (0..SCANS).find_map(lost).unwrap_or_default();
    let first = azimuth as f64 - 6.0;
    let frame = Frame::polar(first..first + 12.0, 15.0..24.0);
    Exhibit::off_and_on("Dropped azimuths", |on| {
        let scan = scan(index, on);
        frame
            .picture(std::slice::from_ref(&scan))
            .with_margin(|row| scan.flags[first as usize + row * 12 / frame.size.1] != 0)
    })
}
