//! Each switch of `Effects`, off and on.

use std::f64::consts::PI;
use std::ops::Range;

use gyre_simulator::profile::Profile;
use gyre_simulator::{Body, Effects, SensorConfig};

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
    Exhibit::switched(("Motion within a sweep", "sweep_motion"), &shot, &Frame::map(45.0), |e| &mut e.sweep_motion)
        .words(
            "A square courtyard from a car that drives at 15 m/s and turns left at 1.2 rad/s: each azimuth is measured from its own \
             pose, so the square is distorted and does not close ahead, where the sweep begins and ends.",
            "Burnett, Schoellig and Barfoot 2021, on motion distortion of spinning radars",
        )
}

fn doppler() -> Exhibit {
    let shot = Shot::drawn(scenes::ring(30.0, 250, 4.0)).driving(25.0, 0.0);
    let frame = Frame::polar(0.0..400.0, 27.0..33.0);
    Exhibit::switched(("Doppler", "doppler"), &shot, &frame, |e| &mut e.doppler).words(
        "A ring of posts 30 m around a car at 25 m/s, azimuths from ahead (top) to the right, behind and the left: posts \
         ahead are measured 1 m too near, posts behind 1 m too far. (All azimuths are measured from one place.)",
        "Burnett, Schoellig and Barfoot 2021; the factor is the radar's carrier frequency over its sweep rate",
    )
}

fn doppler_of_alternating_chirps() -> Exhibit {
    let shot = Shot::drawn(scenes::ring(30.0, 250, 4.0))
        .driving(25.0, 0.0)
        .with(Profile::Ras6);
    let frame = Frame::polar(-15.0..15.0, 27.0..33.0).shades(20.0, 110.0);
    Exhibit::switched(("Doppler of alternating chirps", "doppler"), &shot, &frame, |e| &mut e.doppler).words(
        "The same ahead, by a RAS6: its rising and falling chirps alternate, and so does the shift, which reveals the car's speed.",
        "the format of Boreas-RT's and FoMo's recordings",
    )
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
    Exhibit::switched(("Encoder wobble", "encoder_wobble"), &shot, &frame, |e| &mut e.encoder_wobble).words(
        "Posts behind the car, 30 azimuths of the sweep: the eccentricity of the encoder is 0.05 rad (far more than in any recording), \
         so all appear three azimuths from their true places; and its counts jitter.",
        "the first harmonic of an encoder's error, 0.0025 rad on RADIATE's radar; `dataset.azimuth_eccentricity_rad` corrects it",
    )
}

fn side_lobes() -> Exhibit {
    let shot = Shot::drawn(scenes::posts_at([(40.0, PI / 2.0)], 2000.0));
    let frame = Frame::polar(78.0..118.0, 35.0..45.0).shades(0.0, 120.0);
    Exhibit::switched(("Side lobes", "side_lobes"), &shot, &frame, |e| &mut e.side_lobes).words(
        "A corner reflector of 2000 m² at 40 m, 40 azimuths around it: side lobes show it at decreasing power.",
        "the envelope next to isolated strong echoes in Oxford's, RADIATE's and Boreas-RT's scans",
    )
}

fn elevation() -> Exhibit {
    let mut posts = scenes::lattice(3.0, 21.0, 0.1);
    posts.extend(scenes::ring(15.0, 8, 20.0));
    let shot = Shot::drawn(posts);
    let frame = Frame::map(22.0).shades(30.0, 90.0);
    Exhibit::switched(("Beam height and pitch", "elevation"), &shot, &frame, |e| &mut e.elevation).words(
        "Faint posts 3 m apart, and eight strong ones around the car: the beam has a height of a few degrees and the car pitches and rolls, so near \
         scatterers are illuminated by chance. Strong ones are vertical lines, which are always illuminated at some height.",
        "the data sheet's 1.8 degrees, widened downwards; changes between consecutive real scans",
    )
}

fn aspect() -> Exhibit {
    let shot = Shot::drawn(scenes::panels(14.0, 60.0));
    Exhibit::switched(("Aspect", "aspect"), &shot, &Frame::map(45.0), |e| &mut e.aspect).words(
        "A wall of smooth panels on the left: it flashes at normal incidence and reflects past the sensor elsewhere.",
        "a power of the cosine about the surface's normal (Phong 1975), as for specular and rough facets in radar",
    )
}

fn highlights() -> Exhibit {
    /// Scans during which the car drives 15 m.
    const LATER: u64 = 4;
    let shot = Shot::drawn(scenes::glass_front()).driving(15.0, 0.0);
    let frame = Frame::map(32.0);
    let picture = |highlights, index| {
        let effects = Effects {
            highlights,
            ..shot.effects
        };
        frame.picture(&[Shot {
            effects,
            index,
            ..shot.clone()
        }
        .scan()])
    };
    let pictures = vec![
        ("off", picture(false, 0)),
        ("off, 15 m on", picture(false, LATER)),
        ("on", picture(true, 0)),
        ("on, 15 m on", picture(true, LATER)),
    ];
    Exhibit::of("Highlights", pictures).switch("highlights").words(
        "A glass front along the left side, with three posts in front of it, from two places 15 m apart: the posts stay behind, but the specular \
         reflection at normal incidence has moved along with the radar.",
        "Knott, Shaeffer and Tuley, Radar Cross Section, on large flat plates; the smoothness of walls is assumed",
    )
}

