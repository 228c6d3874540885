//! Stages that send a fault: each does only the minimum for its topic.

use std::{env, path::Path};

use gyre_contract::{
    Item, Masked, MaskedHeader, Motion, MotionEstimate, MotionHeader, PoseHeader, Refined,
    Rotation, Scan, ScanHeader, StageId, compose, flag,
    run::{SourceConfig, StageCounters},
};
use gyre_datasets::{Dataset, DatasetOptions};
use gyre_stage::{
    Launch, Sink, Source, Stage,
    inputs::{Joined, JoinedView, PairView, Pairs},
    sink,
    source::{self, Unreadable},
    stage,
};
use gyre_transport::{RunError, reader::Received, writer::Draft};

/// The item that is sent wrong.
pub const FAULTY: u64 = 7;
/// The fault of a foreign stage: a topic, a field of it and a value, see [`Fault`].
pub const FAULT: &str = "GYRE_TEST_FAULT";
/// A file that exists once the fault has been sent, if it is to be sent only once.
pub const ONCE: &str = "GYRE_TEST_ONCE";

pub fn play(launch: &Launch, fault: Fault) -> Result<StageCounters, RunError> {
    match fault.topic.as_str() {
        "scan" => replay(launch, fault),
        "masked" => stage::run(launch, &mut ForeignMasking(fault)),
        "rotation" => stage::run(launch, &mut ForeignRotation(fault)),
        "motion" => stage::run(launch, &mut ForeignTranslation(fault)),
        "refined" => stage::run(launch, &mut ForeignRefinement(fault)),
        _ => {
            let mut sink = ForeignIntegration { fault, last: None };
            sink::run(launch, &mut sink)
        }
    }
}

/// A field of a topic and the value that it gets.
pub struct Fault {
    pub topic: String,
    field: String,
    value: f64,
}

impl Fault {
    pub fn parse(text: &str) -> Self {
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

/// A stage whose messages `$write` writes.
macro_rules! foreign {
    ($name:ident $hop:ident $inputs:ty, $view:ident<$($of:ident),+> => $output:ident, $write:ident) => {
        struct $name(Fault);

        impl Stage for $name {
            type Inputs = $inputs;
            type Output = $output;
            const HOP: StageId = StageId::$hop;

            fn process(
                &mut self,
                input: $view<'_, $($of),+>,
                output: &mut Draft<$output>,
            ) -> Result<(), RunError> {
                $write(&self.0, &input, output);
                Ok(())
            }
        }
    };
}

foreign!(ForeignMasking Masking Pairs<Scan>, PairView<Scan> => Masked, mask);
foreign!(ForeignRotation RotationSearch Pairs<Masked>, PairView<Masked> => Rotation, rotate);
foreign!(ForeignTranslation TranslationSearch Joined<Masked, Rotation>, JoinedView<Masked, Rotation> => Motion, translate);
foreign!(ForeignRefinement Refinement Joined<Masked, Motion>, JoinedView<Masked, Motion> => Refined, refine);

fn rotate(fault: &Fault, input: &PairView<'_, Masked>, output: &mut Draft<Rotation>) {
    if let Some(value) = fault.of("angle", input.current.item().seq) {
        output.header().rotation.angle_rad = value;
    }
}

fn translate(fault: &Fault, input: &JoinedView<'_, Masked, Rotation>, output: &mut Draft<Motion>) {
    let item = input.pair.current.item();
    if !item.is(flag::BREAK) {
        output.header().motion = motion(fault, item.seq, input.pair.interval_ns());
    }
}

fn refine(fault: &Fault, input: &JoinedView<'_, Masked, Motion>, output: &mut Draft<Refined>) {
    let (item, searched) = (input.pair.current.item(), input.other.header().motion);
    if !item.is(flag::BREAK) {
        output.header().motion = motion(fault, item.seq, searched.interval_ns);
    }
}

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

fn mask(fault: &Fault, input: &PairView<'_, Scan>, output: &mut Draft<Masked>) {
    let seq = input.current.item().seq;
    let (header, values) = output.parts::<f32>();
    values.fill(0.0);
    let raster = MaskedHeader::split(values, 127, 1).unwrap();
    raster.points[0].x_m = fault.of("point", seq).unwrap_or(1.0) as f32;
    *header = MaskedHeader {
        n: fault.of("n", seq).unwrap_or(127.0) as u32,
        rasters: 1,
        cell_m: 0.8,
        points: 1,
        ..MaskedHeader::default()
    };
}

/// Plays the recording, with a fault in one header.
fn replay(launch: &Launch, fault: Fault) -> Result<StageCounters, RunError> {
    let config: SourceConfig = launch.section("source")?;
    let dataset = gyre_datasets::open(&config.data, &DatasetOptions::default()).unwrap();
    source::run(launch, &mut ForeignSource { fault, dataset }, &config)
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

    fn restore(&mut self, _: usize) -> Result<(Vec<PoseHeader>, bool), RunError> {
        Ok((Vec::new(), false))
    }

    fn integrate(
        &mut self,
        motion: &MotionHeader,
        _: Option<&Received<Masked>>,
    ) -> Result<PoseHeader, RunError> {
        let pose = compose(self.last.as_ref(), motion);
        self.last = Some(pose);
        let x_m = self.fault.of("x", pose.item.seq).unwrap_or(pose.x_m);
        Ok(PoseHeader { x_m, ..pose })
    }

    fn end(&mut self, _: &Item) -> Result<(), RunError> {
        Ok(())
    }
}
