//! Messages of a run as a recorder receives them. The tests of recordings, and of their fuzzing,
//! take them from here.

use bytemuck::{NoUninit, Zeroable, bytes_of};
use gyre_contract::{Item, ScanHeader};
use gyre_recording::{Head, Incoming};

pub const START_NS: i64 = 1_549_986_607_000_000_000;

pub fn item(seq: u64) -> Item {
    let stamp_ns = START_NS + seq as i64 * 250_000_000;
    Item {
        published: seq,
        ..Item::recorded(seq, seq + 10, stamp_ns)
    }
}

pub fn message(topic: &'static str, header: &impl NoUninit) -> Incoming {
    Incoming {
        topic,
        header: bytes_of(header).to_vec(),
        payload: Vec::new(),
        received_ns: START_NS,
        missed: 0,
        skipped: None,
    }
}

/// A scan with metadata before each row, as in images of Oxford.
pub fn scan(item: Item) -> Incoming {
    let mut header = ScanHeader {
        item,
        azimuths: 4,
        bins: 10,
        stride: 21,
        first_byte: 11,
        range_resolution_m: 0.5,
        range_offset_m: -0.25,
        clockwise: 1,
        ..ScanHeader::zeroed()
    };
    header.azimuth_stamp_ns[..4].fill(item.stamp_ns);
    header.azimuth_rad[..4].copy_from_slice(&[0.0, 1.5, 3.0, 4.5]);
    let bytes = 0..11 + 3 * 21 + 10;
    Incoming {
        payload: bytes.map(|byte| (byte * 7 + item.seq) as u8).collect(),
        ..message("scan", &header)
    }
}

pub fn head(id: &str, part: usize) -> Head {
    let stored = "[dataset]\nformat = \"radiate\"\nazimuth_eccentricity_rad = 0.0025\n";
    Head {
        id: id.to_owned(),
        part,
        configuration: stored.to_owned(),
        topics: ["scan", "pose"].map(str::to_owned).to_vec(),
        scan_bytes: 128,
        mode: "lossless".to_owned(),
    }
}
