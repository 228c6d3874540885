//! The scans of a source as messages of Navtech's driver.

use gyre_colossus::Configuration as Radar;
use gyre_configuration::terminal::{Failure, print};
use gyre_datasets::{ReadError, correct_eccentricity, middle_ns};
use gyre_geometry::{OwnedScan, PolarScan, Sense, SweepGeometry, scan::flag};
use gyre_radar::{PlacedRows, lost::stale_rows};
use gyre_recording::bags::{BagWriter, Kept, Topic};
use gyre_ros2_messages::{
    navtech_msgs::{RadarBScanMsg, RadarConfigurationMsg, RadarFftDataMsg},
    radar::{Encoder, ScanMessages},
};

use crate::{
    export::{
        ScanForm,
        source::{Lost, Scans, Source},
    },
    radar_server,
};

const CONFIGURATION: &str = "/radar_data/configuration_data";
const AZIMUTHS: &str = "/radar_data/fft_data";
const B_SCANS: &str = "/radar_data/b_scan_msg";

pub struct ScanWriter {
    losses: Losses,
    scans: Scans,
    scan: OwnedScan,
    /// The number of the scan if it has been read, and is to be written.
    first: Option<usize>,
    lost: Lost,
    rows: PlacedRows,
    messages: ScanMessages,
    /// The topic of the configuration, until the first scan.
    configuration: Option<Topic<RadarConfigurationMsg>>,
    azimuths: Option<Topic<RadarFftDataMsg>>,
    b_scans: Option<Topic<RadarBScanMsg>>,
}

#[derive(Debug, Default)]
struct Losses {
    unreadable: u64,
    without_encoder: bool,
    chirps: bool,
    /// Rows that were not measured but have powers.
    interpolated: u64,
    /// Scans with lost azimuths: with their rows if the run has found them, and scans whose rows
    /// are unknown.
    placed: u64,
    not_placed: u64,
    /// Scans whose time differs from the middle of their first and last azimuth, and the largest
    /// difference, ns.
    retimed: u64,
    retimed_by_ns: u64,
    /// The radar's constants in the settings of `[dataset]`.
    constants: Vec<(&'static str, f32)>,
}

/// Returns the sentences that hold.
macro_rules! sentences {
    ($($holds:expr => $sentence:literal;)*) => {
        [$($holds.then(|| format!($sentence)),)*].into_iter().flatten().collect()
    };
}

impl Losses {
    fn add(&mut self, scan: &PolarScan<'_>) {
        let is_measured = |flags: u8| flags & flag::MEASURED != 0;
        let chirps = flag::CHIRP_KNOWN | flag::CHIRP_UP;
        self.chirps |= scan.flags.iter().any(|flags| flags & chirps != 0);
        self.not_placed += u64::from(stale_rows(scan) > 0);
        let read = 0..scan.geometry.azimuths - stale_rows(scan);
        let rows = read.filter(|row| !is_measured(scan.flags[*row]));
        let rows = rows.filter(|row| scan.row(*row).iter().any(|power| *power > 0));
        self.interpolated += rows.count() as u64;
        let written = scan.stamp_ns.iter().zip(scan.flags);
        let mut written = written.filter(|(_, flags)| is_measured(**flags));
        if let Some((first_ns, _)) = written.next() {
            let last_ns = written.next_back().map_or(first_ns, |(last_ns, _)| last_ns);
            let read_ns = middle_ns(*first_ns, *last_ns);
            let by_ns = read_ns.abs_diff(scan.geometry.stamp_ns);
            self.retimed += u64::from(by_ns > 0);
            self.retimed_by_ns = self.retimed_by_ns.max(by_ns);
        }
    }

    fn add_constants(&mut self, scan: &SweepGeometry, eccentricity_rad: f32) {
        self.constants = vec![
            ("range_offset_m", scan.range_offset_m),
            ("doppler_s", scan.doppler_s),
            ("azimuth_eccentricity_rad", eccentricity_rad),
        ];
        self.constants.retain(|(_, value)| *value != 0.0);
    }

    fn radar(&mut self, scans: &Scans, scan: &OwnedScan) -> Result<Radar, Failure> {
        let geometry = &scan.geometry;
        if geometry.sense != Sense::Clockwise {
            return Err("Navtech's radars turn clockwise, and this one does not: --scans none leaves its scans out".into());
        }
        let encoder = Encoder::of(&scan.azimuth_rad[..geometry.azimuths], scans.encoder_counts);
        self.without_encoder = !encoder.is_exact;
        Ok(Radar {
            bin_size: 0,
            packet_rate: 0,
            ..radar_server::radar(scans.dataset.as_ref(), geometry, encoder.counts)?
        })
    }

