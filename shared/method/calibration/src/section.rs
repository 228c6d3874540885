//! `calibration.toml`: the section `[dataset]` with the constants that the drive determines.

use std::fmt::Write;

use crate::findings::Found;

pub fn toml(found: &Found) -> String {
    let mut text = format!(
        "# Found by gyre calibrate from {} scans, {:.0} m.\n\n[dataset]\n",
        found.scans, found.path_m
    );
    for constant in found.proposed() {
        let digits = digits(constant.found.sigma);
        let _ = writeln!(
            text,
            "{} = {:.digits$} # \u{b1} {:.digits$}: {}",
            constant.label.0, constant.found.value, constant.found.sigma, constant.basis
        );
    }
    for constant in found.kept() {
        let reason = match constant.is_determined() {
            true => "makes the scans overlap less",
            false => "is no better",
        };
        let _ = writeln!(
            text,
            "# {} stays as configured: {:.5} \u{b1} {:.5} {reason}",
            constant.label.0, constant.found.value, constant.found.sigma
        );
    }
    // Last, since a section begins: the keys before are of the dataset.
    if let Some(min_range_m) = found.min_range_m {
        for section in ["points", "raster"] {
            let _ = writeln!(
                text,
                "\n[{section}]\nmin_range_m = {min_range_m:.1} # beyond the vehicle's own reflections"
            );
        }
    }
    text
}

fn digits(sigma: f64) -> usize {
    (1.0 - sigma.log10().floor()).clamp(1.0, 9.0) as usize
}
