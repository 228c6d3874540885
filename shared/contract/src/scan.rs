//! `scan`: one polar scan as measured by the sensor.

use std::ops::Range;

use gyre_geometry::{
    MAX_AZIMUTHS, PolarScan, ScanSlot, Sense, SweepGeometry,
    samples::{MAX_RATE_RADPS, MAX_SPEED_MPS, Sample},
};

use crate::{
    item::Item,
    limits::Limits,
    message::{ByteBlock, Header},
    wire::{Bounds, wire},
};

/// Rows without an azimuth have no meaning.
const ROWS: Bounds = Bounds::CountedBy("azimuths");

wire! {
    /// The geometry of a scan, and the measured angle and time of each azimuth. The power of
    /// azimuth `a` at range bin `b` is byte `first_byte + a * stride + b` of the payload. The
    /// samples of other sensors follow in the payload's next block: [`ScanHeader::samples`].
    pub struct ScanHeader = "gyre_scan_header_v7" {
        pub item: Item,
        pub azimuths: u32 [Bounds::Within(1.0, MAX_AZIMUTHS as f64)],
        pub bins: u32,
        /// Bytes from the first bin of a row to the first bin of the next row.
        pub stride: u32,
        pub first_byte: u32,
        pub range_resolution_m: f32,
        /// Offset of ranges, m: the centre of bin `b` is at
        /// `(b + 0.5) * range_resolution_m + range_offset_m`.
        pub range_offset_m: f32,
        /// 1 if azimuths grow clockwise seen from above, else 0.
        pub clockwise: u32,
        /// Metres to add to a range for each m/s of approach; 0 if unknown: see
        /// [`SweepGeometry::doppler_s`].
        pub doppler_s: f32,
        /// Number of samples of other sensors after the powers.
        pub samples: u32 [Bounds::AtMost(|it| it.samples as f64)],
        /// Number of samples since the scan before that were left out: late, or unusable.
        pub samples_left_out: u32,
        /// Time of each row, ns since 1970.
        pub azimuth_stamp_ns: [i64; MAX_AZIMUTHS] [ROWS],
        /// Angle of each row from straight ahead, rad in [0, 2 pi).
        pub azimuth_rad: [f32; MAX_AZIMUTHS] [ROWS],
        /// Flags of each row: see `gyre_geometry::scan::flag`.
        pub azimuth_flags: [u8; MAX_AZIMUTHS] [ROWS],
    }
}

impl Header for ScanHeader {
    /// Checks the geometry, the angles, the times and the samples, and that the length of the
    /// payload fits the geometry.
    fn check_content(&self, bytes: &[u8], _: &Limits) -> Result<(), String> {
        let (length, azimuths) = (bytes.len(), self.azimuths as usize);
        let scan = self.view(bytes).ok_or_else(|| {
            format!(
                "its payload of {length} bytes is shorter than its header states: {azimuths} azimuths x {} bins, {} bytes apart from byte {} on",
                self.bins, self.stride, self.first_byte
            )
        })?;
        let checked = scan.check().and_then(|()| scan.check_times());
        checked.map_err(|error| error.to_string())?;
        let samples = self.samples(bytes).ok_or_else(|| {
            let samples = self.samples;
            format!(
                "its payload of {length} bytes is shorter than its header states: {samples} samples"
            )
        })?;
        if let Some(index) = samples.iter().position(|sample| !sample.is_valid()) {
            let sample = samples[index];
            return Err(format!(
                "sample {index} is {sample:?}, but must be of a known kind, finite, and at most {MAX_RATE_RADPS} rad/s or {MAX_SPEED_MPS} m/s"
            ));
        }
        match samples.is_sorted_by(|one, next| one.order() < next.order()) {
            true => Ok(()),
            false => Err("a sample is not later than the one before".to_owned()),
        }
    }

    fn max_elements(limits: &Limits) -> usize {
        ByteBlock::count(limits.scan_bytes) + limits.samples
    }

    /// Up to the last bin of the last row, or the last sample.
    fn content_bytes(&self) -> Option<usize> {
        match self.samples {
            0 => self.power_bytes(),
            _ => Some(self.sample_bytes()?.end),
        }
    }

