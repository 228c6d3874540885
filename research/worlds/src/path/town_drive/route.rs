//! The sequence of junctions of a drive.

use std::collections::VecDeque;
use std::collections::btree_map::{BTreeMap, Entry};

use rand::Rng;

use super::plan::Plan;

/// Share of the length after which the drive first returns to its start.
const FIRST_TOUR: f64 = 0.4;
/// Number of streets that are repeated after each return, and number of streets that are driven in
/// the opposite direction.
const REPEATED: usize = 2;

/// Draws the junctions of a drive of at least `length_m`, without U-turns. The drive returns to its
/// start at 40 % of its length, repeats its first streets, drives some streets in the opposite
/// direction, and ends at its start.
pub fn route(plan: &Plan, length_m: f64, rng: &mut impl Rng) -> Vec<usize> {
    let start = plan.junctions.len() / 2;
    let first = plan.neighbours[start][rng.random_range(0..plan.neighbours[start].len())];
    let mut drive = Drive {
        plan,
        passed: vec![start, first],
        length_m: plan.distance_m(start, first),
    };
    drive.tour(FIRST_TOUR * length_m, rng);
    drive.return_home();
    drive.drive_back();
    drive.tour(length_m, rng);
    drive.return_home();
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
    fn drive_to(&mut self, to: usize) {
        self.length_m += self.plan.distance_m(self.last(0), to);
        self.passed.push(to);
    }

    /// The last junction, or the `back`-th before it.
    fn last(&self, back: usize) -> usize {
        self.passed[self.passed.len() - 1 - back]
    }

    /// Wanders as long as the route home stays within `until_m`.
    fn tour(&mut self, until_m: f64, rng: &mut impl Rng) {
        while self.length_m + self.length_of_m(&self.route_home()) < until_m {
            self.wander(rng);
        }
    }

    /// Takes any street but the last one, preferably a new one.
    fn wander(&mut self, rng: &mut impl Rng) {
        let (here, before) = (self.last(0), self.last(1));
        let known = |to: usize| {
            self.passed
                .windows(2)
                .any(|w| w == [here, to] || w == [to, here])
        };
        let mut choices: Vec<usize> = self.plan.neighbours[here]
            .iter()
            .copied()
            .filter(|to| *to != before)
            .collect();
        if choices.iter().any(|to| !known(*to)) && rng.random_bool(0.8) {
            choices.retain(|to| !known(*to));
        }
        self.drive_to(choices[rng.random_range(0..choices.len())]);
    }

    /// Returns to the start and repeats the first streets.
    fn return_home(&mut self) {
        for to in self.route_home() {
            self.drive_to(to);
        }
        for index in 1..=REPEATED.min(self.passed.len() - 1) {
            self.drive_to(self.passed[index]);
        }
    }

    /// The shortest route to the start from which the first street can be repeated without a
    /// U-turn.
    fn route_home(&self) -> Vec<usize> {
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
            self.drive_to(to);
        }
        for to in stretch.iter().rev().skip(1) {
            if self.last(1) != *to {
                self.drive_to(*to);
            }
        }
    }

    fn length_of_m(&self, route: &[usize]) -> f64 {
        let mut here = self.last(0);
        route
            .iter()
            .map(|to| self.plan.distance_m(std::mem::replace(&mut here, *to), *to))
            .sum()
    }

    /// The route with the fewest streets that continues from the two junctions `from` to where
    /// `arrived` (given the last two junctions), without U-turns; empty if there is none.
    fn shortest(&self, from: (usize, usize), arrived: impl Fn(usize, usize) -> bool) -> Vec<usize> {
        let mut came_from = BTreeMap::from([(from, None)]);
        let mut open = VecDeque::from([from]);
        while let Some(state) = open.pop_front() {
            if arrived(state.0, state.1) {
                let mut route = Vec::new();
                let mut back = Some(state);
                while let Some(state) = back {
                    route.push(state.1);
                    back = came_from.get(&state).copied().flatten();
                }
                route.pop();
                route.reverse();
                return route;
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
