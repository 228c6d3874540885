//! Logs of every format, as written here after the public development kits, their faults, and the
//! real ones.

mod faults;
mod wheels;

use gyre_datasets::{Format, LogError, SampleLog};
use gyre_geometry::samples::{SampleKind, UpAxis};
use tempfile::TempDir;

use crate::common::{assert_refused, written};

/// 2025-10-14, ns.
const START_NS: i64 = 1_760_456_485_551_626_000;

/// Reads a text as a file of this name.
fn read(name: &str, text: &str) -> Result<SampleLog, LogError> {
    let folder = TempDir::new().unwrap();
    let path = written(&folder, name, text);
    SampleLog::read_gyro(&path)
}

/// The rates and accelerations of the only sample.
fn values(log: &SampleLog) -> [f64; 6] {
    let [sample] = &log.samples[..] else {
        panic!("{log:?}");
    };
    assert_eq!(sample.stamp_ns, START_NS);
    sample.values
}

fn assert_close(found: [f64; 6], expected: [f64; 6], what: &str) {
    let mut pairs = found.iter().zip(expected);
    let is_close = pairs.all(|(found, expected)| (found - expected).abs() < 1e-9);
    assert!(is_close, "{what}: {found:?} {expected:?}");
}

/// Rates about x, y, z of 1, 2, 3 and accelerations of 4, 5, 6, whatever the order of columns.
const ALL: [f64; 6] = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0];

#[test]
fn tables_of_datasets_are_read_by_their_headers() {
    for case in [
        "imu_as_logged.csv|stamp_ns,gyro_x_radps,gyro_y_radps,gyro_z_radps,accel_x_mps2,accel_y_mps2,accel_z_mps2\n1760456485551626000,1,2,3,4,5,6\n",
        "dmu_imu.csv|time,wx,wy,wz,ax,ay,az\n1760456485551626000,1,2,3,4,5,6\n",
        "aeva_imu.csv|time,wx,wy,wz,ax,ay,az\n1760456485551626,1,2,3,4,5,6\n",
        "applanix/imu.csv|GPSTime,angvel_z,angvel_y,angvel_x,accelz,accely,accelx\n1760456485551626,3,2,1,6,5,4\n",
        // In FoMo's files `a` are the angular rates.
        "vectornav.csv|t,ax,ay,az,lx,ly,lz\n1760456485551626,1,2,3,4,5,6\n",
        "xsens_imu.csv|1760456485551626000,0,0,0,1,7,7,7,1,2,3,4,5,6,8,8,8\n",
    ] {
        let (name, text) = case.split_once('|').unwrap();
        let log = read(name, text).unwrap();
        assert_close(values(&log), ALL, name);
        assert_eq!(log.faults.sentences(SampleKind::Gyro), [""; 0], "{name}");
    }
}

