//! Place recognition: finds the keyframes that saw the same place, at any heading, and the motion
//! between the two.
//!
//! - [`KeyframeSelector`]: which scans become keyframes; [`neighbours`]: which keyframes make a
//!   submap;
//! - [`Describer`]: the [`Descriptor`] of a submap, which does not depend on the heading and hardly
//!   on some metres to the side;
//! - [`PlaceIndex`]: the descriptors of all keyframes, and the search for similar ones; saved and
//!   loaded;
//! - [`LoopVerifier`]: registers two submaps, and accepts or rejects them as a loop.
//!
//! # Recipe
//! 1. A scan becomes a keyframe 2 m or 15 degrees from the last one.
//! 2. The sparse points of the keyframes within 10 m of the path either way are laid together by
//!    odometry: the submap. One scan alone sees too little. So a place is known only once the
//!    vehicle is 10 m past. Points are deskewed and free of the Doppler shift, which would put
//!    opposite passes a third of a metre apart.
//! 3. The descriptor is the polar magnitude spectrum that
//!    [`RotationSearch`](gyre_scan_matching::RotationSearch) computes, of the submap's points on
//!    cells of 0.8 m: logarithm of the magnitudes, 0.02 to 0.42 cycles a cell, 40 radii by 64
//!    harmonics over half a turn, each radius without its mean and with the same energy. A rotation
//!    of the place shifts it along the angle, and a translation hardly changes it. Two descriptors
//!    are compared by their correlation coefficient at the best shift, which is also the angle
//!    between the two, up to half a turn.
//! 4. The sieve: amplitudes of the first 16 harmonics alone, which no rotation changes, compared by
//!    the sum of absolute differences. The 32 nearest are ranked by the whole descriptor.
//! 5. The best places, 15 m apart from each other, are verified: at both angles the translation
//!    within 25 m by normalised correlation; then the alignment of the two keyframes' own points to
//!    a fraction of a cell; then the masked correlation of the submaps at that motion. It must be
//!    high, and clearly above every other translation and the other angle.
//!
//! Steps 1, 3, 4 and 5 follow a prototype that worked on rasters, with a blur and a root before and
//! after the transform. Points need neither, and are smaller than a raster.
//!
//! # Measured
//! By `gyre-lab places`, on a simulated drive of Oxford (9.0 km, 3,338 keyframes), a second one
//! along a drive of Boreas (7.9 km, 2,756) and a drive of RADIATE (350), each behind the refined
//! odometry and behind the search alone. Recall counts the first five within 10 m; closed are the
//! keyframes within 5 m of an earlier one that have a right loop; errors are of loops in the
//! opposite direction. RADIATE's ground truth is metres off between the two directions, so that it
//! shows wrong loops but no errors. Keyframes of Oxford and Boreas had the velocity from the pose
//! before to the pose after; keyframes of RADIATE have the run's.
//!
//! | drive, odometry | recall@5 | closed | wrong loops | mean forward | rms | correlation of right ones within 5 m, of wrong ones |
//! |---|---|---|---|---|---|---|
//! | Oxford, refined | 100 % | 100 % | 0 of 2,060 | -0.001 m | 0.035 m, 0.06 deg | above 0.77, below 0.57 |
//! | Oxford, search | 99.3 % | 99.7 % | 0 of 1,877 | 0.001 m | 0.036 m, 0.06 deg | above 0.73, below 0.61 |
//! | Boreas, refined | 100 % | 100 % | 0 of 3,738 | -0.001 m | 0.030 m, 0.04 deg | above 0.75, below 0.50 |
//! | Boreas, search | 100 % | 100 % | 0 of 3,694 | -0.004 m | 0.032 m, 0.05 deg | above 0.73, below 0.52 |
//! | RADIATE, refined | 100 % | 100 % | 0 of 142 | | | above 0.72, below 0.59 |
//! | RADIATE, search | 100 % | 100 % | 0 of 145 | | | above 0.71, below 0.59 |
//!
//! The smallest correlation of an accepted loop, 0.65, lies between right and wrong ones. The
//! normalised estimation error squared of these loops is 1.4 to 3.0 of its expectation, with the
//! scales of the covariance in `research/worlds/methods/simulated-oxford.toml`: they are somewhat
//! overconfident.
//!
//! # Memory
//! [`PlaceIndex::BYTES_PER_PLACE`] for a keyframe, including [`Descriptor::SIEVE_BYTES`] for the
//! sieve. The points of keyframes, which verification needs again, are the caller's: 20 bytes each.
//!
//! Everything is planned once: nothing is allocated afterwards but when a keyframe is added. The
//! same input gives the same result.
//!
//! # Frames and units
//! As in [`gyre_geometry`]. A motion is the pose of the queried (later) keyframe in the frame of
//! the found (earlier) one, and its covariance is the covariance of (x, y, yaw) along the axes of
//! the found one: a [`Constraint::closing`](crate::Constraint::closing) from the found keyframe to
//! the queried one.

mod descriptor;
mod file;
mod index;
mod keyframes;
mod verification;

pub use descriptor::{Describer, Descriptor};
pub use file::PlaceFileError;
pub use index::{Candidate, OrderError, PlaceIndex};
pub use keyframes::{KeyframeSelector, MAX_NEIGHBOURS, SUBMAP_REACH_M, neighbours};
pub use verification::{LoopVerifier, Verification, VerificationOutcome};

/// Cells per side of a submap's raster, and their size: 102 m to each side.
const RASTER_CELLS: usize = 255;
const CELL_M: f64 = 0.8;

const PLANNED: &str = "rasters and spectra have the shape that the searches are planned for";
