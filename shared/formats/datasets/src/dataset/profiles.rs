//! The formats of folders of images: their folders, and the parameters of formats with Navtech
//! metadata columns.
//!
//! - Oxford Radar RobotCar: `radar/<us>.png`, 400 azimuths x (11 + 3768), named by the start of the
//!   sweep; azimuths clockwise from ahead. OORD uses the same format; its encoder columns are
//!   unreliable.
//! - Boreas, and Boreas Road Trip with its newer radar: named by the time of azimuth `n / 2 - 1`.
//!   The antenna does not turn quite uniformly, so the encoder is used. A bin is at
//!   `bin * resolution - 0.31 m`; whether this is its near edge or its centre is not documented,
//!   and half a bin (0.02 m) is below the accuracy of the offset.
//! - MulRan, converted to the format of Oxford with stamps in ns: named by the last row's stamp.
//! - FoMo, of a Navtech RAS6: fomo-sdk's converter to bags
//!   (`fomo_rust/src/fomo_rust_sdk/sensors/radar.rs`) gives 5600 encoder counts, and fomo-bench's
//!   settings for teach and repeat (`cir_warthog_default_blue.yaml`) 5600 counts and -0.31991 m.
//!   Only the Python kit gives 5595 and no offset. Real rows decide: 400 with steps of 14 are 5600,
//!   from 7 to 5593, so that half a step remains at either end.

use gyre_geometry::scan::{Sense, SweepGeometry};

use super::{
    first_image::{FirstImage, NamedBy},
    format::Format,
    navtech_png::ByteTen,
    options::{AzimuthSource, DatasetOptions},
    stamp::SECOND_NS,
};

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ScanTime {
    /// The mean of the first and last row's stamps.
    Halfway,
    /// The stamp of row `n / 2 - 1`.
    MiddleRow,
}

impl ScanTime {
    pub(crate) fn of_rows(self) -> &'static str {
        match self {
            Self::Halfway => {
                "Rows have stamps; the time of a scan is the mean of its first and last row's stamps."
            }
            Self::MiddleRow => "Rows have stamps; the time of a scan is the time of row n/2 - 1.",
        }
    }
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct Profile {
    pub(crate) range_resolution_m: f32,
    pub(crate) range_offset_m: f32,
    pub(crate) doppler_s: f32,
    pub(crate) azimuth_eccentricity_rad: f32,
    pub(crate) encoder_counts: u16,
    pub(crate) azimuth_source: AzimuthSource,
    pub(crate) scan_time: ScanTime,
    /// True if row stamps come in bursts, and are replaced by a linear fit over the azimuth.
    pub(crate) smooth_stamps: bool,
    pub(crate) byte_ten: ByteTen,
    pub(crate) named_by: NamedBy,
    pub(crate) stamp_meaning: &'static str,
    /// The range bins of an image; `None` if only the folder shows the format.
    pub(crate) bins: Option<usize>,
    pub(crate) chirps: bool,
}

pub(crate) type Known = (Format, &'static [&'static str], Option<Profile>);

/// The development kit of Oxford gives 0.0432 m for a bin: then paths are 1.4 % shorter than the
/// ground truth.
const OXFORD: Profile = Profile {
    range_resolution_m: 0.0438,
    range_offset_m: 0.0,
    doppler_s: 0.0,
    azimuth_eccentricity_rad: 0.0,
    encoder_counts: 5600,
    azimuth_source: AzimuthSource::Encoder,
    scan_time: ScanTime::Halfway,
    smooth_stamps: true,
    byte_ten: ByteTen::Validity,
    named_by: NamedBy::Start,
    stamp_meaning: "Files are named by the stamp of the first row; the time of a scan is the mean of its first and last row's \
                    stamps, as in the ground truth, and the stamps of the rows are a linear fit over the azimuth.",
    bins: Some(3768),
    chirps: false,
};
const BOREAS: Profile = Profile {
    range_resolution_m: 0.04381,
    range_offset_m: -0.31,
    scan_time: ScanTime::MiddleRow,
    smooth_stamps: false,
    byte_ten: ByteTen::Unused,
    named_by: NamedBy::Middle,
    stamp_meaning: "Files are named by the stamp of azimuth n/2 - 1, the middle of the sweep, which is the time of the scan, as in the ground truth.",
    bins: Some(3360),
    ..OXFORD
};
/// Depth of a range bin of Boreas before the change of its firmware, m, and that date: 2021-09-21
/// 00:00 UTC.
const BOREAS_BEFORE: (f32, i64) = (0.0596, 1_632_182_400 * SECOND_NS);

