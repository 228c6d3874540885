//! The true poses of the cars that come towards the vehicle: `objects.csv`.

use std::fmt::Write;

use gyre_geometry::xy_yaw;
use nalgebra::Point2;

use crate::body::Moving;
use crate::cars::{FIRST_BODY, HALF_M};
use crate::profile::Receiver;
use crate::simulator::Simulator;
use crate::world::World;

pub(crate) const FILE: &str = "objects.csv";
/// The first row of the file. Poses and velocities are in the world of `ground_truth.tum`.
const HEADER: &str =
    "scan,stamp_ns,object,kind,x_m,y_m,yaw_rad,vx_m_s,vy_m_s,length_m,width_m,visible,counts";
/// Distance within which cars are reported, metres: a third more than where radars of this kind
/// resolve a car.
const REPORTED_M: f64 = 100.0;

/// The moving cars within 100 m at the time of each scan.
pub(crate) fn csv(simulator: &Simulator, stamps_ns: &[i64]) -> String {
    let mut text = format!("{HEADER}\n");
    let receiver = simulator.config().sensor.receiver();
    for (scan, &stamp_ns) in stamps_ns.iter().enumerate() {
        let time_s = simulator.drive_time_s(stamp_ns);
        let place = Point2::from(simulator.path().pose(time_s).translation.vector);
        for car in simulator.cars.near(place, REPORTED_M, time_s) {
            let [visible, power] = best_echo(simulator.world(), &receiver, place, &car);
            let object = car.body.walls[0].body - FIRST_BODY;
            let ([x, y, yaw], [length, width]) = (xy_yaw(&car.pose), HALF_M);
            let [vx, vy]: [f64; 2] = car.velocity.into();
            // Writing to memory cannot fail.
            let _ = writeln!(
                text,
                "{scan},{stamp_ns},{object},car,{x:.4},{y:.4},{yaw:.6},{vx:.4},{vy:.4},{:.2},{:.2},{visible:.4},{:.1}",
                2.0 * length,
                2.0 * width,
                20.0 * power.max(1.0).log10()
            );
        }
    }
    text
}

/// The largest share of the power that passes to a part of a car, and the power of its strongest
/// echo, without scintillation and speckle.
fn best_echo(world: &World, receiver: &Receiver, from: Point2<f64>, car: &Moving<'_>) -> [f64; 2] {
    let parts = car.body.scatterers.iter().map(|part| {
        let there = part.moved(&car.pose);
        let ray = from - there.position;
        let range_m = ray.norm().max(1.0);
        let passed = world.transmission(from, there.position, there.body);
        let gain = there.gain(ray / range_m);
        let power = there.cross_section_m2 * gain * receiver.sensitivity(range_m);
        [passed, power * passed]
    });
    parts.fold([0.0; 2], |best: [f64; 2], part| {
        [best[0].max(part[0]), best[1].max(part[1])]
    })
}
