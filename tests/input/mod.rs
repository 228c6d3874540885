//! Input: recordings, times and files that are wrong, away or hostile, bags, lost azimuths, and
//! simulated drives.

mod bags;
pub mod breaks;
mod hostile;
mod lost;
mod lost_azimuths;
mod named;
mod refused;
mod simulation;
