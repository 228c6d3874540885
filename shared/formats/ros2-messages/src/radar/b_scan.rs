//! Messages of one turn.

use gyre_colossus::{Azimuth, Configuration, Powers};

use crate::{navtech_msgs::RadarBScanMsg, sensor_msgs::Image};

const SECOND_NS: u64 = 1_000_000_000;

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TimedAzimuth<'a> {
    pub azimuth: Azimuth<'a>,
    /// When it was received, ns, if the message is received when the turn has ended.
    pub arrived_ns: i64,
}

impl RadarBScanMsg {
    /// Returns the azimuths in order. Rows that the driver has not written are left out: its index
    /// overruns the image where the encoder's counts are no multiple of the azimuths, and skips
    /// other rows. The driver's first turn may have none at all: where the first azimuth that it
    /// receives has encoder count 0, it publishes the turn before that.
    ///
    /// `arrived_ns` is the host's time of receipt of the message.
    pub fn rows<'a>(
        &'a self,
        radar: &Configuration,
        azimuth_offset: u16,
        arrived_ns: i64,
    ) -> Result<impl Iterator<Item = TimedAzimuth<'a>> + 'a, String> {
        let image = PowerImage::of(&self.b_scan_img, azimuth_offset)?;
        let (encoders, stamps) = (&self.encoder_values, &self.timestamps);
        if encoders.len() != image.height || stamps.len() != image.height {
            return Err(format!(
                "it has {} rows of powers, but {} encoder values and {} times, and needs one of each for a row",
                image.height,
                encoders.len(),
                stamps.len()
            ));
        }
        let arrival_ns = arrival(radar, arrived_ns);
        let unit_ns = unit_ns(radar, encoders, stamps);
        Ok(self
            .written()
            .map(move |(row, encoder, stamp)| TimedAzimuth {
                azimuth: azimuth(encoder, stamp.saturating_mul(unit_ns), image.row(row)),
                arrived_ns: arrival_ns(encoder),
            }))
    }

    /// Returns the rows that the driver has written: their numbers, encoder values and times.
    pub fn written(&self) -> impl Iterator<Item = (usize, u16, u64)> + '_ {
        let (encoders, stamps) = (&self.encoder_values, &self.timestamps);
        let has_clock = stamps.iter().any(|stamp| *stamp != 0);
        let has_turned = encoders.iter().any(|encoder| *encoder != 0);
        let mut last = None;
        let is_next = move |(row, encoder, stamp): &(usize, u16, u64)| {
            let is_written = match has_clock {
                true => *stamp != 0,
                false => *encoder != 0 || (*row == 0 && has_turned),
            };
            let follows = last.is_none_or(|last| last < *encoder);
            if is_written && follows {
                last = Some(*encoder);
            }
            is_written && follows
        };
        let places = encoders.iter().zip(stamps).enumerate();
        let places = places.map(|(row, (encoder, stamp))| (row, *encoder, *stamp));
        places.filter(is_next)
    }
}

/// Returns the unit of the times of rows: the unit that makes the times advance most nearly as the
/// radar turns.
fn unit_ns(radar: &Configuration, encoders: &[u16], stamps: &[u64]) -> u64 {
    let mut written = encoders.iter().zip(stamps).filter(|(_, stamp)| **stamp > 0);
    let (Some(first), Some(last)) = (written.next(), written.next_back()) else {
        return 1;
    };
    let turned = f64::from(last.0.saturating_sub(*first.0)) / f64::from(radar.encoder_size.max(1));
    let expected_ns = turned * radar.period_ns() as f64;
    let advance = last.1.saturating_sub(*first.1) as f64;
    let apart = |unit: &u64| (advance * *unit as f64 / expected_ns).ln().abs();
    // Of times that do not advance all are equally far: they are as they should be.
    let units = [1, 1_000, 1_000_000].into_iter();
    let nearest = units.min_by(|a, b| apart(a).total_cmp(&apart(b)));
    nearest.unwrap_or(1)
}

impl Image {
    /// Returns the azimuths of a `b_scan_image`, which has neither encoder values nor times: they
    /// are evenly spaced, and a turn ends when the image is received.
    pub fn rows(
        &self,
        radar: &Configuration,
        azimuth_offset: u16,
        arrived_ns: i64,
    ) -> Result<impl Iterator<Item = TimedAzimuth<'_>>, String> {
        let image = PowerImage::of(self, azimuth_offset)?;
        let arrival_ns = arrival(radar, arrived_ns);
        let encoder_size = u64::from(radar.encoder_size);
        Ok((0..image.height).map(move |row| {
            let encoder = (row as u64 * encoder_size / image.height as u64) as u16;
            TimedAzimuth {
                azimuth: azimuth(encoder, 0, image.row(row)),
                arrived_ns: arrival_ns(encoder),
            }
        }))
    }
}

fn azimuth(encoder: u16, stamp: u64, powers: &[u8]) -> Azimuth<'_> {
    let seconds = u32::try_from(stamp / SECOND_NS).unwrap_or(u32::MAX);
    Azimuth {
        sweep_counter: 0,
        encoder,
        seconds: seconds.to_le_bytes(),
        split_seconds: ((stamp % SECOND_NS) as u32).to_le_bytes(),
        powers: Powers::Eight(powers),
    }
}

#[derive(Clone, Copy)]
struct PowerImage<'a> {
    data: &'a [u8],
    height: usize,
    width: usize,
    step: usize,
    /// The rotation of the image, in rows.
    offset: usize,
}

impl<'a> PowerImage<'a> {
    fn of(image: &'a Image, azimuth_offset: u16) -> Result<Self, String> {
        if !matches!(image.encoding.as_str(), "8UC1" | "mono8") {
            let encoding: String = image.encoding.chars().take(20).collect();
            return Err(format!(
                "its pixels are `{encoding}`, expected `8UC1` or `mono8`"
            ));
        }
        let (height, width, step) = (image.height, image.width, image.step);
        let bytes = image.data.len();
        let fits = width > 0
            && height > 0
            && step >= width
            && u64::from(height) * u64::from(step) == bytes as u64;
        if !fits {
            return Err(format!(
                "it has {bytes} bytes, and states that it has {height} rows of {step} bytes for {width} bins"
            ));
        }
        let height = height as usize;
        Ok(Self {
            data: &image.data,
            height,
            width: width as usize,
            step: step as usize,
            offset: usize::from(azimuth_offset) % height,
        })
    }

    fn row(&self, azimuth: usize) -> &'a [u8] {
        let row = (azimuth + self.offset) % self.height;
        &self.data[row * self.step..][..self.width]
    }
}

/// Returns the time of receipt, ns, of an azimuth of an encoder count in a turn that has ended at
/// `end_ns`.
fn arrival(radar: &Configuration, end_ns: i64) -> impl Fn(u16) -> i64 + use<> {
    let counts = f64::from(radar.encoder_size.max(1));
    let period_ns = radar.period_ns() as f64;
    move |encoder| {
        let left = 1.0 - f64::from(encoder) / counts;
        end_ns.saturating_sub((left * period_ns) as i64)
    }
}
