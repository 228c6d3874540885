//! The commands that nodes of ROS 2 give to a run: its reset, a new map, and an initial pose.

use gyre_client::control::Control;
use gyre_contract::{Command, GivenPose};
use gyre_geometry::{Pose, xy_yaw};
use gyre_ros2_messages::{SAVED_MAP, geometry_msgs::PoseWithCovarianceStamped};
use serde::{Deserialize, Serialize};

use crate::run_state::Shared;

/// The answer of a service of the type `std_srvs/srv/Trigger`.
#[derive(Clone, Serialize, Deserialize)]
pub struct Done {
    success: bool,
    message: String,
}

/// Begins odometry and map again.
pub fn reset(shared: &Shared) -> Done {
    let at = GivenPose::default();
    give(
        shared,
        Command::Reset {
            at,
            keep_map: false,
        },
    )
}

pub fn new_map(shared: &Shared) -> Done {
    give(shared, Command::NewMap {})
}

/// Gives the run a pose in its own map, or in the map of `slam.map`: the frame of the message
/// decides.
pub fn initial_pose(shared: &Shared, message: &PoseWithCovarianceStamped) -> Done {
    let vehicle = &shared.settings.vehicle;
    let (pose, [sigma_m, sigma_rad]) = vehicle.given(message);
    let given = |sigma: f64, usual| if sigma > 0.0 { sigma } else { usual };
    let at = |pose: &Pose| {
        let ([x_m, y_m, yaw_rad], usual) = (xy_yaw(pose), GivenPose::default());
        GivenPose {
            x_m,
            y_m,
            yaw_rad,
            sigma_m: given(sigma_m, usual.sigma_m),
            sigma_rad: given(sigma_rad, usual.sigma_rad),
        }
    };
    let (frame, map) = (&message.header.frame_id, &vehicle.frames.map);
    match frame {
        frame if frame == SAVED_MAP => give(shared, Command::Locate { at: at(&pose) }),
        frame if frame == map => {
            let map_from_odometry = shared.state().map_from_odometry.unwrap_or_default();
            let at = at(&(map_from_odometry.inverse() * pose));
            give(shared, Command::Reset { at, keep_map: true })
        }
        _ => Done {
            success: false,
            message: format!(
                "the initial pose is in the frame `{frame}`: it must be in {map}, the map of the run, or in {SAVED_MAP}, the map in which it localises"
            ),
        },
    }
}

fn give(shared: &Shared, command: Command) -> Done {
    let given = Control::of(&shared.settings.out).and_then(|run| run.command(command));
    let (success, message) = match given {
        Ok(Some(_)) => (true, "applied to the next scan".to_owned()),
        Ok(None) => (
            true,
            "no scan has taken it yet: it applies to the next one, if one comes".to_owned(),
        ),
        Err(error) => (false, error.to_string()),
    };
    Done { success, message }
}

impl Done {
    /// Reports a command that nobody waits for.
    pub fn report(&self, what: &str) {
        match self.success {
            true => tracing::info!("{what}: {}", self.message),
            false => tracing::warn!("{what}: {}", self.message),
        }
    }
}
