#![allow(clippy::unwrap_used)]
use std::fs;

use super::*;

fn from(text: &str) -> Result<Configuration, ConfigurationError> {
    let configuration = Configuration::from_table(text.parse().unwrap())?;
    configuration.validate()?;
    Ok(configuration)
}

#[test]
fn an_unknown_key_names_itself_and_the_nearest_right_one() {
    let error = from("[masking]\ntreshold = 3").unwrap_err().to_string();
    assert_eq!(
        error,
        "[masking] has no key `treshold`; did you mean `threshold`?"
    );
    let error = from("[maskin]\nkind = 'none'").unwrap_err().to_string();
    assert_eq!(
        error,
        "[the configuration] has no key `maskin`; did you mean `masking`?"
    );
    let error = from("[stages.maskin]\ncommand = ['x']")
        .unwrap_err()
        .to_string();
    assert_eq!(
        error,
        "[stages] has no key `maskin`; did you mean `masking`?"
    );
}

#[test]
fn a_mistake_in_toml_names_its_place_and_shows_nothing_of_the_file() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("run.toml");
    fs::write(&file, "[run]\nwindow = 4\n\u{1b}[2J oh\n").unwrap();
    let error = Configuration::read(&file, &[]).unwrap_err().to_string();
    assert!(
        error.contains("TOML parse error at line 3, column 2: "),
        "{error}"
    );
    assert!(
        !error.contains(char::is_control) && !error.contains("[2J"),
        "{error}"
    );
}

#[test]
fn impossible_values_are_refused() {
    for (text, part) in [
        ("[run]\nwindow = 0", "window"),
        ("[raster]\nn = 0", "raster.n"),
        ("[points]\ncapacity = 70000", "points.capacity"),
        ("[points]\ncapacity = 0", "points.capacity is 0"),
        ("[refinement]\nkeyframes = 0", "refinement.keyframes"),
        ("[masking]\nlag = 0", "lag"),
        ("[gyro]\nkind = 'log'", "[gyro]: kind is `log`, but no file"),
        (
            "[wheels]\nkind = 'log'\nfile = ''",
            "[wheels]: kind is `log`",
        ),
        ("[masking]\nthreads = 65", "threads is 65"),
        ("[masking]\nprovider = 'npu'", "npu"),
        ("[masking]\nthreshold = 300", "300"),
        ("[run]\nmode = 'live'", "rate"),
        ("[run]\nrate = -1", "rate"),
        ("[simulation]\nscans = 0", "scans"),
        (
            "[simulation]\noutput.format = 'boreas'\n[dataset]\nformat = 'oxford'",
            "output.format is boreas",
        ),
        ("[simulation]\n[dataset]\nformat = 'fomo'", "fomo"),
    ] {
        let error = from(text).unwrap_err().to_string();
        assert!(error.contains(part), "{text}: {error}");
    }
}

#[test]
fn settings_without_effect_are_named() {
    let named = |overrides: &[&str]| {
        let overrides: Vec<String> = overrides.iter().map(|it| (*it).to_owned()).collect();
        let configuration = Configuration::of_overrides(&overrides).unwrap();
        configuration.without_effect(&overrides).unwrap()
    };
    let sentence = "gyro.file is set and has no effect, since gyro.kind is `none`: it needs `log`";
    assert_eq!(named(&["gyro.file=a.csv"]), [sentence]);
    for idle in [
        &["gyro.kind=auto", "gyro.file=a.csv"][..],
        &["wheels.late_s=1"],
        &["gnss.listen=127.0.0.1:1"],
        &["objects.even_likely=0.5"],
        &["masking.kind=none", "masking.threshold=60"],
    ] {
        assert_eq!(named(idle).len(), 1, "{idle:?}");
    }
    for used in [
        &["gyro.kind=log", "gyro.file=a.csv", "gyro.late_s=1"][..],
        &["gyro.kind=none", "run.window=3", "simulation.scans=3"],
        &["masking.threshold=60", "simulation.gyro.late_s=1"],
    ] {
        assert_eq!(named(used), [""; 0], "{used:?}");
    }
}

#[test]
fn a_simulation_has_the_form_that_the_dataset_is_read_in() {
    let format = |text: &str| from(text).unwrap().simulation.unwrap().output.format;
    assert_eq!(
        format("[simulation]\n[dataset]\nformat = 'boreas-rt'"),
        Some(OutputFormat::Boreas)
    );
    assert_eq!(format("[simulation]"), None);
}

#[test]
fn a_resolved_configuration_repeats_itself() {
    let configuration =
        from("[run]\nrate = 4\n[source]\ndata = '/data'\n[raster]\ncell_m = 0.8\n[stages.masking]\ncommand = ['mine']")
            .unwrap();
    let text = configuration.to_toml().unwrap();
    assert_eq!(from(&text).unwrap(), configuration);
    let begun = text.parse().unwrap();
    assert_eq!(configuration.difference(&begun).unwrap(), None);
    let faster = from(&text.replace("rate = 4", "rate = 8")).unwrap();
    assert_eq!(faster.difference(&begun).unwrap(), None);
    let other = from(&text.replace("cell_m = 0.8", "cell_m = 0.4")).unwrap();
    let difference = other.difference(&begun).unwrap();
    assert_eq!(
        difference.as_deref(),
        Some("raster.cell_m was 0.8 and is now 0.4")
    );
}

#[test]
fn a_mask_in_python_takes_the_place_of_a_network() {
    let learned = "[masking]\nkind = 'learned'\nmodel = 'gyre:models/gyre-255.toml'\n";
    let python = format!("{learned}[stages.masking]\npython = 'a.py'");
    assert_eq!(
        from(learned).unwrap().odometry.masking.kind,
        MaskKind::Learned
    );
    assert_eq!(
        from(&python).unwrap().odometry.masking.kind,
        MaskKind::Threshold
    );
    let none = from("[masking]\nkind = 'none'\n[stages.masking]\npython = 'a.py'").unwrap();
    assert_eq!(none.odometry.masking.kind, MaskKind::None);
}
