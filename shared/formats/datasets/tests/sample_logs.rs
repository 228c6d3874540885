//! Logs of every kind and format, as written here after the public development kits, their faults,
//! and the real ones.

mod counts;
mod faults;
mod fixes;

use gyre_datasets::{Format, LogError, SampleLog};
use gyre_geometry::samples::{
    SampleKind::{self, Gnss, Gyro, Wheels},
    UpAxis,
};
use tempfile::TempDir;

use crate::common::{assert_refused, written};

/// 2025-10-14, ns.
const START_NS: i64 = 1_760_456_485_551_626_000;
const MS: i64 = 1_000_000;

/// Reads a text as a file of this name.
fn read(of: SampleKind, name: &str, text: &str) -> Result<SampleLog, LogError> {
    let folder = TempDir::new().unwrap();
    SampleLog::read(of, &written(&folder, name, text), None)
}

fn kind(section: &str) -> SampleKind {
    let mut kinds = SampleKind::ALL.into_iter();
    kinds.find(|of| of.section() == section).unwrap()
}

/// Asserts the first values of the last sample; fixes are in a plane.
fn assert_last(log: &SampleLog, expected: &str, what: &str) {
    let within = if log.of == Gnss { 1e-3 } else { 1e-9 };
    let last = log.samples.last().unwrap();
    for (found, expected) in last.values.iter().zip(expected.split(',')) {
        let off = found - expected.parse::<f64>().unwrap();
        assert!(off.abs() < within, "{what}: {last:?}");
    }
}

