use std::fs;

use super::*;

fn from(text: &str) -> Result<Configuration, ConfigurationError> {
    let configuration = Configuration::from_table(text.parse().unwrap())?;
    configuration.validate()?;
    Ok(configuration)
}

#[test]
fn a_mistake_in_toml_names_its_place_and_shows_nothing_of_the_file() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("run.toml");
    for (text, place) in [
        (
            "[run]\nwindow = 4\n\u{1b}[2J oh\n".to_owned(),
            "3, column 2: ",
        ),
        ("a = ".to_owned() + &"[".repeat(1_000_000), ""),
        ("[".to_owned() + &"a.".repeat(1_000_000) + "b]", ""),
    ] {
        fs::write(&file, text).unwrap();
        let error = Configuration::read(&file, &[]).unwrap_err().to_string();
        let place = format!("TOML parse error at line {place}");
        assert!(error.contains(&place) && error.len() < 1000, "{error}");
        let is_shown = error.contains(char::is_control) || error.contains("[2J");
        assert!(!is_shown, "{error}");
    }
}

/// Settings, and words of the sentence that refuses them.
const IMPOSSIBLE: &str = r#"
masking.treshold=3 | [masking] has no key `treshold`; did you mean `threshold`?
maskin.kind=none | [the configuration] has no key `maskin`; did you mean `masking`?
stages.maskin.python=a.py | [stages] has no key `maskin`; did you mean `masking`?
run.window=0 | run.window is 0 | 1 to 64
run.window=-3 | [run] | -3
run.rate=fast | rate is `fast` | `realtime`
run.rate=-1 | rate
run.mode=live | live | rate
run.stall_timeout_s=inf | stall_timeout_s is inf | 0 or more
run.scheduling.nice=-21 | nice | -20 to 19
raster.n=0 | raster.n
raster.cell_m=-1.0 | raster | cell_m
raster.cell_m=nan | raster.cell_m is
raster.min_range_m=-1.0 | raster.min_range_m is
raster.cel_m=0.4 | [raster] has no key `cel_m`
raster.cell_m=wide | [raster]: cell_m is "wide", but must be a number
points.capacity=70000 | points.capacity
points.capacity=0 | points.capacity is 0 | 1 or more
points.beam_deg=nan | points.beam_deg is
points.range_cell_m=0.0 | points.range_cell_m is
points.min_range_m=-1.0 | points.min_range_m is
points.max_range_m=5.0 | points.max_range_m is
refinement.kind=global-map | global-map | local-map
refinement.keyframes=0 | refinement.keyframes is 0 | 1 to 64
refinement.cell_m=-0.4 | refinement.cell_m is -0.4 | 0.05 to 10
refinement.reach_m=1.0 | refinement.reach_m is 1 | 8 to 1000 cells
refinement.min_overlap=1.5 | refinement.min_overlap is 1.5 | 0 to 1
refinement.variance_scale=nan | refinement.variance_scale is NaN | positive
masking.kind=magic | magic | threshold
masking.lag=0 | lag
masking.lag=99 | masking.lag is 99 | 16
masking.threads=65 | [masking] | threads is 65 | 1 to 64
masking.provider=npu | npu
masking.backend=tract | tract | rten
masking.backend=rten; masking.runtime=/anywhere | runtime is a setting of ONNX Runtime
masking.backend=rten; masking.provider=cuda; masking.kind=learned | provider is a setting of ONNX Runtime | `onnxruntime`
masking.threshold=256 | threshold is `256`, but must be a whole number
masking.threshold=abc | [masking]: threshold is "abc", but must be a whole number from 0 to 255
rotation.band_high=7.0 | rotation | band_high
rotation.band_low=nan | rotation.band_low is
rotation.reach_deg=91.0 | rotation.reach_deg is 91
rotation.angles=0 | rotation.angles is 0
rotation.angels=720 | [rotation] has no key `angels`
translation.reach=3.0 | [translation] has no key `reach`
dataset.format=oxfort | oxfort | oxford
stages.masking.command=./x | [stages.masking]: command is "./x", but must be a list, as in ["./x"]
stages.masking.restart.limit=-1 | masking | -1
stages.refinement.python=a.py | stages.refinement | masking, rotation-search, translation-search
search.kind=exhaustive; stages.rotation-search.python=a.py | stages.rotation-search | no such stage
stages.masking.python=a.py; stages.masking.command=['x'] | stages.masking | remove one of them
gyro.kind=log | [gyro]: kind is `log`, but no file
wheels.kind=log; wheels.file='' | [wheels]: kind is `log`
slam.kind=graph; gnss.kind=log | no file is named
gnss.kind=auto | gnss | set slam.kind to `graph`
slam.kind=graph; gnss.kind=udp | gnss | kind is `udp` | no live radar | `auto`
LIVE; slam.kind=graph; gnss.kind=ros2 | gnss | kind is `ros2` | "udp"
LIVE; slam.kind=graph; gnss.kind=udp; gnss.listen=127.0.0.2:7; gyro.kind=udp; gyro.listen=127.0.0.2:7 | gnss | as that of gyro
record.keep_mb=9 | [record]: keep_mb and keep_s remove whole files | split_mb
record.split_mb=1; record.keep_s=-1.0 | keep_s is -1 | 0 or more
budget.max_ms=-1.0 | [budget]: max_ms is -1 | 0 or more
slam.map=a | [slam]: map is set | `graph`
LIVE; source.address='' | address is missing
source.kind=colossus; source.address=127.0.0.1:9 | set run.mode to `live`
LIVE; source.address=udp://239.192.43.3 | `udp://239.192.43.3` is invalid for datagrams
link.side=base; link.cut=scan; run.mode=live; run.rate=realtime | link | masking sheds load
simulation.scans=0 | simulation | scans
simulation.drive.speed_mps=1e9 | speed_mps | 40
simulation.output.format=boreas; dataset.format=oxford | output.format is boreas
simulation.seed=1; dataset.format=fomo | fomo
"#;
/// The settings of a live radar.
const LIVE: &str =
    "source.kind=colossus; source.address=127.0.0.1:9; run.mode=live; run.rate=realtime";

#[test]
fn impossible_values_are_refused_with_the_key_and_what_is_possible() {
    for row in IMPOSSIBLE.trim().lines() {
        let row = row.replace("LIVE", LIVE);
        let mut cells = row.split(" | ");
        let settings = cells.next().unwrap().split("; ").map(str::to_owned);
        let refused = Configuration::of_overrides(&settings.collect::<Vec<_>>());
        let error = refused.unwrap_err().to_string();
        for word in cells {
            assert!(error.contains(word), "{row}: {error}");
        }
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
        from("[run]\nrate = 4\n[source]\ndata = '/data'\n[raster]\ncell_m = 0.8\n[masking]\nthreshold = 70\n[rotation]\nwindow = 'hann'\n[stages.masking]\ncommand = ['mine']")
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