#[test]
fn tables_of_ones_own_are_read_by_names_and_units() {
    // The stamp, rates and accelerations, the text.
    for case in [
        "1760456485551000000|1,2,3,9.80665,0,0|timestamp_ms;wx_dps;wy_dps;wz_dps;acc_x_g;acc_y_g;acc_z_g\n1760456485551;57.29577951308232;114.59155902616465;171.88733853924697;1;0;0",
        "12500000000|1,2,3,0,0,0|stamp_s,Angular Velocity.x [rad/s],Angular Velocity.y [rad/s],Angular Velocity.z [rad/s]\n12.5,1,2,3",
        // As rostopic writes it.
        "1760456485551626000|1,2,3,4,5,6|%time,field.angular_velocity.x,field.angular_velocity.y,field.angular_velocity.z,field.linear_acceleration.x,field.linear_acceleration.y,field.linear_acceleration.z\n1760456485551626000,1,2,3,4,5,6",
        // As ROS 2 and ROS 1 write the two parts of a stamp.
        "1760456485551626000|1,2,3,0,0,0|header.stamp.sec,header.stamp.nanosec,gx,gy,gz\n1760456485,551626000,1,2,3",
        "1760456485551626000|1,2,3,0,0,0|gx (deg/s),gy (deg/s),gz (deg/s),nsecs,secs\n57.29577951308232,114.59155902616465,171.88733853924697,551626000.0,1760456485.0",
        "1760456485551626000|1,2,3,0,0,0|timestamp,usec,gyro_x,gyro_y,gyro_z\n1760456485,551626,1,2,3",
        // Two whole stamps.
        "1760456485551626000|1,2,3,0,0,0|stamp_s,stamp_ns,gyro_x,gyro_y,gyro_z\n1760456485,1760456485551626000,1,2,3",
        // EuRoC.
        "1760456485551626000|1,2,3,4,5,6|#timestamp [ns],w_RS_S_x [rad s^-1],w_RS_S_y [rad s^-1],w_RS_S_z [rad s^-1],a_RS_S_x [m s^-2],a_RS_S_y [m s^-2],a_RS_S_z [m s^-2]\n1760456485551626000,1,2,3,4,5,6",
        "1000000|1,2,3,0,0,0|x,stamp_us,omega_z,omega_x,omega_y\n0,1000,3,1,2",
    ] {
        let parts: Vec<&str> = case.split('|').collect();
        let expected = parts[1].split(',').map(|it| it.parse::<f64>().unwrap());
        let expected: Vec<f64> = expected.collect();
        let log = read("own.csv", parts[2]).unwrap();
        assert_close(log.samples[0].values, expected.try_into().unwrap(), case);
        assert_eq!(log.samples[0].stamp_ns.to_string(), parts[0], "{case}");
        let units = ["dps", "rad/s", "deg/s", "rad s"];
        let names_unit = units.iter().any(|it| case.contains(it));
        assert_eq!(log.faults.unit_is_assumed, !names_unit, "{case}");
    }
}

#[test]
fn samples_of_radiate_are_files() {
    let folder = TempDir::new().unwrap();
    // The nanoseconds have no leading zeros.
    let line = |(frame, ns)| format!("Frame: {frame:06} Time: 1549986608.{ns}\n");
    let list = [(1, 1153537), (2, 53153537), (3, 103153537)]
        .map(line)
        .concat();
    written(&folder, "GPS_IMU_Twist.txt", &list);
    let zeros = "0,0,0 \n 0,0,0 \n 0,0,0 \n";
    for (number, yaw) in [(1, 0.03532), (2, -0.5)] {
        let text = format!(
            "55.89,-3.32,209.3 \n{zeros}-0.00401,0.00605,-0.98617,-0.16556 \n0.00151,-0.00572,{yaw} \n-0.58829,0.53698,0.04222 \n{zeros}{zeros}{zeros}-7.3,-10.1,-0.3 \n0.00151,-0.00572,0.03532 \n"
        );
        written(&folder, &format!("GPS_IMU_Twist/{number:06}.txt"), &text);
    }
    let found = SampleLog::find_gyro(folder.path()).unwrap();
    assert_eq!(found, folder.path().join("GPS_IMU_Twist"));
    let log = SampleLog::read_gyro(&found).unwrap();
    let stamps: Vec<i64> = log.samples.iter().map(|sample| sample.stamp_ns).collect();
    let expected = [1_153_537, 53_153_537].map(|ns| 1_549_986_608_000_000_000 + ns);
    assert_eq!(stamps, expected);
    let expected = [0.00151, -0.00572, 0.03532, -0.58829, 0.53698, 0.04222];
    assert_eq!(log.samples[0].values, expected);
    // The third has a time and no file.
    assert_eq!((log.faults.unreadable, log.faults.first_unreadable), (1, 3));
}