#[test]
fn tables_are_read_by_their_headers_or_by_their_number_of_columns() {
    // The kind and the file; the last stamp; the last sample; the faults; the rows.
    for case in [
        "gyro imu_as_logged.csv|1760456485551626000|1,2,3,4,5,6||stamp_ns,gyro_x_radps,gyro_y_radps,gyro_z_radps,accel_x_mps2,accel_y_mps2,accel_z_mps2|1760456485551626000,1,2,3,4,5,6",
        "gyro dmu_imu.csv|1760456485551626000|1,2,3,4,5,6||time,wx,wy,wz,ax,ay,az|1760456485551626000,1,2,3,4,5,6",
        "gyro aeva_imu.csv|1760456485551626000|1,2,3,4,5,6||time,wx,wy,wz,ax,ay,az|1760456485551626,1,2,3,4,5,6",
        "gyro applanix/imu.csv|1760456485551626000|1,2,3,4,5,6||GPSTime,angvel_z,angvel_y,angvel_x,accelz,accely,accelx|1760456485551626,3,2,1,6,5,4",
        // In FoMo's files `a` are the angular rates.
        "gyro vectornav.csv|1760456485551626000|1,2,3,4,5,6||t,ax,ay,az,lx,ly,lz|1760456485551626,1,2,3,4,5,6",
        "gyro xsens_imu.csv|1760456485551626000|1,2,3,4,5,6||1760456485551626000,0,0,0,1,7,7,7,1,2,3,4,5,6,8,8,8",
        "gyro own.csv|1760456485551000000|1,2,3,9.80665,0,0||timestamp_ms;wx_dps;wy_dps;wz_dps;acc_x_g;acc_y_g;acc_z_g|1760456485551;57.29577951308232;114.59155902616465;171.88733853924697;1;0;0",
        "gyro own.csv|12500000000|1,2,3,0,0,0||stamp_s,Angular Velocity.x [rad/s],Angular Velocity.y [rad/s],Angular Velocity.z [rad/s]|12.5,1,2,3",
        // As rostopic writes it.
        "gyro own.csv|1760456485551626000|1,2,3,4,5,6|rad/s is assumed|%time,field.angular_velocity.x,field.angular_velocity.y,field.angular_velocity.z,field.linear_acceleration.x,field.linear_acceleration.y,field.linear_acceleration.z|1760456485551626000,1,2,3,4,5,6",
        // As ROS 2 and ROS 1 write the two parts of a stamp.
        "gyro own.csv|1760456485551626000|1,2,3,0,0,0|rad/s is assumed|header.stamp.sec,header.stamp.nanosec,gx,gy,gz|1760456485,551626000,1,2,3",
        "gyro own.csv|1760456485551626000|1,2,3,0,0,0||gx (deg/s),gy (deg/s),gz (deg/s),nsecs,secs|57.29577951308232,114.59155902616465,171.88733853924697,551626000.0,1760456485.0",
        "gyro own.csv|1760456485551626000|1,2,3,0,0,0|rad/s is assumed|timestamp,usec,gyro_x,gyro_y,gyro_z|1760456485,551626,1,2,3",
        // Two whole stamps.
        "gyro own.csv|1760456485551626000|1,2,3,0,0,0|rad/s is assumed|stamp_s,stamp_ns,gyro_x,gyro_y,gyro_z|1760456485,1760456485551626000,1,2,3",
        // EuRoC.
        "gyro own.csv|1760456485551626000|1,2,3,4,5,6||#timestamp [ns],w_RS_S_x [rad s^-1],w_RS_S_y [rad s^-1],w_RS_S_z [rad s^-1],a_RS_S_x [m s^-2],a_RS_S_y [m s^-2],a_RS_S_z [m s^-2]|1760456485551626000,1,2,3,4,5,6",
        "gyro own.csv|1000000|1,2,3,0,0,0|rad/s is assumed|x,stamp_us,omega_z,omega_x,omega_y|0,1000,3,1,2",
        "gyro own.csv|1|1,0,0,0,0,0|1 samples have no rates|stamp_ns,gyro_x_radps,gyro_y_radps,gyro_z_radps,angular_velocity_covariance_0|1,1,0,0,0|3,0,0,0,-1",
        "wheels wheels.csv|50|-9,0||stamp_ns,speed_m_s|0,9.0|50,-9.0",
        "wheels wheels.csv|50000|-9,0||timestamp_us,wheel_speed_mps|0,9.0|50,-9.0",
        "wheels wheels.csv|50|2.5,0||stamp_ns,speed_km_h|50,9.0",
        "wheels wheels.csv|50|2.5,0||# stamp_ns, vehicle speed [km/h]|50,9.0",
        "wheels wheels.csv|50|9,0|m/s is assumed|stamp_ns;velocity|50;9.0",
        // Clockwise from north, and counter-clockwise from east.
        "heading heading.csv|100|0.7853981634||stamp_ns,heading_deg|0,359.5|50,1|100,45",
        "heading heading.csv|50000|-3.1415926536||timestamp_us;Heading [deg]|50;270",
        "heading heading.csv|50|-2.5,0||stamp_ns,roll_rad,yaw_rad|0,7,3.1|50,7,-2.5",
        "heading heading.csv|50|1.5707963268|1 samples have no headings|stamp_ns,yaw_deg|0,|50,90",
        "gnss gnss.csv|1760456486551626000|0,11.134,0,0||stamp_ns,latitude_deg,longitude_deg|1760456485551626000,55.9,-3.2|1760456486551626000,55.9001,-3.2",
        "gnss gnss.csv|1760456486551626000|0,11.134,0,0.3||lon;lat;timestamp;sigma_m|-3.2;55.9;1760456485551626;0.3|-3.2;55.9001;1760456486551626;0.3",
        "gnss gps/gps.csv|1760456486551626000|0,11.134,110,3.5355339059||timestamp,num_satellites,latitude,longitude,altitude,latitude_sigma,longitude_sigma,altitude_sigma,northing,easting,down,utm_zone|1760456485551626,8,55.9,-3.2,110.0,3.0,4.0,9.0,5.0,6.0,-110.0,30U|1760456486551626,8,55.9001,-3.2,110.0,3.0,4.0,9.0,5.0,6.0,-110.0,30U",
        // Hemispheres, a stamp in two parts; an altitude and an accuracy that are not known.
        "gnss gnss.csv|1760456486551626000|0,11.134,20,0||header.stamp.sec,header.stamp.nanosec,lat,N/S,lon,E/W,alt,sigma_m|1760456485,551626000,55.9,N,3.2,W,,|1760456486,551626000,55.9001,n,3.2,West,20.0,-1",
        // As stated by a simulation, and as of no receiver.
        "gnss gnss.csv|1760456486551626000|0,11.134,0,0.01|1 without a fix, 1 of unknown status, used, 1 stated better than 1 cm, used as of 1 cm|stamp_ns,latitude_deg,longitude_deg,sigma_m,status.status|1760456485551626000,55.9,-3.2,0.0000127,-2|1760456486551626000,55.9001,-3.2,0.01,2|1,0,0,0,-1",
        "gnss sensor_data/gps.csv|1760456486551626000|0,11.134,60,3.1622776602||1760456485551626000,55.9,-3.2,60.0,4.0,0,0,0,16.0,0,0,0,9.0|1760456486551626000,55.9001,-3.2,60.0,4.0,0,0,0,16.0,0,0,0,9.0",
        "gnss sensor_data/gps.csv|1760456486551626000|0,11.134,60,0||1760456485551626000,55.9,-3.2,60.0,0,0,0,0,0,0,0,0,0|1760456486551626000,55.9001,-3.2,60.0,0,0,0,0,0,0,0,0,0",
        "gnss gnss.csv|1760456485551626000|3,4,0,0||stamp_ns,east_m,north_m|1760456485551626000,3.0,4.0",
        "gnss gnss_as_logged.tum|1760456485551626000|3,4,0,0||1760456485.551626000 3.0 4.0 1.0 0 0 0 1",
    ] {
        let parts: Vec<&str> = case.splitn(5, '|').collect();
        let (of, name) = parts[0].split_once(' ').unwrap();
        let log = read(kind(of), name, &parts[4].replace('|', "\n")).unwrap();
        let stamp_ns = log.samples.last().map(|sample| sample.stamp_ns.to_string());
        assert_eq!(stamp_ns.as_deref(), Some(parts[1]), "{case}");
        assert_last(&log, parts[2], case);
        let sentences = log.sentences().join(" ");
        assert!(sentences.contains(parts[3]), "{case}: {sentences}");
        assert_eq!(sentences.is_empty(), parts[3].is_empty(), "{case}");
        let origin = log.plane.map(|plane| plane.origin());
        let origin = origin.map(|it| [it.latitude_deg, it.longitude_deg]);
        let expected = parts[4].contains("55.9").then_some([55.9, -3.2]);
        assert_eq!(origin, expected, "{case}");
    }
}

