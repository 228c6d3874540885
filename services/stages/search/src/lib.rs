//! The search for the motion between consecutive scans: its stages [`rotation`] and
//! [`translation`], and [`joint`], which replaces both.

pub mod joint;
pub mod rotation;
pub mod translation;
