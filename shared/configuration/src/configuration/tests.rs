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
fn impossible_values_are_refused_with_the_key_and_what_is_possible() {
    for (text, words) in [
        ("[run]\nwindow = 0", &["run.window is 0", "1 to 64"][..]),
        ("[run]\nwindow = -3", &["[run]", "-3"]),
        ("[run]\nrate = 'fast'", &["rate is `fast`", "`realtime`"]),
        ("[run]\nrate = -1", &["rate"]),
        ("[run]\nmode = 'live'", &["live", "rate"]),
        (
            "[run]\nstall_timeout_s = inf",
            &["stall_timeout_s is inf", "0 or more"],
        ),
        ("[run]\nscheduling.nice = -21", &["nice", "-20 to 19"]),
        ("[raster]\nn = 0", &["raster.n"]),
        ("[raster]\ncell_m = -1.0", &["raster", "cell_m"]),
        (
            "[raster]\ncell_m = 'wide'",
            &["[raster]: cell_m is \"wide\", but must be a number"],
        ),
        ("[points]\ncapacity = 70000", &["points.capacity"]),
        (
            "[points]\ncapacity = 0",
            &["points.capacity is 0", "1 or more"],
        ),
        (
            "[refinement]\nkind = 'global-map'",
            &["global-map", "local-map"],
        ),
        (
            "[refinement]\nkeyframes = 0",
            &["refinement.keyframes = 0", "1 to 64"],
        ),
        (
            "[refinement]\ncell_m = -0.4",
            &["refinement.cell_m = -0.4", "0.05 to 10"],
        ),
        (
            "[refinement]\nreach_m = 1.0",
            &["refinement.reach_m = 1", "8 to 1000 cells"],
        ),
        (
            "[refinement]\nmin_overlap = 1.5",
            &["refinement.min_overlap = 1.5", "0 to 1"],
        ),
        (
            "[refinement]\nvariance_scale = nan",
            &["refinement.variance_scale = NaN", "positive"],
        ),
        ("[masking]\nkind = 'magic'", &["magic", "threshold"]),
        ("[masking]\nlag = 0", &["lag"]),
        ("[masking]\nlag = 99", &["masking.lag is 99", "16"]),
        (
            "[masking]\nthreads = 65",
            &["[masking]", "threads is 65", "1 to 64"],
        ),
        ("[masking]\nprovider = 'npu'", &["npu"]),
        (
            "[masking]\nbackend = 'rten'\nprovider = 'cuda'\nkind = 'learned'",
            &["provider is a setting of ONNX Runtime", "`onnxruntime`"],
        ),
        (
            "[masking]\nthreshold = 256",
            &["threshold is `256`, but must be a whole number"],
        ),
        (
            "[masking]\nthreshold = 'abc'",
            &["[masking]: threshold is \"abc\", but must be a whole number from 0 to 255"],
        ),
        ("masking = 3", &["masking"]),
        ("[rotation]\nband_high = 7.0", &["rotation", "band_high"]),
        ("[dataset]\nformat = 'oxfort'", &["oxfort", "oxford"]),
        (
            "[stages.masking]\ncommand = './x'",
            &["[stages.masking]: command is \"./x\", but must be a list, as in [\"./x\"]"],
        ),
        (
            "[stages.masking]\nrestart = { limit = -1 }",
            &["masking", "-1"],
        ),
        (
            "[stages.masking]\nrestart = { window_s = -1.0 }",
            &["stages.masking", "window_s is -1"],
        ),
        (
            "[stages.refinement]\npython = 'a.py'",
            &[
                "stages.refinement",
                "masking, rotation-search, translation-search",
            ],
        ),
        (
            "[search]\nkind = 'exhaustive'\n[stages.rotation-search]\npython = 'a.py'",
            &["stages.rotation-search", "no such stage"],
        ),
        (
            "[stages.masking]\npython = 'a.py'\ncommand = ['x']",
            &["stages.masking", "remove one of them"],
        ),
        (
            "[gyro]\nkind = 'log'",
            &["[gyro]: kind is `log`, but no file"],
        ),
        (
            "[wheels]\nkind = 'log'\nfile = ''",
            &["[wheels]: kind is `log`"],
        ),
        (
            "[slam]\nkind = 'graph'\n[gnss]\nkind = 'log'",
            &["no file is named"],
        ),
        (
            "[gnss]\nkind = 'auto'",
            &["gnss", "set slam.kind to `graph`"],
        ),
        (
            "[slam]\nkind = 'graph'\n[gnss]\nkind = 'udp'",
            &["gnss", "kind is `udp`", "no live radar", "`auto`"],
        ),
        (
            "[source]\nkind = 'colossus'\naddress = '127.0.0.1:9'\n[run]\nmode = 'live'\nrate = 'realtime'\n\
             [slam]\nkind = 'graph'\n[gnss]\nkind = 'ros2'",
            &["gnss", "kind is `ros2`", "\"udp\""],
        ),
        (
            "[source]\nkind = 'colossus'\naddress = '127.0.0.1:9'\n[run]\nmode = 'live'\nrate = 'realtime'\n\
             [slam]\nkind = 'graph'\n[gnss]\nkind = 'udp'\nlisten = '127.0.0.2:7'\n\
             [gyro]\nkind = 'udp'\nlisten = '127.0.0.2:7'",
            &["gnss", "as that of gyro"],
        ),
        (
            "[budget]\nmax_ms = -1.0",
            &["[budget]: max_ms is -1", "0 or more"],
        ),
        ("[slam]\nmap = 'a'", &["[slam]: map is set", "`graph`"]),
        (
            "[source]\nkind = 'colossus'\n[run]\nmode = 'live'\nrate = 'realtime'",
            &["address is missing"],
        ),
        (
            "[source]\nkind = 'colossus'\naddress = '127.0.0.1:9'",
            &["set run.mode to `live`"],
        ),
        (
            "[source]\nkind = 'colossus'\naddress = 'udp://239.192.43.3'\n[run]\nmode = 'live'\nrate = 'realtime'",
            &["`udp://239.192.43.3` is none for datagrams"],
        ),
        (
            "[link]\nside = 'base'\ncut = 'scan'\n[run]\nmode = 'live'\nrate = 'realtime'",
            &["link", "masking sheds load"],
        ),
        ("[simulation]\nscans = 0", &["simulation", "scans"]),
        ("[simulation.drive]\nspeed_mps = 1e9", &["speed_mps", "40"]),
        (
            "[simulation]\noutput.format = 'boreas'\n[dataset]\nformat = 'oxford'",
            &["output.format is boreas"],
        ),
        ("[simulation]\n[dataset]\nformat = 'fomo'", &["fomo"]),
    ] {
        let error = from(text).unwrap_err().to_string();
        for word in words {
            assert!(error.contains(word), "{text}: {error}");
        }
    }
}

#[test]
fn a_configuration_of_many_brackets_is_refused_in_a_sentence() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("run.toml");
    for text in [
        "a = ".to_owned() + &"[".repeat(1_000_000),
        "[".to_owned() + &"a.".repeat(1_000_000) + "b]",
    ] {
        fs::write(&file, text).unwrap();
        let error = Configuration::read(&file, &[]).unwrap_err().to_string();
        assert!(
            error.contains("TOML parse error") && error.len() < 1000,
            "{error}"
        );
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
        &["wheels.delay_s=1"],
        &["gnss.listen=127.0.0.1:1"],
        &["objects.even_likely=0.5"],
        &["masking.kind=none", "masking.threshold=60"],
    ] {
        assert_eq!(named(idle).len(), 1, "{idle:?}");
    }
    for used in [
        &["gyro.kind=log", "gyro.file=a.csv", "gyro.delay_s=1"][..],
        &["gyro.kind=none", "run.window=3", "simulation.scans=3"],
        &["masking.threshold=60", "simulation.gyro.delay_s=1"],
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
