use std::f64::consts::{FRAC_PI_2, PI};

use super::*;

#[test]
fn frames_are_four_names() {
    let frames = Frames {
        map: "map".to_owned(),
        odom: "odom".to_owned(),
        base: "car/base".to_owned(),
        radar: "radar_top".to_owned(),
    };
    assert_eq!("map, odom,car/base,radar_top".parse(), Ok(frames));
    for text in [
        "",
        "map,odom,base",
        "map,odom,,radar",
        "/map,odom,base,radar",
    ] {
        assert!(text.parse::<Frames>().is_err(), "{text}");
    }
}

fn uncertain(motion: Pose, covariance: Matrix3<f64>) -> UncertainMotion {
    UncertainMotion { motion, covariance }
}

#[test]
fn planar_covariances_are_in_the_order_of_ros() {
    let matrix = Matrix3::new(1.0, 2.0, 3.0, 2.0, 4.0, 5.0, 3.0, 5.0, 6.0);
    let covariance = covariance(Some(&matrix));
    let e = covariance.elements();
    assert_eq!(
        [e[0], e[1], e[5], e[6], e[7], e[11]],
        [1.0, 2.0, 3.0, 2.0, 4.0, 5.0]
    );
    assert_eq!([e[30], e[31], e[35]], [3.0, 5.0, 6.0]);
    assert_eq!([e[14], e[21], e[28]], [UNKNOWN; 3]);
    assert_eq!(e.iter().filter(|value| **value != 0.0).count(), 12);
}

#[test]
fn velocity_is_in_the_frame_of_the_vehicle() {
    let motion = uncertain(
        planar(2.0, 2.0, FRAC_PI_2),
        Matrix3::from_diagonal(&nalgebra::Vector3::new(4.0, 1.0, 0.25)),
    );
    let since = Interval {
        motion,
        duration_ns: 500_000_000,
        is_measured: true,
    };
    let pose = uncertain(planar(2.0, 2.0, FRAC_PI_2), Matrix3::identity());
    let frames = "map,odom,base_link,radar".parse().unwrap();
    let odometry = odometry(7, &frames, &pose, Some(&since));
    // A quarter circle of radius 2 m to the left in half a second.
    let twist = odometry.twist.twist;
    assert!((twist.linear.x - 2.0 * FRAC_PI_2 / 0.5).abs() < 1e-9);
    assert!(twist.linear.y.abs() < 1e-9);
    assert!((twist.angular.z - FRAC_PI_2 / 0.5).abs() < 1e-9);
    assert!((odometry.pose.pose.orientation.z - 0.5_f64.sqrt()).abs() < 1e-9);
    let predicted = Interval {
        is_measured: false,
        ..since
    };
    let predicted = self::odometry(7, &frames, &pose, Some(&predicted));
    assert_eq!(predicted.twist.twist, odometry.twist.twist);
    assert_eq!(predicted.twist.covariance, covariance(None));
    assert_ne!(odometry.twist.covariance, covariance(None));
    let first = self::odometry(0, &frames, &UncertainMotion::identity(), None);
    assert_eq!(first.twist.twist, geometry_msgs::Twist::default());
    assert_eq!(first.twist.covariance, covariance(None));
}

const OF_MOTION: Matrix3<f64> =
    Matrix3::new(0.04, 0.01, 0.002, 0.01, 0.09, -0.001, 0.002, -0.001, 0.0004);

/// Returns the covariance of a function of a motion (x, y and yaw) with [`OF_MOTION`].
fn by_small_errors(
    of: impl Fn([f64; 3]) -> nalgebra::Vector3<f64>,
    motion: [f64; 3],
) -> Matrix3<f64> {
    let step = 1e-5;
    let columns = [0, 1, 2].map(|value| {
        let by = |amount: f64| {
            let mut moved = motion;
            moved[value] += amount;
            of(moved)
        };
        (by(step) - by(-step)) / (2.0 * step)
    });
    let jacobian = Matrix3::from_columns(&columns);
    jacobian * OF_MOTION * jacobian.transpose()
}

#[test]
fn the_covariance_of_a_velocity_is_that_of_small_errors_of_the_motion() {
    // Turns on both sides of the limit of the series.
    for yaw_rad in [0.0, 1e-7, 0.0199, -0.0201, 0.7, -FRAC_PI_2, 2.8] {
        let twist = |[x, y, yaw]: [f64; 3]| {
            let twist = Twist::from_motion(&planar(x, y, yaw), 0.25);
            nalgebra::Vector3::new(twist.vx_mps, twist.vy_mps, twist.yaw_rate_radps)
        };
        let expected = by_small_errors(twist, [3.0, -0.5, yaw_rad]);
        let found = velocity_covariance(&Interval {
            motion: uncertain(planar(3.0, -0.5, yaw_rad), OF_MOTION),
            duration_ns: 250_000_000,
            is_measured: true,
        });
        assert!(
            (found - expected).norm() < 1e-7,
            "{yaw_rad}: {found} {expected}"
        );
    }
}

#[test]
fn a_mounting_is_three_numbers() {
    let mounting: Mounting = "1.5, -0.2,180".parse().unwrap();
    let [x_m, y_m, yaw_rad] = xy_yaw(mounting.radar());
    assert_eq!((x_m, y_m), (1.5, -0.2));
    assert!((yaw_rad.abs() - PI).abs() < 1e-12);
    for text in ["", "1,2", "1,2,3,4", "ahead,0,0", "nan,0,0"] {
        assert!(text.parse::<Mounting>().is_err(), "{text}");
    }
}

#[test]
fn a_radar_in_front_swings_out_where_the_vehicle_turns_on_the_spot() {
    let mounting: Mounting = "2,0,90".parse().unwrap();
    // The radar looks to the left: things ahead of the vehicle are to its right.
    let of_radar = mounting.0.inverse() * planar(0.0, 0.0, FRAC_PI_2) * mounting.0;
    let [x_m, y_m, yaw_rad] = xy_yaw(&mounting.of_vehicle(&of_radar));
    assert!(x_m.abs() < 1e-12 && y_m.abs() < 1e-12);
    assert!((yaw_rad - FRAC_PI_2).abs() < 1e-12);
}

#[test]
fn the_covariance_is_that_of_small_errors_of_the_radars_motion() {
    let mounting: Mounting = "1.2,-0.4,35".parse().unwrap();
    let of_vehicle = |[x, y, yaw]: [f64; 3]| {
        nalgebra::Vector3::from(xy_yaw(&mounting.of_vehicle(&planar(x, y, yaw))))
    };
    let expected = by_small_errors(of_vehicle, [3.0, 0.5, 0.8]);
    let found = mounting.of_vehicle_uncertain(&uncertain(planar(3.0, 0.5, 0.8), OF_MOTION));
    assert!(
        (found.covariance - expected).norm() < 1e-6,
        "{found:?} {expected}"
    );
}
