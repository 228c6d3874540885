//! Restarts and results: whatever is killed, full or taken away, the results are the undisturbed
//! ones.

mod commands;
pub mod faults;
mod full_disk;
mod identity;
mod killed_stages;
mod power_failure;
pub mod results;
mod shared_memory;
mod supervisor;