    fn words(&self, payload: &[u8]) -> String {
        let Some(scan) = self.view(payload) else {
            return "its rows do not fit its header".to_owned();
        };
        // Four bytes are enough for a row, and are added faster than eight.
        let row = |row| scan.row(row).iter().map(|power| u32::from(*power));
        let rows = (0..scan.geometry.azimuths).map(|number| u64::from(row(number).sum::<u32>()));
        let power: u64 = rows.sum();
        let (azimuths, bins) = (scan.geometry.azimuths, scan.geometry.bins);
        let mean = power as f64 / (azimuths * bins).max(1) as f64;
        format!("{azimuths} azimuths of {bins} bins, mean power {mean:.2}")
    }
}

impl ScanHeader {
    /// Returns a view of the scan in this header and its payload; `None` if the payload is too
    /// short for its header.
    pub fn view<'a>(&'a self, bytes: &'a [u8]) -> Option<PolarScan<'a>> {
        let geometry = self.geometry();
        let fits = geometry.azimuths <= MAX_AZIMUTHS && self.power_bytes()? <= bytes.len();
        fits.then(|| PolarScan {
            geometry,
            bytes,
            azimuth_rad: &self.azimuth_rad[..geometry.azimuths],
            stamp_ns: &self.azimuth_stamp_ns[..geometry.azimuths],
            flags: &self.azimuth_flags[..geometry.azimuths],
        })
    }

    /// Returns the position behind the last bin of the last row; `None` without rows, or beyond all
    /// memory.
    pub fn power_bytes(&self) -> Option<usize> {
        let geometry = self.geometry();
        let rows = geometry
            .stride
            .checked_mul(geometry.azimuths.checked_sub(1)?)?;
        let last_row = geometry.first_byte.checked_add(rows)?;
        last_row.checked_add(geometry.bins)
    }

    /// Returns the times of the first and of the last azimuth, ns since 1970; the stamp twice
    /// without azimuths.
    pub fn span_ns(&self) -> [i64; 2] {
        let rows = (self.azimuths as usize).min(MAX_AZIMUTHS);
        let stamps = self.azimuth_stamp_ns[..rows].iter().copied();
        let or_stamp = |ns: Option<i64>| ns.unwrap_or(self.item.stamp_ns);
        [or_stamp(stamps.clone().min()), or_stamp(stamps.max())]
    }

    fn first_sample(&self) -> Option<usize> {
        self.power_bytes()?.checked_next_multiple_of(ByteBlock::LEN)
    }

