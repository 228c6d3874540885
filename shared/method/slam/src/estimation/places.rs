//! Place recognition: finds the keyframes that saw the same place, at any heading, and the motion
//! between the two.
//!
//! Submaps of sparse points, laid together by odometry, are described by their polar magnitude
//! spectrum ([`Describer`]), compared ([`PlaceIndex`]), and registered ([`Registrar`]). A motion
//! is the pose of the queried (later) keyframe in the frame of the found (earlier) one. Everything
//! is planned once.
//!
//! - The verification: at both angles the translation within 25 m, the alignment of both keyframes'
//!   own points, and the masked correlation there, which must be high and clearly above every
//!   other. 0.65 lies between right loops (0.71 and more) and wrong ones (0.61 and less) of
//!   simulated drives of Oxford and Boreas and of one of RADIATE, by `gyre-lab places`.

mod descriptor;
mod file;
mod index;
mod keyframes;
mod registrar;
mod verification;

pub use descriptor::{Describer, Descriptor};
pub use file::PlaceFileError;
pub use index::{Candidate, OrderError, PlaceIndex};
pub use keyframes::{MAX_NEIGHBOURS, SUBMAP_REACH_M, neighbours};
pub use registrar::Registrar;
pub use verification::{LoopCandidate, LoopOutcome};

/// Cells per side of a submap's raster, and their size: 102 m to each side.
const RASTER_CELLS: usize = 255;
const CELL_M: f64 = 0.8;

const PLANNED: &str = "rasters and spectra have the shape that the searches are planned for";
