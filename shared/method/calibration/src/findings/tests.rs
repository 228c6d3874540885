use super::*;

/// A drive with this range offset, which is configured as -0.1 m.
fn found(value: f64, sigma: f64) -> Found {
    let offset = Constant::new(Fact::RangeOffset, -0.1, Estimate { value, sigma }, true);
    Found {
        scans: 100,
        path_m: 500.0,
        pairs: 300,
        has_settled: true,
        constants: vec![offset],
        differences: None,
        resolution: None,
        notes: Vec::new(),
    }
}

#[test]
fn only_what_contradicts_the_configuration_is_written() {
    for (value, sigma, shown, written) in [
        (
            -0.5,
            0.02,
            "CONTRADICTS",
            "\nrange_offset_m = -0.500 # \u{b1} 0.020, configured -0.100\n",
        ),
        (
            -0.12,
            0.02,
            "agrees",
            "\n# range_offset_m stays -0.100: -0.120 \u{b1} 0.020 agrees with",
        ),
        (
            -0.9,
            0.25,
            "too uncertain",
            "\n# range_offset_m stays -0.10: -0.90 \u{b1} 0.25 is too uncertain",
        ),
    ] {
        let found = found(value, sigma);
        let (printed, file) = (found.to_string(), found.toml());
        assert!(printed.contains(shown), "{printed}");
        assert!(file.contains(written), "{file}");
    }
}

#[test]
fn what_makes_the_parts_differ_more_is_not_written() {
    let mut found = found(-0.5, 0.02);
    found.compare(|_| Ok([1.0, 1.1])).unwrap();
    let file = found.toml();
    let stays = "# range_offset_m stays -0.100: -0.500 \u{b1} 0.020 makes the parts of the scans differ more\n";
    assert!(file.ends_with(stays), "{file}");
}
