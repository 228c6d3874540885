//! Nothing that a raster may hold makes the search panic, lie or allocate.

use crate::common::{pair, pose_deg, search};
use gyre_matching::{
    RotationConfig, RotationForm, RotationSearch, TranslationConfig, TranslationSearch,
};
use ndarray::Array2;

const N: usize = 65;
const CELL_M: f64 = 0.8;

#[test]
fn empty_rasters_give_no_motion_and_a_wide_covariance() {
    let empty = Array2::zeros((N, N));
    let (angle, motion) = search(N, CELL_M, &Default::default(), &empty, &empty);
    assert_eq!([angle.angle_rad, angle.score], [0.0; 2]);
    assert!(angle.runner_up.is_none());
    let found = [motion.x_m, motion.y_m, motion.yaw_rad, motion.score];
    assert_eq!(found, [0.0; 4]);
    assert!(angle.variance_rad2.sqrt().to_degrees() > 5.0 && motion.covariance[(0, 0)] > 10.0);
}

#[test]
fn a_few_cells_that_are_nan_change_little() {
    let motion = pose_deg(1.0, 0.5, 3.0);
    let (earlier, mut later) = pair(127, 0.4, motion, 8);
    later.iter_mut().step_by(997).for_each(|v| *v = f32::NAN);
    let found = search(127, 0.4, &Default::default(), &earlier, &later).1;
    assert!(
        (found.x_m - 1.0).abs() < 0.1 && (found.y_m - 0.5).abs() < 0.1,
        "{found:?}"
    );
}

#[test]
fn rasters_of_another_shape_or_layout_are_rejected() {
    let mut rotation = RotationSearch::new(N, &RotationConfig::default()).unwrap();
    let mut spectrum = rotation.new_spectrum();
    let small = Array2::zeros((7, N));
    let error = rotation.spectrum(small.view(), &mut spectrum).unwrap_err();
    assert_eq!(error.to_string(), "raster is 7 x 65: expected 65 x 65");
    let raster = Array2::zeros((N, N));
    let error = rotation.spectrum(raster.t(), &mut spectrum).unwrap_err();
    let words = "raster is not in row-major, contiguous layout";
    assert_eq!(error.to_string(), words);
    let line14 = RotationConfig {
        form: RotationForm::ProfileMean,
        ..RotationConfig::default()
    };
    let mut other = RotationSearch::new(N, &line14).unwrap();
    assert!(other.search(&spectrum, &spectrum, None).is_err());
}

#[test]
fn impossible_configurations_name_the_key() {
    let band = RotationConfig {
        band_high: 0.5,
        ..RotationConfig::default()
    };
    let band = RotationSearch::new(N, &band).err().unwrap().to_string();
    assert!(band.starts_with("rotation.band_high is 0.5, but must be"));
    let far = TranslationConfig {
        reach_m: 30.0,
        ..TranslationConfig::default()
    };
    let far = TranslationSearch::new(N, CELL_M, &far).err().unwrap();
    assert!(far.to_string().contains("reach_m is 30"));
    assert!(TranslationSearch::new(N, f64::NAN, &TranslationConfig::default()).is_err());
    assert!(RotationSearch::new(3, &RotationConfig::default()).is_err());
}