/// Depth of a range bin of MulRan, m: 200 m over 3360 bins.
pub(crate) const MULRAN_RESOLUTION_M: f32 = 200.0 / 3360.0;

/// The formats, in the order of the search for their folders.
pub(crate) const KNOWN: [Known; 8] = [
    (Format::Radiate, &["Navtech_Polar"], None),
    (
        Format::Oord,
        &["Navtech_CTS350-X_Radar"],
        Some(Profile {
            azimuth_source: AzimuthSource::Uniform,
            bins: None,
            ..OXFORD
        }),
    ),
    (
        Format::MulranOxfordForm,
        &[
            "polar_oxford_form",
            "radar/polar_oxford_form",
            "sensor_data/radar/polar_oxford_form",
        ],
        Some(Profile {
            range_resolution_m: MULRAN_RESOLUTION_M,
            byte_ten: ByteTen::Unused,
            named_by: NamedBy::End,
            stamp_meaning: "Files are named by the end of the sweep; the time of a scan is the mean of its first and last row's stamps.",
            bins: Some(3360),
            ..OXFORD
        }),
    ),
    (
        Format::Mulran,
        &["sensor_data/radar/polar", "radar/polar", "polar"],
        None,
    ),
    (
        Format::Fomo,
        &["navtech"],
        Some(Profile {
            range_offset_m: -0.32,
            smooth_stamps: false,
            byte_ten: ByteTen::Unused,
            stamp_meaning: "Files are named by the stamp of the first row; the time of a scan is the mean of its first and last row's stamps.",
            bins: Some(6848),
            ..OXFORD
        }),
    ),
    (Format::Oxford, &["radar"], Some(OXFORD)),
    (Format::Boreas, &["radar"], Some(BOREAS)),
    (
        Format::BoreasRt,
        &["radar"],
        Some(Profile {
            bins: Some(6848),
            chirps: true,
            ..BOREAS
        }),
    ),
];

impl Format {
    /// The folders that hold its images, relative to a recording, the usual one first.
    pub fn folders(self) -> &'static [&'static str] {
        let known = KNOWN.iter().find(|known| known.0 == self);
        known.map_or(&[], |known| known.1)
    }
}

impl Profile {
    pub(crate) fn without_rows(range_resolution_m: f32, options: &DatasetOptions) -> Self {
        let profile = Self {
            range_resolution_m,
            ..OXFORD
        };
        profile.with(Format::Other, None, options)
    }

    /// The geometry of a sweep whose rows have these bytes: of metadata and of powers.
    pub(crate) fn geometry(
        &self,
        azimuths: usize,
        [first_byte, bins]: [usize; 2],
        stamp_ns: i64,
    ) -> SweepGeometry {
        SweepGeometry {
            azimuths,
            bins,
            stride: first_byte + bins,
            first_byte,
            range_resolution_m: self.range_resolution_m,
            range_offset_m: self.range_offset_m,
            doppler_s: self.doppler_s,
            sense: Sense::Clockwise,
            stamp_ns,
        }
    }

    /// Returns the parameters of a format; `None` if its images have no metadata columns.
    pub(crate) fn of(format: Format) -> Option<Self> {
        KNOWN.iter().find(|known| known.0 == format)?.2
    }

    pub(crate) fn with(
        mut self,
        format: Format,
        first_image: Option<&FirstImage>,
        options: &DatasetOptions,
    ) -> Self {
        let (before_m, until_ns) = BOREAS_BEFORE;
        let start_ns = first_image.and_then(|image| image.row_ns(0));
        if format == Format::Boreas && start_ns.is_some_and(|ns| ns < until_ns) {
            self.range_resolution_m = before_m;
        }
        macro_rules! take {
            ($($option:ident)*) => { $(self.$option = options.$option.unwrap_or(self.$option);)* };
        }
        take!(range_resolution_m range_offset_m doppler_s azimuth_eccentricity_rad);
        take!(encoder_counts azimuth_source);
        self
    }
}
