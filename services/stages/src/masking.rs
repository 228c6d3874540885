//! The masking stage: from `scan` to `masked`, with the motions of previous scans for motion
//! compensation. [`gyre_masking::Masker`] does the work. The velocity by Doppler is measured here,
//! where the rows of the scan are.

mod commands;
mod live;
mod lossless;
mod motions;
mod python;
mod scans;

use gyre_contract::{Item, Masked, MaskedHeader, StageId, flag, mask_kind, run::StageCounters};
use gyre_geometry::{
    LostAzimuths, Twist,
    samples::{DopplerConfig, Witness},
};
use gyre_masking::{MaskError, MaskFunction, MaskKind, Masker, MaskingConfig, Sweep};
use gyre_radar::{
    DopplerEstimator, LostAzimuthFinder, PlacedRows, PointsConfig, RasterConfig, lost::stale_rows,
};
use gyre_stage::{Launch, Stage, stage};
use gyre_transport::{RunError, writer::Draft};
use scans::{MovedScan, ScanView, Scans};

pub use python::python;

pub fn run(launch: &Launch) -> Result<StageCounters, RunError> {
    work(launch, launch.section("masking")?, None)
}

/// Runs the stage until SIGTERM with a mask of your own, in the place of a network.
pub fn run_with(
    launch: &Launch,
    function: Box<dyn MaskFunction>,
) -> Result<StageCounters, RunError> {
    if launch.manifest.limits.rasters != 1 {
        return Err(RunError::Input(
            "a function masks one scan at a time, and the network of this run two: name the function when the run is begun, or choose masking.kind `threshold`"
                .to_owned(),
        ));
    }
    let mut config: MaskingConfig = launch.section("masking")?;
    if config.kind == MaskKind::Learned {
        config.kind = MaskKind::Threshold;
    }
    work(launch, config, Some(function))
}

fn work(
    launch: &Launch,
    config: MaskingConfig,
    function: Option<Box<dyn MaskFunction>>,
) -> Result<StageCounters, RunError> {
    let raster: RasterConfig = launch.section("raster")?;
    let points: PointsConfig = launch.section("points")?;
    let doppler: DopplerConfig = launch.section("doppler")?;
    let masker = match function {
        None => Masker::new(&raster, &points, &config),
        Some(function) => Masker::with_function(&raster, &points, &config, function),
    };
    let mut masking = Masking {
        raster,
        config,
        masker: masker.map_err(RunError::input)?,
        azimuths: Azimuths::default(),
        doppler: doppler.is_used().then(DopplerEstimator::default),
        min_range_m: points.min_range_m,
        rows: [PlacedRows::default(), PlacedRows::default()],
    };
    stage::run(launch, &mut masking)
}

struct Masking {
    raster: RasterConfig,
    config: MaskingConfig,
    masker: Masker,
    azimuths: Azimuths,
    doppler: Option<DopplerEstimator>,
    /// Nearer echoes are of the vehicle itself.
    min_range_m: f32,
    rows: [PlacedRows; 2],
}

impl Stage for Masking {
    type Inputs = Scans;
    type Output = Masked;
    const HOP: StageId = StageId::Masking;

