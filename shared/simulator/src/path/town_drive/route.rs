//! Which junctions a drive passes, one after the other.

use std::collections::VecDeque;
use std::collections::btree_map::{BTreeMap, Entry};

use rand::Rng;

use super::plan::Plan;

/// Share of the length after which the drive first returns to its start.
const FIRST_TOUR: f64 = 0.4;
/// Streets that are driven again after a return, and streets that are driven back.
const REPEATED: usize = 2;

/// Junctions of a drive of `length_m` or somewhat more, without turning round on the spot. It returns to its start at 40 %
/// of its length, drives its first streets again, later some of them in the opposite direction, and comes home at the end.
pub fn route(plan: &Plan, length_m: f64, rng: &mut impl Rng) -> Vec<usize> {
    let start = plan.junctions.len() / 2;
    let first = plan.neighbours[start][rng.random_range(0..plan.neighbours[start].len())];
    let mut drive = Drive {
        plan,
        passed: vec![start, first],
        length_m: plan.distance_m(start, first),
    };
    drive.tour(FIRST_TOUR * length_m, rng);
    drive.home();
    drive.drive_back();
    drive.tour(length_m, rng);
    drive.home();
    while drive.length_m < length_m + 200.0 {
        drive.wander(rng);
    }
    drive.passed
}

struct Drive<'a> {
    plan: &'a Plan,
    passed: Vec<usize>,
    length_m: f64,
}

impl Drive<'_> {
    fn go(&mut self, to: usize) {
        self.length_m += self.plan.distance_m(self.last(0), to);
        self.passed.push(to);
    }

    /// The junction that was passed last, or the `back`-th before it.
    fn last(&self, back: usize) -> usize {
        self.passed[self.passed.len() - 1 - back]
    }

    /// Wanders as long as there is time to be home at `until_m`.
    fn tour(&mut self, until_m: f64, rng: &mut impl Rng) {
        while self.length_m + self.way_m(&self.ways_home()) < until_m {
            self.wander(rng);
        }
    }

    /// Takes any street but the one it came by, rather one that it does not know yet.
    fn wander(&mut self, rng: &mut impl Rng) {
        let (here, before) = (self.last(0), self.last(1));
        let known = |to: usize| {
            self.passed
                .windows(2)
                .any(|w| w == [here, to] || w == [to, here])
        };
        let mut ways: Vec<usize> = self.plan.neighbours[here]
            .iter()
            .copied()
            .filter(|to| *to != before)
            .collect();
        if ways.iter().any(|to| !known(*to)) && rng.random_bool(0.8) {
            ways.retain(|to| !known(*to));
        }
        self.go(ways[rng.random_range(0..ways.len())]);
    }

    /// Returns to the first junctions and takes the first streets again.
    fn home(&mut self) {
        for to in self.ways_home() {
            self.go(to);
        }
        for index in 1..=REPEATED.min(self.passed.len() - 1) {
            self.go(self.passed[index]);
        }
    }

    /// The shortest way to the start that goes on along the first street without turning round.
    fn ways_home(&self) -> Vec<usize> {
        self.shortest((self.last(1), self.last(0)), |before, here| {
            here == self.passed[0] && before != self.passed[1]
        })
    }

    /// Drives the streets after the first ones in the opposite direction.
    fn drive_back(&mut self) {
        let Some(stretch) = self
            .passed
            .get(REPEATED + 1..2 * REPEATED + 2)
            .map(<[usize]>::to_vec)
        else {
            return;
        };
        let (end, inner) = (stretch[REPEATED], stretch[REPEATED - 1]);
        for to in self.shortest((self.last(1), self.last(0)), |before, here| {
            here == end && before != inner
        }) {
            self.go(to);
        }
        for to in stretch.iter().rev().skip(1) {
            if self.last(1) != *to {
                self.go(*to);
            }
        }
    }

    fn way_m(&self, way: &[usize]) -> f64 {
        let mut here = self.last(0);
        way.iter()
            .map(|to| self.plan.distance_m(std::mem::replace(&mut here, *to), *to))
            .sum()
    }

    /// The way with the fewest streets from the second of two junctions, coming from the first, to where `arrived` (given
    /// the last two junctions) without turning round; empty where there is none.
    fn shortest(&self, from: (usize, usize), arrived: impl Fn(usize, usize) -> bool) -> Vec<usize> {
        let mut came_from = BTreeMap::from([(from, None)]);
        let mut open = VecDeque::from([from]);
        while let Some(state) = open.pop_front() {
            if arrived(state.0, state.1) {
                let mut way = Vec::new();
                let mut back = Some(state);
                while let Some(state) = back {
                    way.push(state.1);
                    back = came_from.get(&state).copied().flatten();
                }
                way.pop();
                way.reverse();
                return way;
            }
            for next in self.plan.neighbours[state.1]
                .iter()
                .filter(|next| **next != state.0)
            {
                let next = (state.1, *next);
                if let Entry::Vacant(unseen) = came_from.entry(next) {
                    unseen.insert(Some(state));
                    open.push_back(next);
                }
            }
        }
        Vec::new()
    }
}
