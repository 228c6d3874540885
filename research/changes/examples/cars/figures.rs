//! The shares of the cars that were found and of the changes that are right.

use std::fmt;

use gyre_changes::Change;

use crate::cars::{Car, SIGHT_M, centre};

/// A car that is paired with one change alone has its centre within this distance, m.
const PAIR_M: f64 = 3.0;
/// Bounds of the distances from the path at which recall is printed, m.
const BANDS_M: [f64; 4] = [0.0, 10.0, 20.0, SIGHT_M];

/// Cars and changes, and those that belong together.
#[derive(Clone, Debug, Default)]
pub struct Figures {
    /// Cars in sight that have come or gone, and those that were found, by their distance.
    wanted: [usize; BANDS_M.len() - 1],
    found: [usize; BANDS_M.len() - 1],
    /// Changes, and those that are changes of a car.
    changes: usize,
    right: usize,
    /// Cars in sight and changes that are paired one to one.
    paired: usize,
    /// The changes by their confidence in tenths from 0.5 on, and those that are right.
    confident: [[usize; 2]; 5],
}

impl Figures {
    pub fn of(cars: &[Car<'_>], found: &[Change]) -> Self {
        let mut figures = Self {
            changes: found.len(),
            paired: paired(cars, found),
            ..Self::default()
        };
        for car in cars.iter().filter(|car| car.is_in_sight) {
            let band = BANDS_M.windows(2).position(|band| car.away_m < band[1]);
            let band = band.unwrap_or(BANDS_M.len() - 2);
            figures.wanted[band] += 1;
            figures.found[band] += usize::from(found.iter().any(|change| car.is(change)));
        }
        for change in found {
            let is_right = cars.iter().any(|car| car.is(change));
            figures.right += usize::from(is_right);
            let tenth = ((10.0 * change.confidence) as usize).clamp(5, 9) - 5;
            figures.confident[tenth][0] += 1;
            figures.confident[tenth][1] += usize::from(is_right);
        }
        figures
    }

    pub fn add(&mut self, other: &Self) {
        let add = |sum: &mut [usize], more: &[usize]| {
            sum.iter_mut()
                .zip(more)
                .for_each(|(sum, more)| *sum += more);
        };
        add(&mut self.wanted, &other.wanted);
        add(&mut self.found, &other.found);
        self.changes += other.changes;
        self.right += other.right;
        self.paired += other.paired;
        add(
            self.confident.as_flattened_mut(),
            other.confident.as_flattened(),
        );
    }
}

/// Counts the cars in sight that are paired with a change of their own, the nearest ones first.
fn paired(cars: &[Car<'_>], found: &[Change]) -> usize {
    let mut pairs: Vec<(f64, usize, usize)> = Vec::new();
    for (c, car) in cars.iter().enumerate().filter(|(_, car)| car.is_in_sight) {
        for (f, change) in found.iter().enumerate() {
            let apart_m = (car.centre() - centre(change)).norm();
            if apart_m <= PAIR_M && car.kind == change.kind {
                pairs.push((apart_m, c, f));
            }
        }
    }
    pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut taken: Vec<(usize, usize)> = Vec::new();
    for (_, c, f) in pairs {
        if taken.iter().all(|(car, change)| *car != c && *change != f) {
            taken.push((c, f));
        }
    }
    taken.len()
}

impl fmt::Display for Figures {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let share = |part: usize, whole: usize| 100.0 * part as f64 / whole.max(1) as f64;
        let [wanted, found] = [&self.wanted, &self.found].map(|it| it.iter().sum::<usize>());
        write!(
            f,
            "recall {:.1} % ({found} of {wanted}), precision {:.1} % ({} of {}); one to one {:.1} %",
            share(found, wanted),
            share(self.right, self.changes),
            self.right,
            self.changes,
            share(self.paired, wanted)
        )?;
        for (band, (found, wanted)) in self.found.iter().zip(&self.wanted).enumerate() {
            let [from, to] = [BANDS_M[band], BANDS_M[band + 1]];
            write!(f, "; {from:.0}-{to:.0} m {found}/{wanted}")?;
        }
        let tenths = self.confident.map(|[all, right]| format!("{right}/{all}"));
        write!(f, "; by confidence from 0.5 on {}", tenths.join(" "))
    }
}