    fn sentences(&self) -> Vec<String> {
        let (unreadable, interpolated) = (self.unreadable, self.interpolated);
        let (placed, not_placed, retimed) = (self.placed, self.not_placed, self.retimed);
        let ms = self.retimed_by_ns as f64 * 1e-6;
        let constants = self.constants.iter();
        let settings = constants.map(|(key, value)| format!(" --set dataset.{key}={value}"));
        let settings: String = settings.collect();
        sentences!(
            unreadable > 0 => "{unreadable} scans cannot be read, and are not in the bag";
            self.without_encoder =>
                "the angles of the scans are of no encoder: they are rounded to 1/65535 of a turn";
            self.chirps =>
                "Navtech's messages do not contain the directions of chirps: the bag lacks them";
            interpolated > 0 =>
                "interpolated rows: {interpolated}. Navtech's messages cannot carry them; a run on the bag finds them missing";
            placed > 0 =>
                "{placed} scans have lost azimuths: their rows are at the angles where the run has found them, rounded to the angles of the other scans";
            not_placed > 0 =>
                "{not_placed} scans have lost azimuths, and it is not known where, so that the angles of their rows are wrong by up to as many: the export of a run has them right";
            retimed > 0 =>
                "{retimed} scans have another time than the middle of their first and last azimuth, which is their time in the bag: up to {ms:.3} ms away";
            !settings.is_empty() =>
                "Navtech's messages have no place for constants of this radar: who runs on the bag sets them with{settings}";
        )
    }
}

impl ScanWriter {
    /// Adds the topics of scans, if they are wanted and there are any.
    pub fn begin(
        bag: &mut BagWriter,
        source: &mut Source,
        forms: &[ScanForm],
        frame: &str,
    ) -> Result<Option<Self>, Failure> {
        if forms.contains(&ScanForm::None) {
            return Ok(None);
        }
        let Some(mut scans) = source.scans()? else {
            print::note("the run was of a radar, and has no scans: --record keeps them");
            return Ok(None);
        };
        let mut losses = Losses::default();
        let mut scan = OwnedScan::with_limits(scans.dataset.limits());
        let Some(first) = scans.next(&mut scan, &mut losses.unreadable)? else {
            return Ok(None);
        };
        let radar = losses.radar(&scans, &scan)?;
        losses.add_constants(&scan.geometry, scans.eccentricity_rad);
        let configuration = bag.topic(CONFIGURATION, Kept::ForLater)?;
        let fft = forms.contains(&ScanForm::Fft);
        let azimuths = fft.then(|| bag.topic(AZIMUTHS, Kept::ForNobody));
        let azimuths = azimuths.transpose()?;
        let b_scans = forms.contains(&ScanForm::BScan);
        let b_scans = b_scans.then(|| bag.topic(B_SCANS, Kept::ForNobody));
        Ok(Some(Self {
            losses,
            messages: ScanMessages::new(radar, frame),
            configuration: Some(configuration),
            azimuths,
            b_scans: b_scans.transpose()?,
            lost: source.lost()?,
            rows: PlacedRows::default(),
            scan,
            first: Some(first),
            scans,
        }))
    }

    /// Writes the next scan that can be read, and returns its time; `None` at the end.
    pub fn write_next(&mut self, bag: &mut BagWriter) -> Result<Option<i64>, Failure> {
        let next = match self.first.take() {
            None => self
                .scans
                .next(&mut self.scan, &mut self.losses.unreadable)?,
            first => first,
        };
        next.map(|index| self.write(index, bag)).transpose()
    }

    /// Prints the differences between the bag and its source.
    pub fn describe_losses(&self) {
        self.losses.sentences().iter().for_each(print::note);
    }

