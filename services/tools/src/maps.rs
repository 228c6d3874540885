//! Maps of runs: drawn from their keyframes, extended by further runs, and drives found in them.
//!
//! - [`map`](mod@map): `gyre map`;
//! - [`localise`](mod@localise): `gyre localise`;
//! - `folder`: the folder of a map, which is replaced as a whole.

mod folder;
pub mod localise;
pub mod map;