fn scintillation() -> Exhibit {
    const SCANS: usize = 140;
    const METRES: Range<f64> = 4.0..28.0;
    // Of nearly equal power.
    let post = |y: f64| scenes::post(8.75, y, 0.02 * y * y);
    let posts = [6.0, 10.0, 14.0, 18.0, 22.0].map(post).to_vec();
    let mut shot = Shot::drawn(Body {
        scatterers: posts,
        walls: vec![],
    })
    .driving(0.5, 0.0);
    let mut picture = |on| {
        shot.effects.scintillation = on;
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
    };
    let pictures = vec![("off", picture(false)), ("on", picture(true))];
    Exhibit::of("Scintillation", pictures).switch("scintillation").words(
        "Five posts to the left, passed at 0.5 m/s: a row for each of 140 scans, range to the right. A post is some wavelengths large and \
         has lobes, so its echo fluctuates, faster at short range.",
        "Swerling 1960, Probability of Detection for Fluctuating Targets (case 1); changes between consecutive real scans",
    )
}

fn occlusion() -> Exhibit {
    let shot = Shot::drawn(scenes::walls_among_posts());
    Exhibit::switched(("Occlusion", "occlusion"), &shot, &Frame::map(45.0), |e| &mut e.occlusion).words(
        "Two walls among posts: they cast shadows. Each wall has its own transmission, here -40 dB.",
        "ITU-R P.2040 for the transmission of building materials",
    )
}

fn multipath() -> Exhibit {
    let mut shot = Shot::drawn(scenes::metal_wall());
    shot.effects.occlusion = true;
    Exhibit::switched(("Multipath ghosts", "multipath"), &shot, &Frame::map(32.0), |e| &mut e.multipath).words(
        "A sheet of metal on the left with three posts in front of it: each has a mirror image behind the sheet, a ghost target.",
        "image theory; Kraus et al. 2020 on ghosts of automotive radars; ITU-R P.2040 for the reflection of facades",
    )
}

fn speckle() -> Exhibit {
    let shot = Shot::drawn(scenes::scattered(19.6..20.4, 8000, 0.005));
    let frame = Frame::polar(70.0..130.0, 17.0..23.0).shades(20.0, 100.0);
    Exhibit::switched(("Speckle", "speckle"), &shot, &frame, |e| &mut e.speckle).words(
        "A rough curved wall around the sensor, with many scatterers in each resolution cell: their echoes interfere.",
        "Goodman 2007 (fully developed speckle: powers exponentially distributed)",
    )
}

fn phase_noise() -> Exhibit {
    let shot = Shot::drawn(scenes::posts_at(
        [(30.0, PI / 2.0), (60.0, PI / 2.0 + 0.2)],
        3000.0,
    ));
    let frame = Frame::polar(70.0..140.0, 0.0..165.0).shades(0.0, 80.0);
    Exhibit::switched(("Phase noise", "phase_noise"), &shot, &frame, |e| &mut e.phase_noise).words(
        "Two corner reflectors: each raises the noise of its whole azimuth, 60 dB below itself and more next to it. In a town this appears as streaks.",
        "the lower fifth of an azimuth's powers against their sum, in Oxford's and RADIATE's scans",
    )
}

fn reverberation() -> Exhibit {
    let mut front = scenes::rough_wall((15.0, -12.0), (15.0, 12.0), 6.0);
    front.extend(scenes::posts_at([(25.0, 0.9), (30.0, -0.9)], 300.0));
    let mut shot = Shot::drawn(front);
    shot.effects.speckle = true;
    let frame = Frame::polar(-80.0..80.0, 0.0..120.0).shades(0.0, 80.0);
    Exhibit::switched(("Reverberation", "reverberation"), &shot, &frame, |e| &mut e.reverberation).words(
        "A front ahead and a strong post to either side: multiple reflections between houses leave a tail behind strong echoes, which differs \
         between directions.",
        "mean power behind fronts and down streets in Oxford's and RADIATE's scans",
    )
}

fn ringing() -> Exhibit {
    let shot = Shot::drawn(Body::default());
    let frame = Frame::polar(0.0..400.0, 0.0..10.0).shades(0.0, 60.0);
    Exhibit::switched(("Ringing", "ringing"), &shot, &frame, |e| &mut e.ringing).words(
        "The first 10 m of an empty world: the transmitter rings in the first three, similarly in neighbouring azimuths and identically in every scan.",
        "mean power of the first bins of real scans, profile by profile",
    )
}

fn own_vehicle() -> Exhibit {
    let shot = Shot::drawn(Body::default());
    let frame = Frame::map(9.0).shades(0.0, 80.0);
    Exhibit::switched(("Own vehicle", "own_vehicle"), &shot, &frame, |e| &mut e.own_vehicle).words(
        "The first 9 m of an empty world: roof rails, racks and the tail of the vehicle, behind the radar.",
        "echoes that are constant in all scans of a real drive",
    )
}

