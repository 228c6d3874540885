//! Maps of runs: drawn from their keyframes, extended by further runs, and drives found in them.
//!
//! - [`map`](mod@map): `gyre map`;
//! - [`localise`](mod@localise): `gyre localise`.

pub mod localise;
pub mod map;