    /// Views the samples, in the order of [`Sample::order`]; `None` if the payload is too short for
    /// its header.
    pub fn samples<'a>(&self, bytes: &'a [u8]) -> Option<&'a [Sample]> {
        if self.samples == 0 {
            return Some(&[]);
        }
        bytemuck::try_cast_slice(bytes.get(self.sample_bytes()?)?).ok()
    }

    /// Copies the samples of a payload that is aligned anyhow; as [`samples`](Self::samples).
    pub fn read_samples(&self, bytes: &[u8]) -> Option<Vec<Sample>> {
        if self.samples == 0 {
            return Some(Vec::new());
        }
        let samples = bytes
            .get(self.sample_bytes()?)?
            .chunks_exact(size_of::<Sample>());
        Some(samples.map(bytemuck::pod_read_unaligned).collect())
    }

    fn sample_bytes(&self) -> Option<Range<usize>> {
        let first = self.first_sample()?;
        let bytes = (self.samples as usize).checked_mul(size_of::<Sample>())?;
        Some(first..first.checked_add(bytes)?)
    }

    /// Stores the samples behind the powers, whose geometry is set; those for which there is no
    /// room are left out, and counted.
    pub fn set_samples(&mut self, bytes: &mut [u8], samples: &[Sample], left_out: usize) {
        let first = self.first_sample().unwrap_or(usize::MAX);
        let room = bytes.len().saturating_sub(first) / size_of::<Sample>();
        let stored = &samples[..samples.len().min(room)];
        if let Some(place) = bytes.get_mut(first..).filter(|_| !stored.is_empty()) {
            let stored = bytemuck::cast_slice(stored);
            place[..stored.len()].copy_from_slice(stored);
        }
        self.samples = stored.len() as u32;
        self.samples_left_out = (left_out + samples.len() - stored.len()) as u32;
    }

    /// Returns the buffers that a dataset reader fills: the tables of this header and the bytes of
    /// the payload.
    pub fn slot<'a>(&'a mut self, bytes: &'a mut [u8]) -> ScanSlot<'a> {
        ScanSlot {
            bytes,
            azimuth_rad: &mut self.azimuth_rad,
            stamp_ns: &mut self.azimuth_stamp_ns,
            flags: &mut self.azimuth_flags,
        }
    }

    pub fn set_geometry(&mut self, geometry: &SweepGeometry) {
        self.azimuths = geometry.azimuths as u32;
        self.bins = geometry.bins as u32;
        self.stride = geometry.stride as u32;
        self.first_byte = geometry.first_byte as u32;
        self.range_resolution_m = geometry.range_resolution_m;
        self.range_offset_m = geometry.range_offset_m;
        self.clockwise = (geometry.sense == Sense::Clockwise).into();
        self.doppler_s = geometry.doppler_s;
        self.item.stamp_ns = geometry.stamp_ns;
    }

    /// Adds to the time of the scan, of its rows and of its samples, ns, so that time advances when
    /// a recording is played again.
    pub fn shift_times(&mut self, shift_ns: i64, bytes: &mut [u8]) {
        if shift_ns == 0 {
            return;
        }
        let rows = self.azimuths as usize;
        let stamps = self.azimuth_stamp_ns.iter_mut().take(rows);
        for stamp_ns in stamps.chain([&mut self.item.stamp_ns]) {
            *stamp_ns = stamp_ns.saturating_add(shift_ns);
        }
        let bytes = self.sample_bytes().and_then(|range| bytes.get_mut(range));
        let samples: Option<&mut [Sample]> =
            bytes.and_then(|bytes| bytemuck::try_cast_slice_mut(bytes).ok());
        for sample in samples.into_iter().flatten() {
            sample.stamp_ns = sample.stamp_ns.saturating_add(shift_ns);
        }
    }

    fn geometry(&self) -> SweepGeometry {
        SweepGeometry {
            azimuths: self.azimuths as usize,
            bins: self.bins as usize,
            stride: self.stride as usize,
            first_byte: self.first_byte as usize,
            range_resolution_m: self.range_resolution_m,
            range_offset_m: self.range_offset_m,
            doppler_s: self.doppler_s,
            sense: match self.clockwise {
                1 => Sense::Clockwise,
                _ => Sense::CounterClockwise,
            },
            stamp_ns: self.item.stamp_ns,
        }
    }
}

#[cfg(test)]
mod tests {
    use bytemuck::Zeroable;

    use super::*;

    #[test]
    fn a_header_that_describes_more_than_its_payload_is_rejected() {
        let mut header = ScanHeader {
            azimuths: 4,
            bins: 10,
            stride: 21,
            first_byte: 11,
            ..ScanHeader::default()
        };
        let bytes = [7; 4 * 21];
        assert_eq!(header.view(&bytes).map(|scan| scan.row(3).len()), Some(10));
        assert!(header.view(&bytes[1..]).is_none());
        header.azimuths = 0;
        assert!(header.view(&bytes).is_none());
        header.azimuths = u32::MAX;
        assert!(header.view(&bytes).is_none());
    }

    #[test]
    fn samples_are_stored_behind_the_powers_and_those_without_room_are_counted() {
        let mut header = ScanHeader {
            azimuths: 2,
            bins: 10,
            stride: 35,
            ..ScanHeader::default()
        };
        let samples: Vec<_> = (1..4).map(|ns| Sample::yaw_rate(ns, 0.1)).collect();
        let mut blocks = [ByteBlock::zeroed(); 3];
        let bytes: &mut [u8] = bytemuck::cast_slice_mut(&mut blocks);
        bytes[..45].fill(7);
        header.set_samples(bytes, &samples, 4);
        assert_eq!((header.samples, header.samples_left_out), (2, 5));
        assert_eq!(header.samples(bytes), Some(&samples[..2]));
        assert_eq!(header.read_samples(bytes), Some(samples[..2].to_vec()));
        assert_eq!(header.content_bytes(), Some(192));
        assert_eq!(header.view(bytes).map(|scan| scan.row(1)[9]), Some(7));
        header.shift_times(100, bytes);
        let stamps = header.samples(bytes).unwrap_or_default().iter();
        assert!(stamps.map(|it| it.stamp_ns).eq([101, 102]));
        assert_eq!(header.samples(&bytes[..191]), None);
        header.set_samples(&mut [], &samples, 0);
        assert_eq!((header.samples, header.samples_left_out), (0, 3));
        assert_eq!(header.content_bytes(), Some(45));
    }
}
