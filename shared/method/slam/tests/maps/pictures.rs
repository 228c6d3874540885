//! Maps as one picture.

use std::io::Cursor;

use gyre_geometry::{Pose, pose};
use gyre_slam::mapping::*;
use nalgebra::Point2;

use crate::{common::assert_refused, maps::scenes::*};

struct Picture {
    width: u32,
    height: u32,
    pixels: Vec<[u8; 3]>,
}

impl Picture {
    fn of(evidence: &mut Evidence, overlay: &Overlay<'_>) -> Self {
        let bytes = map_png(evidence, overlay).unwrap();
        let mut reader = png::Decoder::new(Cursor::new(bytes)).read_info().unwrap();
        let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
        let frame = reader.next_frame(&mut pixels).unwrap();
        Self {
            width: frame.width,
            height: frame.height,
            pixels: pixels.as_chunks::<3>().0.to_vec(),
        }
    }

    fn count(&self, is_it: impl Fn([u8; 3]) -> bool) -> usize {
        self.pixels.iter().filter(|pixel| is_it(**pixel)).count()
    }
}

// Edges of lines are paler.
fn is_blue([red, _, blue]: [u8; 3]) -> bool {
    blue > 180 && red < 140
}

fn is_red([red, green, blue]: [u8; 3]) -> bool {
    red > 180 && green < 80 && blue > 100
}

fn poses(drive: &[(Pose, gyre_slam::Keyframe)]) -> Vec<Pose> {
    drive.iter().map(|(pose, _)| *pose).collect()
}

#[test]
fn a_picture_has_the_trajectory_and_its_loops_in_it() {
    let drive = drive(20, &wall());
    let poses = poses(&drive);
    let with_trajectory = Overlay {
        trajectory: &[&poses],
        ..Overlay::default()
    };
    let loops = [[Point2::new(0.0, -8.0), Point2::new(0.0, 8.0)]];
    let with_loops = Overlay {
        loops: &loops,
        ..with_trajectory
    };
    let picture = |overlay: &Overlay<'_>| Picture::of(&mut drawn(&drive), overlay);
    let plain = picture(&Overlay::default());
    assert_eq!((plain.count(is_blue), plain.count(is_red)), (0, 0));
    let plain = picture(&with_trajectory);
    assert!(plain.count(is_blue) > 100);
    assert_eq!(plain.count(is_red), 0);
    // 80 pixels of 0.2 m.
    let closed = picture(&with_loops);
    assert!(closed.count(is_red) > 30, "{}", closed.count(is_red));
    assert!(closed.count(is_blue) > 100, "{}", closed.count(is_blue));
}

#[test]
fn the_cells_of_a_legible_picture_grow_with_the_drive() {
    let cell_m = |length_m: f64| {
        let ends = [pose(0.0, 0.0, 0.0), pose(0.0, length_m, 0.0)];
        legible(MapOptions::default(), &ends).cell_m
    };
    assert_eq!(
        [0.0, 249.0, 251.0, 6e3, 1e6].map(cell_m),
        [0.2, 0.2, 0.4, 3.2, 3.2]
    );
    assert_eq!(legible(MapOptions::default(), &[]).cell_m, 0.2);
    let lost = [pose(0.0, 0.0, 0.0), pose(f64::NAN, 0.0, 0.0)];
    assert_eq!(legible(MapOptions::default(), &lost).cell_m, 0.2);
}

fn far(length_m: f64) -> Evidence {
    let ends = [pose(0.0, 0.0, 0.0), pose(length_m, -length_m, 0.0)];
    let options = legible(MapOptions::default(), &ends);
    let seen = |seq| keyframe(seq, &pose(0.0, 0.0, 0.0), &wall());
    drawn_with(&options, &[(ends[0], seen(0)), (ends[1], seen(1))])
}

#[test]
fn a_drive_of_a_thousand_kilometres_is_a_picture_of_bounded_size() {
    let picture = Picture::of(&mut far(1e6), &Overlay::default());
    assert!((2000..=4096).contains(&picture.width), "{}", picture.width);
    assert!(
        (2000..=4300).contains(&picture.height),
        "{}",
        picture.height
    );
}

#[test]
fn a_drive_round_the_world_is_refused_with_what_to_do() {
    for length_m in [4e7, 1e15] {
        let refused = map_png(&mut far(length_m), &Overlay::default());
        assert_refused(refused, "too many for a picture: choose larger cells");
    }
}