#[test]
fn samples_and_fixes_of_radiate_are_files() {
    let folder = TempDir::new().unwrap();
    // The nanoseconds have no leading zeros.
    let line = |(frame, ns)| format!("Frame: {frame:06} Time: 1549986608.{ns}\n");
    let list = [(1, 1153537), (2, 53153537), (3, 103153537)];
    written(&folder, "GPS_IMU_Twist.txt", &list.map(line).concat());
    let zeros = "0,0,0 \n 0,0,0 \n 0,0,0 \n";
    for (number, latitude, yaw) in [(1, "55.9", -0.5), (2, "55.90001", 0.03532)] {
        let text = format!(
            "{latitude},-3.2,209.3 \n 0.04,0,0\n 0,0.14,0\n 0,0,1\n-0.00401,0.00605,-0.98617,-0.16556 \n0.00151,-0.00572,{yaw} \n-0.58829,0.53698,0.04222 \n{zeros}{zeros}{zeros}-7.3,-10.1,-0.3 \n0.00151,-0.00572,0.03532 \n"
        );
        written(&folder, &format!("GPS_IMU_Twist/{number:06}.txt"), &text);
    }
    for (of, expected) in [
        (Gyro, "0.00151,-0.00572,0.03532,-0.58829,0.53698,0.04222"),
        (Gnss, "0,1.1134,209.3,0.3"),
    ] {
        let path = SampleLog::find(of, &folder.path().join("Navtech_Polar")).unwrap();
        assert_eq!(path, folder.path().join("GPS_IMU_Twist"));
        let log = SampleLog::read(of, &path, None).unwrap();
        let stamps: Vec<i64> = log.samples.iter().map(|sample| sample.stamp_ns).collect();
        let stamps_ns = [1_153_537, 53_153_537].map(|ns| 1_549_986_608_000_000_000 + ns);
        assert_eq!(stamps, stamps_ns);
        assert_last(&log, expected, of.section());
        // The third has a time and no file.
        assert_eq!((log.faults.unreadable, log.faults.first_unreadable), (1, 3));
    }
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
        let log = SampleLog::read(Gyro, &written(&folder, name, &text), None).unwrap();
        let up = log.up(configured, dataset);
        assert_eq!(up.ok(), expected, "{name} {accelerations} {configured:?}");
    }
}

