//! `gyre reset`, `gyre new-map` and `gyre locate`: commands that change the poses of a running run.

use std::time::Duration;

use clap::Args;
use gyre_client::{Next, Run, control::Control};
use gyre_configuration::terminal::{Failure, print};
use gyre_contract::{Command, Correction, GivenPose};
use gyre_geometry::{Pose, pose, xy_yaw};

use crate::operate::{RunChoice, chosen_to_change};

#[derive(Debug, Args)]
pub struct ResetArguments {
    /// The run.
    #[command(flatten)]
    pub run: RunChoice,
    /// The pose of the vehicle, metres and degrees: with --keep-map in the map of the run, else in
    /// the frame that begins here.
    #[arg(long, value_name = "X,Y,YAW", value_parser = parse_pose, default_value = "0,0,0", allow_hyphen_values = true)]
    pub pose: [f64; 3],
    /// Standard deviations of the place and of the yaw, metres and degrees.
    #[arg(long, value_name = "M,DEG", value_parser = parse_sigma, default_value = "0.5,15")]
    pub sigma: [f64; 2],
    /// Continue the map of SLAM. Default: its map is dropped, and a new one begins.
    #[arg(long)]
    pub keep_map: bool,
}

#[derive(Debug, Args)]
pub struct LocateArguments {
    /// The run.
    #[command(flatten)]
    pub run: RunChoice,
    /// The pose of the vehicle in the map (slam.map), metres and degrees.
    #[arg(long, value_name = "X,Y,YAW", value_parser = parse_pose, allow_hyphen_values = true)]
    pub pose: [f64; 3],
    /// Standard deviations of the place and of the yaw, metres and degrees.
    #[arg(long, value_name = "M,DEG", value_parser = parse_sigma, default_value = "0.5,15")]
    pub sigma: [f64; 2],
}

/// Begins a new chain of motions at a pose.
pub fn reset(arguments: &ResetArguments) -> Result<(), Failure> {
    let ResetArguments {
        pose,
        sigma,
        keep_map,
        ..
    } = *arguments;
    let mut at = given(pose, sigma);
    let run = chosen_to_change(&arguments.run)?;
    if keep_map {
        let odometry_from_map = map_from_odometry(&Run::open(run.out())?)?.inverse();
        let place = gyre_geometry::pose(at.x_m, at.y_m, at.yaw_rad);
        [at.x_m, at.y_m, at.yaw_rad] = xy_yaw(&(odometry_from_map * place));
    }
    give(&run, Command::Reset { at, keep_map }, "is reset")
}

/// Begins a new map of SLAM.
pub fn new_map(choice: &RunChoice) -> Result<(), Failure> {
    give(
        &chosen_to_change(choice)?,
        Command::NewMap {},
        "has a new map",
    )
}

/// Gives a run the pose of the vehicle in its map (`slam.map`).
pub fn locate(arguments: &LocateArguments) -> Result<(), Failure> {
    let at = given(arguments.pose, arguments.sigma);
    let run = chosen_to_change(&arguments.run)?;
    give(&run, Command::Locate { at }, "has the pose")
}

fn give(run: &Control, command: Command, what: &str) -> Result<(), Failure> {
    match run.command(command)? {
        Some(from_ns) => print::line(format_args!(
            "the run {what} from the scan of {:.3} s on",
            from_ns as f64 * 1e-9
        )),
        None => print::line(
            "no scan has taken the command yet: it applies to the next one, if one comes",
        ),
    }
}

fn given([x_m, y_m, yaw_deg]: [f64; 3], [sigma_m, sigma_deg]: [f64; 2]) -> GivenPose {
    GivenPose {
        x_m,
        y_m,
        yaw_rad: yaw_deg.to_radians(),
        sigma_m,
        sigma_rad: sigma_deg.to_radians(),
    }
}

/// Returns the newest correction of SLAM; none before the first one.
fn map_from_odometry(run: &Run) -> Result<Pose, Failure> {
    let mut corrections = run.observe::<Correction>()?;
    let mut newest = Pose::identity();
    while let Next::Message(message, _) = corrections.next(Duration::ZERO)? {
        let it = message.header();
        newest = pose(it.x_m, it.y_m, it.yaw_rad);
    }
    Ok(newest)
}

fn parse_pose(text: &str) -> Result<[f64; 3], String> {
    parse(text, "three numbers, as in 1.5,-2,90")
}

fn parse_sigma(text: &str) -> Result<[f64; 2], String> {
    parse(text, "two numbers, as in 0.5,15")
}

fn parse<const N: usize>(text: &str, expected: &str) -> Result<[f64; N], String> {
    let numbers: Result<Vec<f64>, _> = text.split(',').map(|it| it.trim().parse()).collect();
    let numbers = numbers.ok().and_then(|numbers| numbers.try_into().ok());
    numbers.ok_or_else(|| format!("it must be {expected}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pose_is_three_numbers() {
        assert_eq!(parse_pose("1.5, -2,90"), Ok([1.5, -2.0, 90.0]));
        for wrong in ["", "1,2", "1,2,3,4", "1,2,x"] {
            assert!(parse_pose(wrong).is_err(), "{wrong}");
        }
    }
}
