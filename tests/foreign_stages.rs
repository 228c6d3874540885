//! Replaced stages that send what no stage may send: the stage that receives it refuses it by the sender's name, and the poses
//! before it are kept.

use std::{env, path::Path, process};

use bytemuck::Pod;
use gyre_messages::{
    Item, Masked, MaskedHeader, Motion, MotionEstimate, MotionHeader, PoseHeader, Refined,
    Rotation, Scan, ScanHeader, StageId, flag,
};
use gyre_pose_integration::compose;
use gyre_radar::{Dataset, DatasetOptions};
use gyre_radar_replay::SourceConfig;
use gyre_stage::{
    Launch, Sink, Source, Stage, StageCounters, StageError,
    inputs::{Joined, JoinedView, PairView, Pairs},
    reader::Received,
    sink,
    source::{self, Unreadable},
    stage,
    writer::Draft,
};

use rand::{Rng, SeedableRng, rngs::StdRng, seq::IndexedRandom};

use crate::common::{Run, recording};

/// The item that is sent wrong.
const FAULTY: u64 = 7;
/// What a foreign stage does wrong: see [`apply`].
const FAULT: &str = "GYRE_TEST_FAULT";
/// A file that exists once the fault has been sent, if it is to be sent only once.
const ONCE: &str = "GYRE_TEST_ONCE";

/// A run in which this program replaces a stage, and sends this fault.
fn run_with(stage: &str, fault: &str, once: bool) -> Run {
    let run = Run::of_recording();
    let marker = run.folder().join("sent");
    let once = match once {
        true => format!("{ONCE}='{}'", marker.display()),
        false => String::new(),
    };
    let program = env::current_exe().unwrap();
    run.stage_script(
        stage,
        &format!(
            "exec env {FAULT}='{fault}' {once} '{}' --exact foreign_stages::plays_a_foreign_stage --nocapture",
            program.display()
        ),
    )
    .set(&format!("stages.{stage}.restart.backoff_ms=10"))
}

/// Asserts that the run ends because of this fault, in a sentence that names the stage and the field, and keeps good poses only.
fn refuses(stage: &str, fault: &str, field: &str) {
    let run = run_with(stage, fault, false);
    let ended = run.finish();
    ended.failed_with(&[stage, field, "giving up"]);
    let odometry = run.odometry();
    assert!(
        !odometry.contains("NaN") && !odometry.contains("inf"),
        "{fault}: {odometry}"
    );
    let processed = run.summary()["processed"].as_u64().unwrap();
    assert!(processed <= FAULTY, "{fault}: {processed} poses");
}

#[test]
fn a_motion_that_is_not_finite_is_refused() {
    refuses("translation-search", "motion x nan", "x_m is NaN");
}

#[test]
fn a_motion_farther_than_the_raster_is_refused() {
    refuses("translation-search", "motion x 1e30", "x_m is 1");
}

#[test]
fn a_covariance_that_is_none_is_refused() {
    refuses("translation-search", "motion covariance -1", "covariance");
    refuses("refinement", "refined covariance nan", "covariance");
}

#[test]
fn a_rotation_that_is_none_is_refused() {
    refuses("rotation-search", "rotation angle 4", "angle_rad is 4");
}

#[test]
fn a_scan_whose_header_lies_is_refused() {
    refuses("radar-replay", "scan bins 1000000", "payload");
    refuses("radar-replay", "scan azimuths 2000", "azimuths");
    refuses("radar-replay", "scan stamp 1e18", "stamp");
}

#[test]
fn rasters_of_another_size_are_refused() {
    refuses("masking", "masked n 126", "n is 126");
    refuses("masking", "masked points 1000000", "points");
    refuses("masking", "masked point nan", "point 0");
}

#[test]
fn a_pose_that_is_not_finite_is_refused() {
    let run = run_with("pose-integration", "pose x nan", false);
    run.finish()
        .failed_with(&["pose-integration", "x_m is NaN"]);
}

#[test]
fn a_fault_that_does_not_come_again_costs_a_restart() {
    let run = run_with("translation-search", "motion x nan", true);
    run.finish().succeeded();
    assert!(!run.odometry().contains("NaN"));
    assert_eq!(run.summary()["processed"], recording::SCANS);
    assert_ne!(run.summary()["restarts"], serde_json::json!({}));
}

/// Numbers that break most contracts, and some that keep them.
const NUMBERS: [&str; 6] = ["NaN", "-inf", "-1", "1e300", "0", "0.5"];

