//! The method by the processes of a run: the same bits every time, and the accuracy that is to be
//! kept.

pub mod in_process;
pub mod learned_masks;
mod masks;
mod pipeline;
mod real_scans;
mod refinement;
pub mod standstill;
