//! Encoders of other sizes.

use std::f32::consts::TAU;
use std::path::Path;

use gyre_datasets::{Dataset, Format, open};

use super::{folder, options};
use crate::common::{PERIOD_US, START_US, Sweep, read, write_png};

fn write(root: &Path, scans: i64, sweep: &Sweep) {
    for k in 0..scans {
        let start = START_US + k * PERIOD_US;
        let sweep = Sweep { start, ..*sweep };
        sweep.write(&root.join(format!("navtech/{start}.png")));
    }
}

fn opened(root: &Path, format: Format) -> Box<dyn Dataset> {
    let options = options(|o| o.format = Some(format));
    open(&root.join("navtech"), &options).unwrap()
}

#[test]
fn the_size_of_an_encoder_is_that_with_which_a_turn_is_a_turn() {
    for (counts, step, first_count) in [
        (2800, 70, 5),
        (5595, 140, 5),
        (5600, 140, 139),
        (16_000, 400, 399),
    ] {
        let root = folder();
        // The last step is shorter than the others where the counts are no multiple.
        let rows = counts / usize::from(step) + usize::from(counts % usize::from(step) > 0);
        let sweep = Sweep {
            rows,
            step,
            first_count,
            counts,
            row_interval: PERIOD_US / rows as i64,
            ..Sweep::default()
        };
        write(root.path(), 3, &sweep);
        for format in [Format::Boreas, Format::Fomo, Format::Oxford] {
            let mut dataset = opened(root.path(), format);
            let taken = if counts == 5595 { 5600 } else { counts };
            assert_eq!(dataset.encoder_counts(), Some(taken as u16), "{format}");
            let notes = dataset.notes().join(" ");
            let said = notes.contains(&format!("{taken} counts per turn, not 5600"));
            assert_eq!(said, taken != 5600, "{format}: {notes}");
            let scan = read(dataset.as_mut(), 1).unwrap();
            for row in [0, 10] {
                let expected = f32::from(first_count + row * step) / taken as f32 * TAU;
                let found = scan.azimuth_rad[usize::from(row)];
                assert!((found - expected).abs() < 1e-6, "{format} {counts}");
            }
        }
    }
}

#[test]
fn half_a_turn_is_no_turn_of_a_smaller_encoder() {
    let root = folder();
    let sweep = Sweep {
        rows: 20,
        ..Sweep::default()
    };
    write(root.path(), 3, &sweep);
    let mut dataset = opened(root.path(), Format::Fomo);
    assert_eq!(dataset.encoder_counts(), Some(5600));
    let error = read(dataset.as_mut(), 1).unwrap_err().to_string();
    assert!(
        error.contains("no row is in 189 degrees of the turn"),
        "{error}"
    );
}

#[test]
fn a_blanked_sector_over_zero_makes_no_smaller_encoder() {
    // A turn may begin anywhere.
    for first_count in [0, 2800] {
        let root = folder();
        for k in 0..3 {
            let start = START_US + k * PERIOD_US;
            let sweep = Sweep {
                start,
                first_count,
                ..Sweep::default()
            };
            let (width, pixels) = (sweep.width(), sweep.pixels());
            let is_seen = |row: &&[u8]| {
                let count = u16::from_le_bytes([row[8], row[9]]);
                (280..5306).contains(&count)
            };
            let rows: Vec<_> = pixels.chunks(width).filter(is_seen).collect();
            let path = root.path().join(format!("navtech/{start}.png"));
            write_png(&path, width, rows.len(), &rows.concat());
        }
        for format in [Format::Boreas, Format::Fomo, Format::Oxford] {
            let mut dataset = opened(root.path(), format);
            assert_eq!(dataset.encoder_counts(), Some(5600), "{format}");
            let notes = dataset.notes().join(" ");
            assert!(notes.contains("by 700 from the last row"), "{notes}");
            let scan = read(dataset.as_mut(), 1).unwrap();
            let first = f32::from(first_count.max(280)) / 5600.0 * TAU;
            assert!((scan.azimuth_rad[0] - first).abs() < 1e-6, "{format}");
        }
    }
}
