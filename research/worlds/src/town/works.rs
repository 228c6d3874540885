//! Building sites: a hoarding around a lot without its house.

use nalgebra::Point2;

use super::boundary::Boundary;
use super::building::{Building, Form, Room};
use super::facade::Material;
use super::plot::Plot;

/// Width and depth of a container, metres.
const CONTAINER_M: (f64, f64) = (6.0, 2.4);
/// Distance of the hoarding from the lot's sides, metres.
const INSIDE_M: f64 = 0.3;

impl Plot<'_, '_> {
    /// Builds a hoarding with containers, scaffolding and rubble behind it.
    pub(super) fn building_site(&mut self) {
        let (left, right) = (INSIDE_M, self.width_m - INSIDE_M);
        let back = self.depth_m - INSIDE_M;
        let corners = [
            (left, back),
            (left, INSIDE_M),
            (right, INSIDE_M),
            (right, back),
        ]
        .map(|(x, y)| Point2::new(x, y));
        for ends in corners.windows(2) {
            self.site.boundary(Boundary::Fence, ends[0], ends[1]);
        }
        self.container();
        for _ in 0..(self.width_m / 4.0) as usize {
            let (x, y) = (
                self.site.between(1.0, self.width_m - 1.0),
                self.site.between(2.0, self.depth_m - 1.0),
            );
            let pole = self.at(x, y);
            self.site.post(pole);
        }
        self.clutter(1.0, 0.1, 0.2);
    }

    /// Adds a container where there is room for one.
    fn container(&mut self) {
        let (width_m, depth_m) = CONTAINER_M;
        if self.width_m < width_m + 2.0 || self.depth_m < depth_m + 2.0 {
            return;
        }
        let room = Room {
            x: self.site.between(1.0, self.width_m - width_m - 1.0),
            y: self.site.between(1.0, self.depth_m - depth_m - 1.0),
            width_m,
            depth_m,
        };
        self.site.building(&Building {
            room,
            form: Form::Plain,
            front: Material::Metal,
            rest: Material::Metal,
            detail: 1.0,
            balconies_m: 0.0,
        });
    }
}