/// Runs in which a stage writes a number anywhere into a header: refused by its name, or no harm is done.
fn any_word_is_refused_or_harmless(runs: u64) {
    let stages = [
        ("masking", "masked"),
        ("rotation-search", "rotation"),
        ("translation-search", "motion"),
        ("refinement", "refined"),
    ];
    for seed in 0..runs {
        let mut random = StdRng::seed_from_u64(seed);
        let (stage, topic) = stages[seed as usize % stages.len()];
        let (word, number) = (random.random_range(0..64), NUMBERS.choose(&mut random));
        let fault = format!("{topic} word-{word} {}", number.unwrap());
        println!("seed {seed}: {fault}");
        let run = run_with(stage, &fault, false);
        let ended = run.finish();
        if !ended.status.success() {
            ended.failed_with(&[stage]);
            continue;
        }
        assert_eq!(run.summary()["processed"], recording::SCANS, "{fault}");
        let odometry = run.odometry();
        assert!(
            !odometry.contains("NaN") && !odometry.contains("inf"),
            "{fault}"
        );
    }
}

#[test]
fn any_word_of_a_header_is_refused_or_harmless() {
    any_word_is_refused_or_harmless(8);
}

#[test]
#[ignore = "takes some minutes: the same with more words"]
fn many_words_of_headers_are_refused_or_harmless() {
    any_word_is_refused_or_harmless(200);
}

// The foreign stages.

/// Not a test: the program of a replaced stage, if the environment says so.
#[test]
fn plays_a_foreign_stage() {
    let Ok(fault) = env::var(FAULT) else { return };
    let fault = Fault::parse(&fault);
    let work = match fault.topic.as_str() {
        "scan" => replay,
        "masked" => |launch: &Launch, fault| stage::run(launch, &mut ForeignMasking(fault)),
        "rotation" => |launch: &Launch, fault| stage::run(launch, &mut ForeignRotation(fault)),
        "motion" => |launch: &Launch, fault| stage::run(launch, &mut ForeignTranslation(fault)),
        "refined" => |launch: &Launch, fault| stage::run(launch, &mut ForeignRefinement(fault)),
        _ => |launch: &Launch, fault| {
            let mut sink = ForeignIntegration { fault, last: None };
            sink::run::<Refined, _>(launch, &mut sink)
        },
    };
    let name = fault.topic.clone();
    let ended: Result<StageCounters, StageError> =
        Launch::from_environment(&name).and_then(|launch| work(&launch, fault));
    process::exit(match ended {
        Ok(_) => 0,
        Err(error) => {
            eprintln!("foreign {name}: {error}");
            error.exit_code().into()
        }
    });
}

/// A field of a topic and the value that it gets.
struct Fault {
    topic: String,
    field: String,
    value: f64,
}

impl Fault {
    fn parse(text: &str) -> Self {
        let words: Vec<&str> = text.split(' ').collect();
        Self {
            topic: words[0].to_owned(),
            field: words[1].to_owned(),
            value: words[2].parse().unwrap(),
        }
    }

    /// Returns the value for a field of item `seq`, if it is to be sent wrong now.
    fn of(&self, field: &str, seq: u64) -> Option<f64> {
        if self.field != field || seq != FAULTY {
            return None;
        }
        let sent = env::var_os(ONCE);
        if let Some(marker) = sent.as_deref().map(Path::new) {
            if marker.exists() {
                return None;
            }
            std::fs::write(marker, "").unwrap();
        }
        Some(self.value)
    }
}

impl Fault {
    /// Replaces a word of a header behind its item, if that is the fault.
    fn edit<H: Pod>(&self, header: &mut H, seq: u64) {
        let word = self.field.strip_prefix("word-");
        let Some(word) = word.map(|word| word.parse::<usize>().unwrap()) else {
            return;
        };
        let words = &mut bytemuck::bytes_of_mut(header)[size_of::<Item>()..];
        let word = word % (words.len() / 8) * 8;
        if let Some(value) = self.of(&self.field, seq) {
            words[word..word + 8].copy_from_slice(&value.to_le_bytes());
        }
    }
}

struct ForeignRotation(Fault);

impl Stage for ForeignRotation {
    type Inputs = Pairs<Masked>;
    type Output = Rotation;
    const HOP: StageId = StageId::RotationSearch;

    fn process(
        &mut self,
        input: PairView<'_, Masked>,
        output: &mut Draft<Rotation>,
    ) -> Result<(), StageError> {
        let rotation = &mut output.header().rotation;
        if let Some(value) = self.0.of("angle", input.current.item().seq) {
            rotation.angle_rad = value;
        }
        self.0.edit(output.header(), input.current.item().seq);
        Ok(())
    }
}

/// A motion of a meter forward.
fn motion(fault: &Fault, seq: u64, interval_ns: i64) -> MotionEstimate {
    let x_m = fault.of("x", seq).unwrap_or(1.0);
    let variance = fault.of("covariance", seq).unwrap_or(0.01);
    MotionEstimate {
        x_m,
        searched: [1.0, 0.0, 0.0],
        covariance: [variance, 0.0, 0.0, 0.01, 0.0, 1e-4],
        interval_ns,
        ..MotionEstimate::default()
    }
}

