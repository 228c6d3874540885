//! The scans of a source as messages of Navtech's driver.

use gyre_bags::{BagWriter, Kept, Topic};
use gyre_colossus::Configuration as Radar;
use gyre_radar::{OwnedScan, ReadError, Sense, correct_eccentricity, scan::flag};
use gyre_ros2_messages::{
    navtech_msgs::{RadarBScanMsg, RadarConfigurationMsg, RadarFftDataMsg},
    radar::{Encoder, ScanMessages},
};

use super::source::{Scans, Source};
use crate::{Failure, cli::ScanForm, print};

/// The topics of Navtech's driver.
const CONFIGURATION: &str = "/radar_data/configuration_data";
const AZIMUTHS: &str = "/radar_data/fft_data";
const B_SCANS: &str = "/radar_data/b_scan_msg";

/// Writes the scans of a source.
pub struct ScanWriter {
    open: Option<Open>,
    losses: Losses,
}

struct Open {
    scans: Scans,
    scan: OwnedScan,
    messages: ScanMessages,
    configuration: Topic<RadarConfigurationMsg>,
    azimuths: Option<Topic<RadarFftDataMsg>>,
    b_scans: Option<Topic<RadarBScanMsg>>,
    is_described: bool,
}

/// What is not in the bag as it is in the source.
#[derive(Debug, Default)]
struct Losses {
    unreadable: u64,
    without_encoder: bool,
    chirps: bool,
}

impl ScanWriter {
    /// Adds the topics of scans, if they are wanted and there are any.
    ///
    /// # Errors
    /// Scans that cannot be opened, or are of no such radar.
    pub fn begin(
        bag: &mut BagWriter,
        source: &mut Source,
        forms: &[ScanForm],
        frame: &str,
    ) -> Result<Self, Failure> {
        let mut writer = Self {
            open: None,
            losses: Losses::default(),
        };
        let is_wanted = |form| forms.contains(&form);
        if is_wanted(ScanForm::None) {
            return Ok(writer);
        }
        let Some(mut scans) = source.scans()? else {
            print::note("the run was of a radar, and has no scans: --record keeps them");
            return Ok(writer);
        };
        let Some(scan) = first(&mut scans)? else {
            return Ok(writer);
        };
        let radar = writer.radar(&scans, &scan)?;
        writer.open = Some(Open {
            messages: ScanMessages::new(radar, frame),
            configuration: bag.topic(CONFIGURATION, Kept::ForLater)?,
            azimuths: match is_wanted(ScanForm::Fft) {
                true => Some(bag.topic(AZIMUTHS, Kept::ForNobody)?),
                false => None,
            },
            b_scans: match is_wanted(ScanForm::BScan) {
                true => Some(bag.topic(B_SCANS, Kept::ForNobody)?),
                false => None,
            },
            scan,
            scans,
            is_described: false,
        });
        Ok(writer)
    }

    /// Returns what the radar of these scans says of itself.
    fn radar(&mut self, scans: &Scans, scan: &OwnedScan) -> Result<Radar, Failure> {
        let geometry = &scan.geometry;
        if geometry.sense != Sense::Clockwise {
            return Err("Navtech's radars turn clockwise, and this one does not: --scans none leaves its scans out".into());
        }
        let (azimuths, bins) = (geometry.azimuths, geometry.bins);
        let small = |number: usize| {
            u16::try_from(number).map_err(|_| {
                format!("scans of {azimuths} azimuths and {bins} range bins do not fit Navtech's messages, which count both in 16 bits")
            })
        };
        let encoder = Encoder::of(&scan.azimuth_rad[..azimuths], scans.encoder_counts);
        self.losses.without_encoder = !encoder.is_exact;
        let turns_per_1000_s = 1e12 / scans.dataset.period_ns().max(1) as f64;
        Ok(Radar {
            azimuth_samples: small(azimuths)?,
            bin_size: 0,
            range_in_bins: small(bins)?,
            encoder_size: encoder.counts,
            rotation_mhz: turns_per_1000_s.round().min(f64::from(u16::MAX)) as u16,
            packet_rate: 0,
            range_gain: 1.0,
            range_offset: 0.0,
            range_resolution_m: Some(geometry.range_resolution_m),
        })
    }

    /// Writes the next scan that can be read, and returns its time; `None` at the end.
    ///
    /// # Errors
    /// A disk that does not give it, a bag that cannot be written.
    pub fn write_next(&mut self, bag: &mut BagWriter) -> Result<Option<i64>, Failure> {
        let Some(open) = &mut self.open else {
            return Ok(None);
        };
        while let Some(index) = open.scans.played.next() {
            match open.scans.read(index, &mut open.scan) {
                Ok(()) => return open.write(bag, &mut self.losses).map(Some),
                Err(error @ ReadError::Io { .. }) => return Err(error.into()),
                Err(error) => {
                    print::note(format_args!("scan {index} is left out: {error}"));
                    self.losses.unreadable += 1;
                }
            }
        }
        Ok(None)
    }

    /// Says what is not in the bag as it is in the source.
    pub fn describe_losses(&self) {
        let losses = &self.losses;
        if losses.unreadable > 0 {
            print::note(format_args!(
                "{} scans cannot be read, and are not in the bag",
                losses.unreadable
            ));
        }
        if losses.without_encoder {
            print::note(
                "the angles of the scans are of no encoder: they are rounded to 1/65535 of a turn",
            );
        }
        if losses.chirps {
            print::note(
                "Navtech's messages do not say which azimuths are of rising and which of falling chirps: that is not in the bag",
            );
        }
    }
}

impl Open {
    fn write(&mut self, bag: &mut BagWriter, losses: &mut Losses) -> Result<i64, Failure> {
        let scan = self.scan.view();
        losses.chirps |= scan.flags.iter().any(|flags| flags & !flag::MEASURED != 0);
        let stamps = &scan.stamp_ns[..scan.geometry.azimuths];
        let (Some(first_ns), Some(last_ns)) = (stamps.first(), stamps.last()) else {
            return Ok(scan.geometry.stamp_ns);
        };
        if !self.is_described {
            let message = self.messages.configuration(*first_ns);
            bag.write(&self.configuration, *first_ns, &message)?;
            self.is_described = true;
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
    /// Reads a scan with the angles as the encoder counts them.
    fn read(&mut self, index: usize, scan: &mut OwnedScan) -> Result<(), ReadError> {
        scan.geometry = self.dataset.read(index, scan.slot())?;
        let angles = &mut scan.azimuth_rad[..scan.geometry.azimuths];
        // The angle at which the correction is taken is itself corrected: its error is that of the eccentricity squared.
        let mut encoder = angles.to_vec();
        correct_eccentricity(&mut encoder, -self.eccentricity_rad);
        for (angle, encoder) in angles.iter_mut().zip(encoder) {
            *angle -= self.eccentricity_rad * encoder.cos();
        }
        Ok(())
    }
}

/// Returns the first scan that can be read, if there is one.
fn first(scans: &mut Scans) -> Result<Option<OwnedScan>, Failure> {
    let mut scan = OwnedScan::with_limits(scans.dataset.limits());
    for index in scans.played.clone() {
        match scans.read(index, &mut scan) {
            Ok(()) => return Ok(Some(scan)),
            Err(error @ ReadError::Io { .. }) => return Err(error.into()),
            Err(_) => {}
        }
    }
    Ok(None)
}