    fn process(&mut self, input: ScanView<'_>, output: &mut Draft<Masked>) -> Result<(), RunError> {
        let scan = input.current.scan;
        let failed = |error: MaskError| match error {
            MaskError::Function(reason) => RunError::Transient(reason),
            error => scan.malformed(error.to_string()),
        };
        let [rows, previous_rows] = &mut self.rows;
        let azimuths = &mut self.azimuths;
        let previous = match &input.previous {
            Some(previous) => Some(sweep(previous, azimuths, previous_rows)?),
            None => None,
        };
        let sweep = sweep(&input.current, azimuths, rows)?;
        if let Some(previous) = &previous
            && !self.masker.can_follow(previous.number)
        {
            self.masker.set_previous(previous).map_err(failed)?;
        }
        let (header, values) = output.parts::<f32>();
        let parts = MaskedHeader::split(values, self.raster.n, self.masker.scans())
            .ok_or_else(|| scan.malformed("its rasters do not fit into a message"))?;
        let follows = previous.map(|previous| previous.number);
        let twist = self
            .masker
            .mask(&sweep, follows, parts.later, parts.earlier)
            .map_err(failed)?;
        let points = self
            .masker
            .points(&sweep.scan, twist, parts.points)
            .map_err(|error| scan.malformed(error.to_string()))?;
        // Of the scan alone, so that a restart changes nothing.
        let velocity = self.doppler.as_mut().map(|doppler| {
            let velocity = doppler.estimate(&sweep.scan, self.min_range_m);
            velocity.unwrap_or_default()
        });
        *header = self.header(twist, points);
        let azimuths = scan.header().azimuths as usize;
        header.azimuth_variance_rad2 = self.azimuths.last().variance_of_mean_rad2(azimuths);
        header.evidence = input.evidence;
        header.evidence[Witness::Doppler as usize] = velocity.unwrap_or_default();
        Ok(())
    }

    fn identify(&self, item: &mut Item) {
        item.set_lost_azimuths(&self.azimuths.last());
    }
}

impl Masking {
    fn header(&self, twist: Option<Twist>, points: usize) -> MaskedHeader {
        MaskedHeader {
            n: self.raster.n as u32,
            rasters: self.masker.scans() as u32,
            cell_m: self.raster.cell_m,
            mask: match self.config.kind {
                MaskKind::None => mask_kind::NONE,
                MaskKind::Threshold => mask_kind::THRESHOLD,
                MaskKind::Learned => mask_kind::LEARNED,
            },
            twist: twist.map_or([0.0; 3], |twist| {
                [twist.vx_mps, twist.vy_mps, twist.yaw_rate_radps].map(|value| value as f32)
            }),
            compensated: twist.is_some().into(),
            points: points as u32,
            ..MaskedHeader::default()
        }
    }
}

/// Returns a scan whose rows are at their places.
fn sweep<'a>(
    input: &MovedScan<'a>,
    azimuths: &mut Azimuths,
    rows: &'a mut PlacedRows,
) -> Result<Sweep<'a>, RunError> {
    let received = input.scan;
    let scan = received.header().view(received.values());
    let scan =
        scan.ok_or_else(|| received.malformed("its payload is shorter than its header says"))?;
    let mut sweep = Sweep {
        number: received.item().scan,
        scan,
        twist: input.twist,
    };
    let starts = received.item().is(flag::BREAK);
    let lost = azimuths.lost(&sweep, input.lost, starts);
    sweep.scan = PlacedRows::place(rows, &sweep.scan, &lost);
    Ok(sweep)
}

/// The lost azimuths of each scan, found from the scan before. A restarted masking continues from
/// the record in the poses.
#[derive(Default)]
struct Azimuths {
    finder: LostAzimuthFinder,
    last: Option<(u64, LostAzimuths)>,
}

impl Azimuths {
    /// Returns where azimuths of a sweep were lost: the next one, or the last one again. `known` is
    /// the finding of an earlier masking. Where a chain of motions `starts`, nothing is known of
    /// the scan before.
    fn lost(
        &mut self,
        sweep: &Sweep<'_>,
        known: Option<LostAzimuths>,
        starts: bool,
    ) -> LostAzimuths {
        if let Some((number, lost)) = self.last
            && number == sweep.number
        {
            return lost;
        }
        if starts {
            self.finder.reset();
        }
        // Another masking's finding about this scan, if it has found all.
        let known = known.filter(|known| known.count() == stale_rows(&sweep.scan));
        let lost = match known {
            Some(known) => {
                self.finder.set_previous(&sweep.scan, &known);
                known
            }
            None => self.finder.find(&sweep.scan, sweep.twist),
        };
        self.last = Some((sweep.number, lost));
        lost
    }

    fn last(&self) -> LostAzimuths {
        self.last.map(|(_, lost)| lost).unwrap_or_default()
    }
}