struct ForeignTranslation(Fault);

impl Stage for ForeignTranslation {
    type Inputs = Joined<Masked, Rotation>;
    type Output = Motion;
    const HOP: StageId = StageId::TranslationSearch;

    fn process(
        &mut self,
        input: JoinedView<'_, Masked, Rotation>,
        output: &mut Draft<Motion>,
    ) -> Result<(), StageError> {
        let item = input.pair.current.item();
        if !item.is(flag::BREAK) {
            output.header().motion = motion(&self.0, item.seq, input.pair.interval_ns());
        }
        self.0.edit(output.header(), item.seq);
        Ok(())
    }
}

struct ForeignRefinement(Fault);

impl Stage for ForeignRefinement {
    type Inputs = Joined<Masked, Motion>;
    type Output = Refined;
    const HOP: StageId = StageId::Refinement;

    fn process(
        &mut self,
        input: JoinedView<'_, Masked, Motion>,
        output: &mut Draft<Refined>,
    ) -> Result<(), StageError> {
        let (item, searched) = (input.pair.current.item(), input.other.header().motion);
        if !item.is(flag::BREAK) {
            output.header().motion = motion(&self.0, item.seq, searched.interval_ns);
        }
        self.0.edit(output.header(), item.seq);
        Ok(())
    }
}

struct ForeignMasking(Fault);

impl Stage for ForeignMasking {
    type Inputs = Pairs<Scan>;
    type Output = Masked;
    const HOP: StageId = StageId::Masking;

    fn process(
        &mut self,
        input: PairView<'_, Scan>,
        output: &mut Draft<Masked>,
    ) -> Result<(), StageError> {
        let seq = input.current.item().seq;
        let (header, values) = output.parts::<f32>();
        values.fill(0.0);
        let fault = |field: &str| self.0.of(field, seq);
        let raster = MaskedHeader::split(values, 127, 1).unwrap();
        raster.points[0].x_m = fault("point").unwrap_or(1.0) as f32;
        *header = MaskedHeader {
            n: fault("n").unwrap_or(127.0) as u32,
            rasters: 1,
            cell_m: 0.8,
            points: fault("points").unwrap_or(1.0) as u32,
            ..MaskedHeader::default()
        };
        self.0.edit(header, seq);
        Ok(())
    }
}

/// Plays the recording, with a fault in one header.
fn replay(launch: &Launch, fault: Fault) -> Result<StageCounters, StageError> {
    let config: SourceConfig = launch.section("source")?;
    let dataset = gyre_radar::open(&config.data, &DatasetOptions::default()).unwrap();
    let tolerance = config.tolerance();
    source::run(launch, &mut ForeignSource { fault, dataset }, &tolerance)
}

struct ForeignSource {
    fault: Fault,
    dataset: Box<dyn Dataset>,
}

impl Source for ForeignSource {
    const HOP: StageId = StageId::RadarReplay;

    fn scans(&self) -> std::ops::Range<usize> {
        0..self.dataset.len()
    }

    fn complete_ns(&self, index: usize) -> Option<i64> {
        self.dataset.nominal_stamp_ns(index)
    }

    fn period_ns(&self) -> i64 {
        self.dataset.period_ns()
    }

    fn drops_missed_scans(&self) -> bool {
        true
    }

    fn read(
        &mut self,
        index: usize,
        header: &mut ScanHeader,
        bytes: &mut [u8],
    ) -> Result<(), Unreadable> {
        let geometry = self.dataset.read(index, header.slot(bytes)).unwrap();
        header.set_geometry(&geometry);
        let fault = |field: &str| self.fault.of(field, index as u64);
        if let Some(bins) = fault("bins") {
            header.bins = bins as u32;
        }
        if let Some(azimuths) = fault("azimuths") {
            header.azimuths = azimuths as u32;
        }
        if let Some(stamp_ns) = fault("stamp") {
            header.azimuth_stamp_ns[3] = stamp_ns as i64;
        }
        Ok(())
    }
}

struct ForeignIntegration {
    fault: Fault,
    last: Option<PoseHeader>,
}

impl Sink for ForeignIntegration {
    const HOP: StageId = StageId::PoseIntegration;

    fn restore(&mut self, _: usize) -> Result<(Vec<PoseHeader>, bool), StageError> {
        Ok((Vec::new(), false))
    }

    fn integrate(
        &mut self,
        motion: &MotionHeader,
        _: Option<&Received<Masked>>,
    ) -> Result<PoseHeader, StageError> {
        let pose = compose(self.last.as_ref(), motion);
        self.last = Some(pose);
        let x_m = self.fault.of("x", pose.item.seq).unwrap_or(pose.x_m);
        Ok(PoseHeader { x_m, ..pose })
    }

    fn end(&mut self, _: &Item) -> Result<(), StageError> {
        Ok(())
    }
}