#[test]
fn the_axis_that_points_up_is_configured_or_measured_or_that_of_the_format() {
    use Format::{Oxford, Radiate};
    use UpAxis::{MinusZ, X, Z};
    let folder = TempDir::new().unwrap();
    for (name, accelerations, dataset, configured, expected) in [
        ("imu.csv", "0,0,0", Oxford, None, Some(Z)),
        ("imu.csv", "9.7,0.3,-0.4", Oxford, None, Some(X)),
        ("imu.csv", "0.1,0,-9.8", Oxford, Some(Z), None),
        ("imu_as_logged.csv", "0.1,0,0", Radiate, None, Some(MinusZ)),
        ("imu_as_logged.csv", "0.1,0,0", Radiate, Some(Z), None),
    ] {
        let header = "stamp_ns,gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z";
        let text = format!("{header}\n{START_NS},0,0,0.1,{accelerations}\n");
        let log = SampleLog::read_gyro(&written(&folder, name, &text)).unwrap();
        let up = log.up(configured, dataset);
        assert_eq!(up.ok(), expected, "{name} {accelerations} {configured:?}");
    }
}

#[test]
fn logs_lie_at_the_places_of_the_datasets() {
    for place in [
        "imu_as_logged.csv",
        "imu/dmu_imu.csv",
        "sensor_data/xsens_imu.csv",
        "vectornav.csv",
    ] {
        let folder = TempDir::new().unwrap();
        let path = written(&folder, place, "");
        let beside = |name: &str| SampleLog::find_gyro(&folder.path().join(name)).ok();
        assert_eq!(beside(""), Some(path.clone()), "{place}");
        // The folder of the images may be given for the dataset.
        assert_eq!(beside("radar"), Some(path), "{place}");
        assert_eq!(beside("other"), None, "{place}");
    }
}

#[test]
fn the_log_of_the_truth_is_used_only_if_it_is_named() {
    let folder = TempDir::new().unwrap();
    written(&folder, "applanix/imu.csv", "");
    let reason = "of which the ground truth was computed";
    assert_refused(SampleLog::find_gyro(folder.path()), reason);
}

#[test]
fn what_is_no_log_of_a_gyro_is_refused_with_the_reason() {
    for case in [
        "timestamp,ins_status,latitude\n1547131046260961,INS_SOLUTION_GOOD,51.7\n|the INS logs of Oxford and OORD have positions and attitudes alone",
        "|it is empty",
        "stamp_ns,gyro_x,gyro_z\n1,2,3\n|no angular rates about three axes",
        "gyro_x,gyro_y,gyro_z\n1,2,3\n|have no stamps",
        "stamp_ns,gyro_x,gyro_y,gyro_z,gyro_z\n1,2,3,4,4\n|two of its columns are named \"gyro_z\"",
        "1,2,3,4,5,6,7\n|its 7 columns have no names",
        "1,2,3,4,5,6,7,8\n|first version of MulRan's xsens_imu.csv",
        "stamp_ns,gyro_x,gyro_y,gyro_z\n|it has no samples",
        "stamp_ns;gyro_x;gyro_y;gyro_z\n1;0,1;0,2;0,3\n|the first in line 2: in \"1; 0,1; 0,2; 0,3\", write stamps as seconds or nanoseconds since 1970, numbers with decimal points",
        "stamp_ns,gyro_x,gyro_y,gyro_z\n1;0.1;0.2;0.3\n|it has 1 fields in place of 4: do all rows have the mark",
        "time,gyro_x,gyro_y,gyro_z\n2025-10-14T15:41:25.551Z,0,0,0\n|in \"2025-10-14T15:41:25.551Z; 0; 0; 0\", write stamps as seconds",
    ] {
        let (text, reason) = case.split_once('|').unwrap();
        assert_refused(read("imu.csv", text), reason);
    }
    let wide = read("imu.csv", &"x,".repeat(200_000));
    assert_refused(wide, "its first row has 200001 columns, and at most 1000");
    let stated =
        "stamp_ns,gyro_x,gyro_y,gyro_z,angular_velocity_covariance_0\n1,0,0,0,-1\n3,0,0,0,0\n";
    let log = read("imu.csv", stated).unwrap();
    assert_eq!((log.samples.len(), log.faults.not_a_number), (1, 1));
    let missing = SampleLog::read_gyro("/no/imu.csv".as_ref());
    assert_refused(missing, "cannot read the log of the gyro /no/imu.csv");
}
