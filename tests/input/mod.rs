//! Input: recordings, times and files that are wrong, away or hostile, bags, and simulated drives.

mod bags;
pub mod breaks;
mod hostile;
mod lost;
mod named;
mod refused;
mod simulation;