fn ground() -> Exhibit {
    let mut front = scenes::rough_wall((3.0, -20.0), (15.0, -20.0), 1.0);
    front
        .walls
        .push(scenes::wall((3.0, -20.0), (15.0, -20.0), 1e-4, 0.0));
    let shot = Shot::drawn(front);
    let frame = Frame::map(40.0).shades(2.0, 22.0);
    let picture = |ground, occlusion| {
        let effects = Effects {
            ground,
            occlusion,
            ..shot.effects
        };
        frame.picture(
            &Shot {
                effects,
                ..shot.clone()
            }
            .scans(16),
        )
    };
    let pictures = vec![
        ("off", picture(false, true)),
        ("on", picture(true, true)),
        ("on, occlusion off", picture(true, false)),
    ];
    Exhibit::of("Ground", pictures).switch("ground").words(
        "The mean of 16 scans of open country with one front, to the right: road, verges and fields scatter back weakly, in fixed \
         patches; none from behind the front, unless occlusion is off.",
        "diffuse power between echoes in Oxford's and RADIATE's scans; the size of patches is assumed",
    )
}

fn noise() -> Exhibit {
    let shot = Shot::drawn(scenes::lattice(8.0, 56.0, 0.03));
    let frame = Frame::map(60.0).shades(2.0, 50.0);
    Exhibit::switched(("Noise", "noise"), &shot, &frame, |e| &mut e.noise).words(
        "Posts 8 m apart: the receiver's noise is everywhere and masks the faint ones.",
        "powers of empty azimuths in Oxford's, RADIATE's and Boreas-RT's scans",
    )
}

fn spurious_lines() -> Exhibit {
    let mut shot = Shot::drawn(Body::default());
    let frame = Frame::polar(0.0..400.0, 50.0..70.0).shades(0.0, 18.0);
    let mut picture = |on| {
        shot.effects.spurious_lines = on;
        frame.picture(&shot.scans(16))
    };
    let pictures = vec![("off", picture(false)), ("on", picture(true))];
    Exhibit::of("Spurious lines", pictures).switch("spurious_lines").words(
        "The mean of 16 scans of an empty world, 50 to 70 m: clocks and power supplies in the radar cause a faint line at a fixed range.",
        "common in FMCW receivers; number, ranges and powers are assumed",
    )
}

fn interference() -> Exhibit {
    let shot = Shot::drawn(scenes::lattice(12.0, 90.0, 10.0));
    let scan = |index, interference| {
        Shot {
            index,
            effects: Effects {
                interference,
                ..shot.effects
            },
            ..shot.clone()
        }
        .scan()
    };
    // The first scan with a burst, and its azimuth.
    let interfered = |index| {
        let (off, on) = (scan(index, false), scan(index, true));
        Some((
            index,
            (0..400).find(|azimuth| off.view().row(*azimuth) != on.view().row(*azimuth))?,
        ))
    };
    let (index, azimuth) = (0..SCANS).find_map(interfered).unwrap_or_default();
    let first = azimuth as f64 - 25.0;
    let frame = Frame::polar(first..first + 56.0, 0.0..165.0).shades(BLACK, 60.0);
    let shot = Shot { index, ..shot };
    Exhibit::switched(("Interference", "interference"), &shot, &frame, |e| &mut e.interference).words(
        "56 azimuths of a sweep in which another radar interferes, as in about every second sweep: it raises the noise of one to four azimuths.",
        "Brooker 2007, Mutual Interference of Millimeter-Wave Radar Systems; frequency and power are assumed",
    )
}

fn dropped_azimuths() -> Exhibit {
    let shot = Shot::drawn(scenes::scattered(15.0..24.0, 400, 0.5));
    let scan = |index, dropped_azimuths| {
        Shot {
            index,
            effects: Effects {
                dropped_azimuths,
                ..shot.effects
            },
            ..shot.clone()
        }
        .scan()
    };
    // The first scan with a lost azimuth, and its index.
    let lost = |index| {
        Some((
            index,
            scan(index, true)
                .flags
                .iter()
                .position(|flags| *flags == 0)?,
        ))
    };
    let (index, azimuth) = (0..SCANS).find_map(lost).unwrap_or_default();
    let first = azimuth as f64 - 6.0;
    let frame = Frame::polar(first..first + 12.0, 15.0..24.0);
    let picture = |dropped| {
        let scan = scan(index, dropped);
        frame
            .picture(std::slice::from_ref(&scan))
            .with_margin(|row| scan.flags[first as usize + row * 12 / frame.size.1] != 0)
    };
    Exhibit::of("Dropped azimuths", vec![("off", picture(false)), ("on", picture(true))]).switch("dropped_azimuths").words(
        "12 azimuths of a field of posts; the strip at the left is white where they were measured. One is lost, replaced by the mean of its \
         neighbours, and marked.",
        "the validity byte of Oxford's format; the frequency is assumed",
    )
}
