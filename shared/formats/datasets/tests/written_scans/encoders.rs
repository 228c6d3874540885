//! Encoders of other sizes.

use std::f32::consts::TAU;
use std::path::Path;

use gyre_datasets::{Dataset, Format, open};

use super::{folder, options};
use crate::common::{PERIOD_US, START_US, Sweep, read};

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
