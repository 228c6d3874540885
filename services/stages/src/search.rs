//! The search for the motion between consecutive scans: its stages [`rotation`] and
//! [`translation`], and [`joint`], which replaces both; [`python`]: functions in their places.

pub mod joint;
pub mod python;
pub mod rotation;
pub mod translation;
