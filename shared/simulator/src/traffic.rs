//! Other road users: they move, and so must not be mistaken for the town.
//!
//! Each one's place is a function of time alone, so that any instant can be asked for in any order. Those in the driven
//! vehicle's lane are tied to its progress and never come nearer than vehicles stand in a queue; the others keep off it.

mod actor;
mod config;
mod crossings;
mod crowd;
mod own_way;
mod road_user;
mod track;

use std::sync::Arc;

use nalgebra::Point2;

pub use config::TrafficConfig;
pub use crowd::FIRST_BODY;

use crate::body::{Movers, Moving};
use crate::lanes::DrivingSide;
use crate::path::Path;
use crate::stream::Stream;
use crate::streets::Streets;
use actor::Actor;
use crowd::Crowd;
use own_way::OwnWay;

/// All road users but the driven vehicle.
#[derive(Clone)]
pub struct Traffic {
    path: Arc<dyn Path>,
    way: Arc<OwnWay>,
    actors: Arc<Vec<Actor>>,
}

impl Traffic {
    /// The traffic around the first `duration_s` of a drive, the same for the same seed.
    pub fn new(
        config: &TrafficConfig,
        path: Arc<dyn Path>,
        duration_s: f64,
        streets: &Streets,
        keep: DrivingSide,
        seed: u64,
    ) -> Self {
        let mut rng = Stream::Traffic.generator(seed);
        let way = OwnWay::new(path.as_ref(), duration_s, streets, keep);
        let mut crowd = Crowd::default();
        if config.vehicles_per_km > 0.0 {
            crowd.own_lane(config, &mut rng);
            crowd.overtaking(config, &way, &mut rng);
            crowd.oncoming(config, &way, &mut rng);
            crowd.bus_stops(&way, &mut rng);
            let share = (config.vehicles_per_km / 40.0).min(0.8);
            crossings::add(&mut crowd, streets, &way, keep, share, &mut rng);
        }
        crowd.cyclists(config, &way, &mut rng);
        crowd.pedestrians(config, &way, &mut rng);
        Self {
            path,
            way: Arc::new(way),
            actors: Arc::new(crowd.actors),
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
        let own = self.path.pose(time_s);
        for actor in self.actors.iter().filter(|actor| actor.is_shown(time_s)) {
            let Some(pose) = actor.track.pose(&self.way, time_s) else {
                continue;
            };
            if (pose.translation.vector - centre.coords).norm() >= reach_m
                || actor.runs_into(&own, &pose)
            {
                continue;
            }
            let velocity = actor.velocity(&self.way, time_s, &pose);
            see(Moving {
                body: &actor.body,
                pose,
                velocity,
            });
        }
    }
}

#[cfg(test)]
mod tests;
