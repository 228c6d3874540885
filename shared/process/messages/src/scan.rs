//! `scan`: one polar scan as measured by the sensor.

use bytemuck::{Pod, Zeroable};
use gyre_radar::{MAX_AZIMUTHS, PolarScan, ScanSlot, Sense, SweepGeometry};

use crate::{
    block::ByteBlock,
    check::{Violation, require},
    item::{Item, StageId},
    limits::{History, Limits, TopicSizes, Window},
    message::{Message, Sender, header},
};

/// A polar scan: the power of azimuth `a` at range bin `b` is byte `first_byte + a * stride + b` of
/// the payload.
#[derive(Debug)]
pub enum Scan {}

impl Message for Scan {
    const TOPIC: &'static str = "scan";
    const SENDER: Sender = Sender::Stage(&[StageId::RadarReplay]);
    const READERS: usize = 1;
    const HISTORY: History = History::Stream;
    type Header = ScanHeader;
    type Element = ByteBlock;

    fn check_content(
        header: &Self::Header,
        payload: &[Self::Element],
        _: &Limits,
    ) -> Result<(), Violation> {
        header.check(bytemuck::cast_slice(payload))
    }

    fn max_elements(limits: &Limits) -> usize {
        ByteBlock::count(limits.scan_bytes)
    }

    /// Up to the last bin of the last row.
    fn content_bytes(header: &Self::Header) -> Option<usize> {
        header.end()
    }

    /// In live mode the history holds the scans that are published while masking restarts.
    fn sizes(window: &Window) -> TopicSizes {
        let sizes = window.queues(Self::HISTORY, Self::READERS);
        if window.live_depth == 0 {
            return sizes;
        }
        let depth = window.live_depth.max(sizes.history);
        TopicSizes {
            history: depth,
            buffer: depth,
            borrowed: depth + window.look_back,
            ..sizes
        }
    }
}
header!(ScanHeader, "gyre_scan_header_v5");

/// The geometry of a scan, and the measured angle and time of each azimuth.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct ScanHeader {
    /// The scan.
    pub item: Item,
    /// Number of rows.
    pub azimuths: u32,
    /// Range bins per row.
    pub bins: u32,
    /// Bytes from the first bin of a row to that of the next row.
    pub stride: u32,
    /// Position of the first bin of the first row.
    pub first_byte: u32,
    /// Size of a range bin, m.
    pub range_resolution_m: f32,
    /// Offset of ranges, m: the centre of bin `b` is at
    /// `(b + 0.5) * range_resolution_m + range_offset_m`.
    pub range_offset_m: f32,
    /// 1 if azimuths grow clockwise seen from above, else 0.
    pub clockwise: u32,
    /// Metres to add to a range for each m/s of approach; 0 if unknown: see
    /// [`SweepGeometry::doppler_s`].
    pub doppler_s: f32,
    /// Time of each row, ns since 1970.
    pub azimuth_stamp_ns: [i64; MAX_AZIMUTHS],
    /// Angle of each row from straight ahead, rad in [0, 2 pi).
    pub azimuth_rad: [f32; MAX_AZIMUTHS],
    /// Flags of each row: see `gyre_radar::scan::flag`.
    pub azimuth_flags: [u8; MAX_AZIMUTHS],
}

impl Default for ScanHeader {
    fn default() -> Self {
        Self::zeroed()
    }
}

impl ScanHeader {
    /// Returns a view of the scan in this header and its payload; `None` if the payload is shorter
    /// than the header says.
    pub fn view<'a>(&'a self, bytes: &'a [u8]) -> Option<PolarScan<'a>> {
        let geometry = self.geometry();
        let fits = geometry.azimuths <= MAX_AZIMUTHS && self.end()? <= bytes.len();
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
    fn end(&self) -> Option<usize> {
        let geometry = self.geometry();
        let rows = geometry
            .stride
            .checked_mul(geometry.azimuths.checked_sub(1)?)?;
        let last_row = geometry.first_byte.checked_add(rows)?;
        last_row.checked_add(geometry.bins)
    }

    /// Checks the geometry, the angles and the times, and that the payload is as long as the
    /// geometry says.
    fn check(&self, bytes: &[u8]) -> Result<(), Violation> {
        let azimuths = self.azimuths as usize;
        let range = format_args!("1 to {MAX_AZIMUTHS}");
        require(
            (1..=MAX_AZIMUTHS).contains(&azimuths),
            "azimuths",
            azimuths,
            range,
        )?;
        let scan = self.view(bytes).ok_or_else(|| {
            Violation(format!(
                "its payload of {} bytes is shorter than its header says: {azimuths} azimuths x {} bins, {} bytes apart from byte {} on",
                bytes.len(),
                self.bins,
                self.stride,
                self.first_byte
            ))
        })?;
        let checked = scan.check().and_then(|()| scan.check_times());
        checked.map_err(|error| Violation(error.to_string()))
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

    /// Stores the geometry of the scan that a dataset reader put into the slot.
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

    /// Adds to the time of the scan and of its rows, ns: a recording that is played again goes on
    /// in time.
    pub fn shift_times(&mut self, shift_ns: i64) {
        if shift_ns == 0 {
            return;
        }
        let rows = self.azimuths as usize;
        let stamps = self.azimuth_stamp_ns.iter_mut().take(rows);
        for stamp_ns in stamps.chain([&mut self.item.stamp_ns]) {
            *stamp_ns = stamp_ns.saturating_add(shift_ns);
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
            sense: if self.clockwise == 1 {
                Sense::Clockwise
            } else {
                Sense::CounterClockwise
            },
            stamp_ns: self.item.stamp_ns,
        }
    }
}

#[cfg(test)]
mod tests {
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
}