#[test]
fn logs_lie_at_the_places_of_the_datasets() {
    for (of, place) in [
        (Gyro, "imu_as_logged.csv"),
        (Gyro, "imu/dmu_imu.csv"),
        (Gyro, "sensor_data/xsens_imu.csv"),
        (Gyro, "vectornav.csv"),
        (Wheels, "wheels.csv"),
        (Gnss, "sensor_data/gps.csv"),
    ] {
        let folder = TempDir::new().unwrap();
        let one = ["a gyro", "the wheels", "a GNSS receiver"][of as usize - 1];
        let missing = format!("no log of {one} lies beside the scans");
        assert_refused(SampleLog::find(of, folder.path()), &missing);
        let path = written(&folder, place, "");
        let beside = |name: &str| SampleLog::find(of, &folder.path().join(name)).ok();
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
    assert_refused(SampleLog::find(Gyro, folder.path()), reason);
}

#[test]
fn what_is_no_log_is_refused_with_the_reason_or_the_remedy() {
    // The kind; the rows; the reason.
    for case in [
        "gyro|timestamp,ins_status,latitude|1547131046260961,INS_SOLUTION_GOOD,51.7|the INS logs of Oxford and OORD have positions and attitudes alone",
        "gyro||it is empty",
        "gyro|stamp_ns,gyro_x,gyro_z|1,2,3|no angular rates about three axes",
        "gyro|gyro_x,gyro_y,gyro_z|1,2,3|have no stamps",
        "gyro|stamp_ns,gyro_x,gyro_y,gyro_z,gyro_z|1,2,3,4,4|two of its columns are named \"gyro_z\"",
        "gyro|1,2,3,4,5,6,7|its 7 columns have no names",
        "gyro|1,2,3,4,5,6,7,8|first version of MulRan's xsens_imu.csv",
        "gyro|stamp_ns,gyro_x,gyro_y,gyro_z|it has no samples",
        "gyro|stamp_ns;gyro_x;gyro_y;gyro_z|1;0,1;0,2;0,3|the first in line 2: in \"1; 0,1; 0,2; 0,3\", write stamps as seconds or nanoseconds since 1970, numbers with decimal points",
        "gyro|stamp_ns,gyro_x,gyro_y,gyro_z|1;0.1;0.2;0.3|it has 1 fields in place of 4: do all rows have the mark",
        "gyro|time,gyro_x,gyro_y,gyro_z|2025-10-14T15:41:25.551Z,0,0,0|in \"2025-10-14T15:41:25.551Z; 0; 0; 0\", write stamps as seconds",
        "gyro|stamp_ns,gyro_x,gyro_y,gyro_z|1,,,|1 of its 1 rows cannot be read",
        "wheels|stamp_ns,gyro_z_radps|1,0.1|have no speed",
        "wheels|number,speed_m_s|1,1|have no stamps",
        "wheels|1,2|1,1|columns have no names",
        "wheels|stamp_ns,speed|1,120|2,121|if they are in km/h",
        "wheels|stamp_ns,speed_m_s|it has no samples",
        "wheels|stamp_ns,speed_m_s,reverse|1,9.0,1|have a direction",
        "wheels|stamp_ns,ticks,direction|1,9,back|have a direction",
        "wheels|stamp_ns,left_ticks,right_count|1,9,9|have no speed",
        "gnss|1,2,3|3 columns have no names",
        "gnss|stamp_ns,x,y|have no positions",
        "gnss|latitude,longitude|have no stamps",
        "gnss|stamp_ns,latitude,longitude|none of its 0 entries is a usable fix",
        "gnss|stamp_ns,latitude,longitude|a,b,c|1,2|5,1,1|2 of its 3 rows cannot be read, the first in line 2",
        "gnss|stamp_ns,latitude,longitude|5,50.0S,1.0E|in \"5; 50.0S; 1.0E\", write stamps as seconds or nanoseconds since 1970, numbers with decimal points, and degrees to the south and to the west with a minus",
        // A contradiction, and a word that is of no hemisphere.
        "gnss|stamp_ns,lat,n_s,lon|5,-50.0,N,1.0|6,50.0,?,1.0|2 of its 2 rows",
    ] {
        let (of, rest) = case.split_once('|').unwrap();
        let (rows, reason) = rest.rsplit_once('|').unwrap();
        assert_refused(read(kind(of), "log.csv", &rows.replace('|', "\n")), reason);
    }
    let wide = read(Gyro, "imu.csv", &"x,".repeat(200_000));
    assert_refused(wide, "its first row has 200001 columns, and at most 1000");
    let missing = SampleLog::read(Gyro, "/no/imu.csv".as_ref(), None);
    assert_refused(missing, "cannot read the log of the gyro /no/imu.csv");
}
