//! The stages of the pipeline, a module for each.

pub mod live_radar;
pub mod masking;
pub mod pose_integration;
pub mod radar_replay;
pub mod refinement;
pub mod search;
