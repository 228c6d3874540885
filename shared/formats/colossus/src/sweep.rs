//! Azimuths to scans, whose angles, times and scales equal a recording of the same azimuths, to the
//! bit.

mod rows;
mod seam;

use std::cmp::Ordering;

use gyre_datasets::{DatasetOptions, correct_eccentricity, middle_ns};
use gyre_geometry::{ScanLimits, ScanSlot, Sense, SweepGeometry};

use crate::{
    configuration::{BadConfiguration, Configuration},
    message::{Azimuth, KeptAzimuth},
};
use rows::{Empty, RowWriter};
use seam::{Grid, Seam};

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sweep {
    pub geometry: SweepGeometry,
    /// Azimuths that did not arrive. Their powers are 0, and their flag is not `MEASURED`.
    pub missing: usize,
}

/// Counts of losses, drops and changes since the start of a stream.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counters {
    pub sweeps: u64,
    /// Azimuths that did not arrive, of the sweeps returned.
    pub missing_azimuths: u64,
    /// Sweeps dropped because more than half of their azimuths did not arrive.
    pub incomplete_sweeps: u64,
    /// Sweeps dropped because a turn or more is missing in the middle, or the radar's clock was
    /// set. One each, however many turns are missing: turns without an azimuth are not counted
    /// here.
    pub broken_sweeps: u64,
    /// Azimuths dropped because their sweep was complete.
    pub surplus_azimuths: u64,
    /// Azimuths dropped because they have the encoder count of the azimuth before.
    pub repeated_azimuths: u64,
    /// Azimuths dropped because their encoder count is beyond a turn.
    pub invalid_azimuths: u64,
    /// Rows with more bins than configured, cut.
    pub cut_rows: u64,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum State {
    /// Dropped: the sweep has begun before.
    Waiting,
    Open,
    Complete,
}

#[derive(Clone, Copy, Debug)]
struct Reading {
    encoder: u16,
    stamp_ns: i64,
}

/// Writes azimuths into scans.
///
/// A sweep begins where the encoder passes zero, and ends where no further azimuth fits before it.
#[derive(Clone, Debug)]
pub struct SweepAssembler {
    grid: Grid,
    rows: RowWriter,
    constants: DatasetOptions,
    range_resolution_m: f32,
    state: State,
    last: Option<Reading>,
    kept: Option<(Reading, Seam)>,
    kept_azimuth: KeptAzimuth,
    counters: Counters,
}

impl SweepAssembler {
    /// Returns an assembler at the start of a stream. `constants` has those that the radar does not
    /// report, and perhaps its range resolution.
    pub fn new(
        configuration: &Configuration,
        constants: DatasetOptions,
    ) -> Result<Self, BadConfiguration> {
        let radar_m = configuration.range_resolution_m();
        let resolution_m = constants.range_resolution_m.unwrap_or(radar_m);
        let checked = Configuration {
            range_resolution_m: Some(resolution_m),
            ..*configuration
        };
        checked.check()?;
        Ok(Self {
            grid: Grid {
                radar: *configuration,
            },
            rows: RowWriter::new(configuration),
            constants,
            range_resolution_m: resolution_m,
            state: State::Waiting,
            last: None,
            kept: None,
            kept_azimuth: KeptAzimuth::default(),
            counters: Counters::default(),
        })
    }

    pub fn limits(&self) -> ScanLimits {
        self.rows.limits
    }

    pub fn counters(&self) -> Counters {
        self.counters
    }

    /// Returns the number of azimuths from the last one to the end of its turn; `None` before the
    /// first one. No scan is complete before they are there.
    pub fn azimuths_left(&self) -> Option<f64> {
        Some(self.grid.azimuths_after(self.last?))
    }

    /// Returns whether the turn of the newest azimuth can still become a scan.
    pub fn is_open(&self) -> bool {
        self.state == State::Open || self.kept.is_some()
    }

    /// Returns whether this encoder count belongs to the first azimuth of a turn: a stream that
    /// begins there has all of the turn.
    pub fn is_first(&self, count: u16) -> bool {
        let encoder = self.grid.encoder(count);
        encoder.is_some_and(|it| self.grid.is_first(it))
    }

    /// Writes an azimuth, and returns the sweep that is complete with it. An azimuth of the next
    /// sweep completes one that has lost its last azimuths; it is kept, and written at the next
    /// call.
    ///
    /// `slot` is the same memory, of [`SweepAssembler::limits`], until a sweep is returned, whose
    /// scan it then is.
    pub fn add(
        &mut self,
        azimuth: &Azimuth<'_>,
        stamp_ns: i64,
        slot: &mut ScanSlot<'_>,
    ) -> Option<Sweep> {
        self.rows.assert_fits(slot);
        self.write_kept(slot);
        let Some(encoder) = self.grid.encoder(azimuth.encoder) else {
            self.counters.invalid_azimuths += 1;
            return None;
        };
        let here = Reading { encoder, stamp_ns };
        let Some(last) = self.last else {
            self.start(here, azimuth, slot);
            return self.completed(slot);
        };
        match encoder.cmp(&last.encoder) {
            Ordering::Equal => {
                self.counters.repeated_azimuths += 1;
                None
            }
            Ordering::Greater => self.proceed(last, here, azimuth, slot),
            Ordering::Less => self.wrap(last, here, azimuth, slot),
        }
    }

