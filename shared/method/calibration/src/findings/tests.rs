use super::*;
use crate::{Estimate, toml};

/// An offset that the drive determines and that contradicts the configured one.
fn found(is_proposed: bool, overlap: [f64; 2]) -> Found {
    let offset = Constant {
        label: ("range_offset_m", "range offset", "m", 1.0),
        configured: -0.1,
        found: Estimate::new(-0.5, 0.02),
        useful_sigma: 0.2,
        has_settled: true,
        is_proposed,
        basis: "overlap".to_owned(),
    };
    Found {
        scans: 100,
        path_m: 500.0,
        has_settled: true,
        overlap,
        constants: vec![offset],
        resolution: Err("as configured".to_owned()),
        min_range_m: None,
        reflections: None,
    }
}

#[test]
fn what_makes_the_scans_overlap_less_is_not_proposed() {
    let found = found(false, [0.43, 0.42]);
    let said = found.to_string();
    assert!(
        said.contains("-0.5000 \u{b1} 0.0200 m, configured -0.1000: not proposed"),
        "{said}"
    );
    let text = toml(&found);
    let stays = "# range_offset_m stays as configured: -0.50000 \u{b1} 0.02000 makes the scans overlap less\n";
    assert!(text.ends_with(stays), "{text}");
    assert!(text.contains("[dataset]\n# range_offset_m"), "{text}");
    assert_eq!(
        found.overlap(),
        "overlap of the scans  0.4300 as configured, 0.4200 with what was found, which is less: it is not proposed"
    );
}

#[test]
fn what_is_said_to_contradict_is_what_is_written() {
    let found = found(true, [0.42, 0.43]);
    assert!(found.to_string().contains("CONTRADICTS"));
    assert!(toml(&found).contains("\nrange_offset_m = -0.500 # "));
    assert_eq!(
        found.overlap(),
        "overlap of the scans  0.4200 as configured, 0.4300 with what is proposed"
    );
}

#[test]
fn the_range_of_the_vehicle_is_written_for_points_and_rasters() {
    let found = Found {
        min_range_m: Some(3.5),
        ..found(true, [0.42, 0.43])
    };
    let written = toml(&found);
    for section in ["points", "raster"] {
        let expected = format!("\n[{section}]\nmin_range_m = 3.5 # ");
        assert!(written.contains(&expected), "{written}");
    }
}

#[test]
fn several_drives_tell_together_what_none_tells_alone() {
    let of = |value: f64, sigma: f64, min_range_m| {
        let mut found = found(false, [0.42, 0.43]);
        found.constants[0].found = Estimate { value, sigma };
        found.min_range_m = min_range_m;
        found
    };
    let drives = [of(-0.5, 0.25, None), of(-0.4, 0.25, Some(3.5))];
    assert!(
        drives
            .iter()
            .all(|drive| !drive.constants[0].is_determined())
    );
    let both = Found::mean(&[&drives[0], &drives[1]]).compared([0.42, 0.43]);
    assert_eq!(
        (both.scans, both.path_m, both.min_range_m),
        (200, 1000.0, Some(3.5))
    );
    let offset = &both.constants[0];
    assert!((offset.found.value + 0.45).abs() < 1e-12);
    assert!((offset.found.sigma - 0.25 / 2f64.sqrt()).abs() < 1e-12);
    assert!(offset.is_determined() && offset.is_proposed);
    assert_eq!(
        offset.basis,
        "of the drives -0.5000 \u{b1} 0.2500; -0.4000 \u{b1} 0.2500"
    );
    assert!((both.change()[Fact::RangeOffset as usize] + 0.35).abs() < 1e-12);
    // An estimate that one drive rejects is rejected for all, as is an estimate that fits all
    // together less well.
    let rejecting = of(-0.5, 0.1, None);
    let rejected = Found::mean(&[&rejecting, &drives[1]]);
    assert!(!rejected.constants[0].is_proposed);
    assert_eq!(rejected.change(), FactVector::zeros());
    let less = Found::mean(&[&drives[0], &drives[1]]).compared([0.43, 0.42]);
    assert!(!less.constants[0].is_proposed && less.overlap().contains("which is less"));
}
