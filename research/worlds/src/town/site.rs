//! A building site: a frame in which objects are put together.

use gyre_geometry::Pose;
use nalgebra::{Point2, Vector2};
use rand::Rng;
use rand_chacha::ChaCha8Rng;

use super::changes::Changes;
use super::random::{normal, spread};
use crate::body::{Aspect, Body, NO_BODY, Scatterer, Wall};

/// A parked car.
#[derive(Clone, Debug)]
pub struct ParkedCar {
    /// The pose of its centre in the world, x ahead or behind.
    pub pose: Pose,
    /// The number of its body in its own town.
    pub(crate) number: u32,
    /// All of it, in its own frame.
    pub(crate) body: Body,
}

/// Everything built so far, and the number of the last body.
#[derive(Default)]
pub(super) struct Built {
    pub content: Body,
    pub parked: Vec<ParkedCar>,
    last_body: u32,
}

impl Built {
    /// Returns the numbers of scatterers, walls and parked cars.
    pub(super) fn len(&self) -> [usize; 3] {
        let Body { scatterers, walls } = &self.content;
        [scatterers.len(), walls.len(), self.parked.len()]
    }

    /// The number of a new body.
    pub(super) fn next_body(&mut self) -> u32 {
        self.last_body += 1;
        self.last_body
    }

    /// Removes all that was built since there were these numbers of scatterers, walls and parked
    /// cars.
    pub(super) fn cut_back(&mut self, len: [usize; 3]) {
        self.content.scatterers.truncate(len[0]);
        self.content.walls.truncate(len[1]);
        self.parked.truncate(len[2]);
    }
}

/// A place with a frame and a random generator. All coordinates are in that frame.
pub(super) struct Site<'a> {
    pub built: &'a mut Built,
    pub pose: Pose,
    pub rng: ChaCha8Rng,
    pub changes: Changes,
}

/// Two-way transmitted share and mirrored share of a wall's power.
#[derive(Clone, Copy, Debug)]
pub(super) struct Screen {
    pub transmission: f64,
    pub mirror: f64,
}

impl Site<'_> {
    /// The number of a new body.
    pub(super) fn body(&mut self) -> u32 {
        self.built.next_body()
    }

    /// Builds what changes between drives, at a place. It is built as the town's seed has it, and
    /// where the town has changed since it is replaced, so that the town's random numbers stay the
    /// same.
    pub(super) fn changing(&mut self, place: Point2<f64>, build: impl Fn(&mut Site<'_>)) {
        let before = self.built.len();
        build(self);
        if let Some(rng) = self.changes.generator(self.pose * place) {
            self.built.cut_back(before);
            build(&mut Site {
                built: self.built,
                pose: self.pose,
                rng,
                changes: self.changes,
            });
        }
    }

    pub(super) fn chance(&mut self, share: f64) -> bool {
        self.rng.random_bool(share.clamp(0.0, 1.0))
    }

    /// Draws one value with a probability, or else the other.
    pub(super) fn either<T>(&mut self, probability: f64, one: T, other: T) -> T {
        if self.chance(probability) { one } else { other }
    }

    pub(super) fn between(&mut self, min: f64, max: f64) -> f64 {
        if min < max {
            self.rng.random_range(min..max)
        } else {
            min
        }
    }

    /// Adds a scatterer that reflects in all directions, of `median_m2` with a spread of
    /// `deviation_db`.
    pub(super) fn point(
        &mut self,
        place: Point2<f64>,
        median_m2: f64,
        deviation_db: f64,
        body: u32,
    ) {
        self.push(place, median_m2, deviation_db, Aspect::AllRound, body);
    }

    /// Adds a scatterer that reflects towards `direction` (of any length): see [`Aspect::Facing`].
    pub(super) fn facing(
        &mut self,
        place: Point2<f64>,
        direction: Vector2<f64>,
        sharpness: f64,
        median_m2: f64,
        body: u32,
    ) {
        let normal = self.pose * direction.try_normalize(1e-9).unwrap_or_else(Vector2::x);
        self.push(
            place,
            median_m2,
            5.0,
            Aspect::Facing { normal, sharpness },
            body,
        );
    }

    fn push(
        &mut self,
        place: Point2<f64>,
        median_m2: f64,
        deviation_db: f64,
        aspect: Aspect,
        body: u32,
    ) {
        let cross_section_m2 = spread(&mut self.rng, median_m2, deviation_db);
        self.built.content.scatterers.push(Scatterer {
            position: self.pose * place,
            cross_section_m2,
            aspect,
            body,
        });
    }

    pub(super) fn wall(&mut self, from: Point2<f64>, to: Point2<f64>, screen: Screen, body: u32) {
        let Screen {
            transmission,
            mirror,
        } = screen;
        let (from, to) = (self.pose * from, self.pose * to);
        self.built.content.walls.push(Wall {
            from,
            to,
            transmission,
            mirror,
            body,
        });
    }

    /// Adds scatterers without a body around a place: normally distributed, at most `reach_m` away
    /// in x and y.
    pub(super) fn cloud(
        &mut self,
        place: Point2<f64>,
        count: usize,
        deviation_m: f64,
        reach_m: f64,
        median_m2: f64,
    ) {
        for _ in 0..count {
            let offset = Vector2::from_fn(|_, _| {
                (deviation_m * normal(&mut self.rng)).clamp(-reach_m, reach_m)
            });
            self.point(place + offset, median_m2, 4.0, NO_BODY);
        }
    }

    /// Adds a body, given around its own origin, at a pose.
    pub(super) fn place(&mut self, body: &Body, pose: &Pose) {
        let pose = self.pose * pose;
        self.built
            .content
            .scatterers
            .extend(body.scatterers.iter().map(|s| s.moved(&pose)));
        self.built
            .content
            .walls
            .extend(body.walls.iter().map(|w| w.moved(&pose)));
    }
}