    /// Begins at the first azimuth of a turn; discards azimuths of a turn that has begun before.
    fn start(&mut self, here: Reading, azimuth: &Azimuth<'_>, slot: &mut ScanSlot<'_>) {
        if self.grid.is_first(here.encoder) {
            self.begin(here, Seam::default(), azimuth, slot);
        } else {
            self.last = Some(here);
            self.state = State::Waiting;
        }
    }

    fn proceed(
        &mut self,
        last: Reading,
        here: Reading,
        azimuth: &Azimuth<'_>,
        slot: &mut ScanSlot<'_>,
    ) -> Option<Sweep> {
        self.last = Some(here);
        match self.state {
            State::Waiting => {}
            State::Complete => self.counters.surplus_azimuths += 1,
            State::Open if self.grid.is_break(last, here) => {
                self.counters.broken_sweeps += 1;
                self.start(here, azimuth, slot);
            }
            State::Open => {
                let fits = self.rows.left().saturating_sub(1);
                let gap = self.grid.gap(last, here);
                self.rows.write_empty(gap, fits, slot);
                self.write(here, azimuth, slot);
            }
        }
        self.completed(slot)
    }

    /// Adds the first azimuth of a turn, after the last one of another.
    fn wrap(
        &mut self,
        last: Reading,
        here: Reading,
        azimuth: &Azimuth<'_>,
        slot: &mut ScanSlot<'_>,
    ) -> Option<Sweep> {
        let seam = self.grid.seam(last, here);
        if self.state == State::Open {
            let fits = self.rows.left();
            self.rows.write_empty(seam.trailing(last), fits, slot);
            if let Some(sweep) = self.finish(slot) {
                self.kept_azimuth.keep(azimuth);
                self.kept = Some((here, seam));
                self.last = Some(here);
                return Some(sweep);
            }
        }
        self.begin(here, seam, azimuth, slot);
        self.completed(slot)
    }

    fn write_kept(&mut self, slot: &mut ScanSlot<'_>) {
        if let Some((here, seam)) = self.kept.take() {
            let kept = std::mem::take(&mut self.kept_azimuth);
            self.begin(here, seam, &kept.azimuth(), slot);
            self.kept_azimuth = kept;
        }
    }

    fn begin(&mut self, here: Reading, seam: Seam, azimuth: &Azimuth<'_>, slot: &mut ScanSlot<'_>) {
        self.state = State::Open;
        self.last = Some(here);
        self.rows.clear();
        let fits = self.rows.left().saturating_sub(1);
        let empty = seam.leading(here, fits);
        self.rows.write_empty(empty, fits, slot);
        self.write(here, azimuth, slot);
    }

    fn write(&mut self, here: Reading, azimuth: &Azimuth<'_>, slot: &mut ScanSlot<'_>) {
        let place = (f64::from(here.encoder), here.stamp_ns);
        self.rows
            .write_measured(place, azimuth.powers, slot, &mut self.counters);
    }

    /// Returns the sweep if no further azimuth fits.
    fn completed(&mut self, slot: &mut ScanSlot<'_>) -> Option<Sweep> {
        let ended = self.rows.left() == 0 || self.grid.is_last(self.last?);
        match self.state == State::Open && ended {
            true => self.finish(slot),
            false => None,
        }
    }

    /// Ends the sweep, and returns it unless most of it is missing.
    fn finish(&mut self, slot: &mut ScanSlot<'_>) -> Option<Sweep> {
        self.state = State::Complete;
        let (azimuths, missing) = (self.rows.written, self.rows.missing);
        if 2 * (azimuths - missing) < self.rows.limits.azimuths {
            self.counters.incomplete_sweeps += 1;
            return None;
        }
        self.counters.sweeps += 1;
        self.counters.missing_azimuths += missing as u64;
        let azimuth_rad = &mut slot.azimuth_rad[..azimuths];
        let (constants, bins) = (&self.constants, self.rows.bins);
        let eccentricity_rad = constants.azimuth_eccentricity_rad.unwrap_or_default();
        correct_eccentricity(azimuth_rad, eccentricity_rad);
        let geometry = SweepGeometry {
            azimuths,
            bins,
            stride: bins,
            first_byte: 0,
            range_resolution_m: self.range_resolution_m,
            range_offset_m: constants.range_offset_m.unwrap_or_default(),
            doppler_s: constants.doppler_s.unwrap_or_default(),
            sense: Sense::Clockwise,
            stamp_ns: middle_ns(slot.stamp_ns[0], slot.stamp_ns[azimuths - 1]),
        };
        Some(Sweep { geometry, missing })
    }
}