    fn write(&mut self, index: usize, bag: &mut BagWriter) -> Result<i64, Failure> {
        let mut scan = self.scan.view();
        if let Some(lost) = self.lost.get(&(index as u64))
            && lost.count() > 0
        {
            scan = self.rows.place(&scan, lost);
            self.losses.placed += u64::from(stale_rows(&scan) == 0);
        }
        self.losses.add(&scan);
        let stamps = &scan.stamp_ns[..scan.geometry.azimuths];
        let (Some(first_ns), Some(last_ns)) = (stamps.first(), stamps.last()) else {
            return Ok(scan.geometry.stamp_ns);
        };
        if let Some(topic) = self.configuration.take() {
            let message = self.messages.configuration(*first_ns);
            bag.write(&topic, *first_ns, &message)?;
        }
        if let Some(topic) = &self.azimuths {
            for message in self.messages.azimuths(scan) {
                bag.write(topic, message.header.stamp.ns(), &message)?;
            }
        }
        if let Some(topic) = &self.b_scans {
            bag.write(topic, *last_ns, &self.messages.b_scan(scan))?;
        }
        Ok(scan.geometry.stamp_ns)
    }
}

impl Scans {
    /// Reads the next scan that can be read, counts those before it, and returns its number; `None`
    /// at the end.
    pub fn next(
        &mut self,
        scan: &mut OwnedScan,
        unreadable: &mut u64,
    ) -> Result<Option<usize>, Failure> {
        while let Some(index) = self.played.next() {
            match self.read(index, scan) {
                Ok(()) => return Ok(Some(index)),
                Err(error @ ReadError::Io { .. }) => return Err(error.into()),
                Err(error) => {
                    print::note(format_args!("scan {index} is left out: {error}"));
                    *unreadable += 1;
                }
            }
        }
        Ok(None)
    }

    /// Reads a scan with the angles as the encoder counts them.
    fn read(&mut self, index: usize, scan: &mut OwnedScan) -> Result<(), ReadError> {
        scan.geometry = self.dataset.read(index, scan.slot())?;
        if !self.is_corrected {
            return Ok(());
        }
        let angles = &mut scan.azimuth_rad[..scan.geometry.azimuths];
        // The correction uses an angle that is itself corrected, with an error of the eccentricity
        // squared.
        let mut encoder = angles.to_vec();
        correct_eccentricity(&mut encoder, -self.eccentricity_rad);
        for (angle, encoder) in angles.iter_mut().zip(encoder) {
            *angle -= self.eccentricity_rad * encoder.cos();
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A scan of ten azimuths, 1 ms apart, all measured.
    fn scan() -> OwnedScan {
        let mut scan = OwnedScan::of(SweepGeometry {
            azimuths: 10,
            bins: 2,
            stride: 2,
            stamp_ns: 4_500_000,
            ..SweepGeometry::default()
        });
        scan.bytes.fill(7);
        scan.stamp_ns = (0..10).map(|ms| ms * 1_000_000).collect();
        scan
    }

    fn sentences(scan: &OwnedScan, eccentricity_rad: f32) -> Vec<String> {
        let mut losses = Losses::default();
        losses.add_constants(&scan.geometry, eccentricity_rad);
        losses.add(&scan.view());
        losses.sentences()
    }

    #[test]
    fn each_loss_has_a_sentence_of_its_own() {
        let mut whole = scan();
        assert_eq!(sentences(&whole, 0.0), [""; 0]);
        whole.flags.fill(flag::MEASURED | flag::ASSUMED);
        assert_eq!(sentences(&whole, 0.0), [""; 0]);
        let only = |scan: &OwnedScan, eccentricity_rad, what: &str| {
            let found = sentences(scan, eccentricity_rad);
            assert!(found.len() == 1 && found[0].contains(what), "{found:?}");
        };
        let mut interpolated = scan();
        interpolated.flags[4] = 0;
        only(&interpolated, 0.0, "interpolated rows: 1");
        let mut lossy = scan();
        lossy.flags[8..].fill(flag::STALE | flag::ASSUMED);
        // Without the last rows, the middle of the rows differs, too.
        let found = sentences(&lossy, 0.0);
        let places = "1 scans have lost azimuths, and it is not known where";
        assert!(found.len() == 2 && found[0].contains(places), "{found:?}");
        assert!(found[1].contains("up to 1.000 ms away"), "{found:?}");
        // A row without powers has nothing to lose.
        interpolated.bytes[8..10].fill(0);
        assert_eq!(sentences(&interpolated, 0.0), [""; 0]);
        // Row n / 2 - 1, as in Boreas.
        let mut early = scan();
        early.geometry.stamp_ns = 4_000_000;
        only(&early, 0.0, "up to 0.500 ms away");
        let mut far = scan();
        (far.geometry.range_offset_m, far.geometry.doppler_s) = (-0.31, 0.04);
        let constants = "--set dataset.range_offset_m=-0.31 --set dataset.doppler_s=0.04";
        only(&far, 0.0, constants);
        only(
            &whole,
            0.0025,
            "--set dataset.azimuth_eccentricity_rad=0.0025",
        );
        let mut rising = scan();
        rising.flags[0] |= flag::CHIRP_KNOWN;
        only(&rising, 0.0, "the directions of chirps");
    }
}
