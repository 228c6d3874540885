//! How like each other two recordings of radar scans are: statistics of each, and a distance for each statistic.
//!
//! Mathematics on [`gyre_radar::PolarScan`]; recordings are read elsewhere. Sensors differ in resolution and range, so all that is
//! compared is measured on one [`RangeGrid`], the coarsest and shortest of the recordings'.
//!
//! Reading order:
//! - [`meter`]: [`Meter`] takes scans one after the other, a line a statistic;
//! - [`grid`]: the common grid of range, and scans brought onto it;
//! - [`histogram`], [`ranges`]: how strong powers are, overall and range by range;
//! - [`correlation`]: over which distance they are alike;
//! - [`streaks`]: azimuths that are bright over their whole length;
//! - [`change`]: what differs between a scan and the next;
//! - [`statistics`]: all of that for one recording;
//! - [`comparison`]: the distances, and which of two recordings is closer;
//! - [`plot`]: the curves of several recordings as SVG; [`picture`]: scans for the eye.

pub mod change;
pub mod comparison;
pub mod correlation;
pub mod grid;
pub mod histogram;
pub mod meter;
pub mod picture;
pub mod plot;
pub mod ranges;
pub mod statistics;
pub mod streaks;

pub use change::{Change, ChangeMeter};
pub use comparison::{Comparison, compare};
pub use correlation::Curve;
pub use grid::{RangeGrid, Resampler};
pub use histogram::Histogram;
pub use meter::{Meter, MeterConfig};
pub use ranges::PowerByRange;
pub use statistics::{Measured, Recording, SearchErrors, Statistics};
pub use streaks::Streaks;
