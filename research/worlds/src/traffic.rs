//! The other road users.
//!
//! The place of each is a function of time alone, so any time can be asked for in any order.
//! Vehicles in the ego vehicle's lane follow its progress at no less than the distance of a queue;
//! the others keep clear of it.

mod actor;
mod actors;
mod config;
mod crossings;
mod ego_route;
mod kind;
mod road_user;
mod track;

use std::sync::Arc;

use nalgebra::Point2;

pub use actors::FIRST_BODY;
pub use config::TrafficConfig;
pub use road_user::{Observer, RoadUser};

use crate::body::{Movers, Moving};
use crate::lanes::DrivingSide;
use crate::path::Path;
use crate::stream::Stream;
use crate::streets::Streets;
use actor::Actor;
use actors::Actors;
use ego_route::EgoRoute;

/// All road users but the ego vehicle.
#[derive(Clone)]
pub struct Traffic {
    path: Arc<dyn Path>,
    route: Arc<EgoRoute>,
    actors: Arc<Vec<Actor>>,
}

impl Traffic {
    /// Draws the traffic around the first `duration_s` of a drive, the same for the same seed.
    pub fn new(
        config: &TrafficConfig,
        path: Arc<dyn Path>,
        duration_s: f64,
        streets: &Streets,
        driving_side: DrivingSide,
        seed: u64,
    ) -> Self {
        let mut rng = Stream::Traffic.generator(seed);
        let route = EgoRoute::new(path.as_ref(), duration_s, streets, driving_side);
        let mut actors = Actors::default();
        if config.vehicles_per_km > 0.0 {
            actors.ego_lane(config, &mut rng);
            actors.overtaking(config, &route, &mut rng);
            actors.oncoming(config, &route, &mut rng);
            actors.bus_stops(&route, &mut rng);
            let share = (config.vehicles_per_km / 40.0).min(0.8);
            crossings::add(&mut actors, streets, &route, driving_side, share, &mut rng);
        }
        actors.cyclists(config, &route, &mut rng);
        actors.pedestrians(config, &route, &mut rng);
        Self {
            path,
            route: Arc::new(route),
            actors: Arc::new(actors.actors),
        }
    }
}

impl Movers for Traffic {
    fn visit<'a>(
        &'a self,
        time_s: f64,
        centre: Point2<f64>,
        reach_m: f64,
        see: &mut dyn FnMut(Moving<'a>),
    ) {
        self.visit_actors(time_s, centre, reach_m, &mut |_, moving| see(moving));
    }
}

impl Traffic {
    /// As [`Movers::visit`], with the road user that each body is of.
    fn visit_actors<'a>(
        &'a self,
        time_s: f64,
        centre: Point2<f64>,
        reach_m: f64,
        see: &mut dyn FnMut(&'a Actor, Moving<'a>),
    ) {
        let ego = self.path.pose(time_s);
        for actor in self.actors.iter().filter(|actor| actor.is_visible(time_s)) {
            let Some(pose) = actor.track.pose(&self.route, time_s) else {
                continue;
            };
            if (pose.translation.vector - centre.coords).norm() >= reach_m
                || actor.overlaps(&ego, &pose)
            {
                continue;
            }
            let velocity = actor.velocity(&self.route, time_s, &pose);
            let body = &actor.body;
            see(
                actor,
                Moving {
                    body,
                    pose,
                    velocity,
                },
            );
        }
    }
}

#[cfg(test)]
mod tests;
