//! Buildings: a closed outline of facades, with corners, which reflect most.

use nalgebra::{Point2, Vector2};

use super::facade::{Facade, Material, right_of};
use super::site::{Screen, Site};

/// The ground plan of a building.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Form {
    Plain,
    /// With a wing at the back.
    Angle,
    /// With a part of the front set back.
    Stepped,
    /// A nave with a tower in front.
    Church,
}

/// The space for a building in its site's frame: x along the street, y away from it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Room {
    pub x: f64,
    pub y: f64,
    pub width_m: f64,
    pub depth_m: f64,
}

/// A building.
#[derive(Clone, Copy, Debug)]
pub(super) struct Building {
    pub room: Room,
    pub form: Form,
    pub front: Material,
    pub rest: Material,
    /// Detail of its front; see [`Facade::detail`].
    pub detail: f64,
    /// Distance between the balconies on its front, metres; 0 without balconies.
    pub balconies_m: f64,
}

/// Factor on the detail of sides and backs.
const BEHIND: f64 = 0.4;

impl Room {
    /// The space with a corner at x and y, of a width and a depth, metres.
    pub fn at([x, y]: [f64; 2], [width_m, depth_m]: [f64; 2]) -> Self {
        Self {
            x,
            y,
            width_m,
            depth_m,
        }
    }

    /// The corners of a ground plan in this space, counter-clockwise from the front's left. `share`
    /// says where it is divided.
    fn outline(&self, form: Form, share: f64) -> Vec<Point2<f64>> {
        let (w, d) = (self.width_m, self.depth_m);
        let (cut, step) = (w * share, (0.25 * d).min(3.0));
        let corners: &[(f64, f64)] = match form {
            Form::Plain => &[(0.0, 0.0), (w, 0.0), (w, d), (0.0, d)],
            Form::Angle => &[
                (0.0, 0.0),
                (w, 0.0),
                (w, 0.55 * d),
                (cut, 0.55 * d),
                (cut, d),
                (0.0, d),
            ],
            Form::Stepped => &[
                (0.0, step),
                (cut, step),
                (cut, 0.0),
                (w, 0.0),
                (w, d),
                (0.0, d),
            ],
            Form::Church => {
                let (left, right) = (0.35 * w, 0.65 * w);
                &[
                    (0.0, 6.0),
                    (left, 6.0),
                    (left, 0.0),
                    (right, 0.0),
                    (right, 6.0),
                    (w, 6.0),
                    (w, d),
                    (0.0, d),
                ]
            }
        };
        corners
            .iter()
            .map(|(x, y)| Point2::new(self.x + x, self.y + y))
            .collect()
    }
}

impl Site<'_> {
    pub(super) fn building(&mut self, building: &Building) {
        let body = self.body();
        let share = self.between(0.3, 0.7);
        let inside_m = (0.4 * building.room.width_m.min(building.room.depth_m)).min(6.0);
        let bay_m = self.between(2.2, 3.8);
        let outline = building.room.outline(building.form, share);
        let corner = |index: usize| outline[index % outline.len()];
        for index in 0..outline.len() {
            let (before, from, to) = (
                corner(index + outline.len() - 1),
                corner(index),
                corner(index + 1),
            );
            let to_street = right_of(to - from).y < -0.5;
            let (material, share) = if to_street {
                (building.front, 1.0)
            } else {
                (building.rest, BEHIND)
            };
            let detail = share * building.detail;
            self.facade(&Facade {
                from,
                to,
                material,
                detail,
                bay_m,
                inside_m,
                body,
            });
            self.corner(before, from, to, detail, body);
            if to_street && building.balconies_m > 0.0 {
                self.balconies(from, to, building.balconies_m, body);
            }
        }
    }

    /// Convex corners scatter in all directions; concave ones are retroreflecting dihedrals.
    fn corner(
        &mut self,
        before: Point2<f64>,
        at: Point2<f64>,
        after: Point2<f64>,
        detail: f64,
        body: u32,
    ) {
        let (arriving, leaving) = (at - before, after - at);
        if arriving.perp(&leaving) > 0.0 {
            self.facing(
                at,
                right_of(arriving) + right_of(leaving),
                0.5,
                3.0 * detail,
                body,
            );
        } else {
            self.facing(at, right_of(arriving) + right_of(leaving), 2.0, 25.0, body);
        }
    }

    /// Balconies: floor, rail and wall form two dihedrals each.
    fn balconies(&mut self, from: Point2<f64>, to: Point2<f64>, every_m: f64, body: u32) {
        let along = (to - from).normalize();
        let outward = right_of(along);
        for index in 0..((to - from).norm() / every_m) as usize {
            let place = from + along * ((index as f64 + 0.3) * every_m);
            for side in [-1.0, 1.0] {
                self.facing(
                    place + along * side,
                    outward + along * (0.6 * side),
                    4.0,
                    6.0,
                    body,
                );
            }
            self.facing(place + outward * 1.2, outward, 0.5, 0.8, body);
        }
    }

    /// Adds a bus shelter: glass at the back and the sides, a metal frame.
    pub(super) fn shelter(&mut self) {
        let body = self.body();
        let corners =
            [(-1.8, 0.0), (-1.8, 1.2), (1.8, 1.2), (1.8, 0.0)].map(|(x, y)| Point2::new(x, y));
        let glass = Screen {
            transmission: 0.4,
            mirror: 0.4,
        };
        for ends in corners.windows(2) {
            self.wall(ends[0], ends[1], glass, body);
        }
        for place in corners {
            self.point(place, 1.5, 4.0, body);
        }
        for side in [-1.0, 1.0] {
            self.facing(
                Point2::new(1.7 * side, 1.1),
                Vector2::new(-side, -1.0),
                2.0,
                20.0,
                body,
            );
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn outlines_run_counter_clockwise_inside_their_room() {
        let room = Room {
            x: 2.0,
            y: 1.0,
            width_m: 20.0,
            depth_m: 16.0,
        };
        for form in [Form::Plain, Form::Angle, Form::Stepped, Form::Church] {
            let outline = room.outline(form, 0.4);
            let next = |i: usize| outline[(i + 1) % outline.len()];
            let area: f64 = outline
                .iter()
                .enumerate()
                .map(|(i, p)| p.coords.perp(&next(i).coords) / 2.0)
                .sum();
            assert!((0.5 * 320.0..=320.0).contains(&area), "{form:?}: {area} m²");
            assert!(
                outline
                    .iter()
                    .all(|p| (2.0..=22.0).contains(&p.x) && (1.0..=17.0).contains(&p.y))
            );
        }
    }
}
