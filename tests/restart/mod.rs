//! Restarts and results: whatever is killed, full or taken away, the results are the undisturbed
//! ones.

mod doppler;
mod faults;
mod full_disk;
mod gyro;
mod identity;
mod killed_stages;
mod objects;
mod power_failure;
mod results;
mod shared_memory;
mod supervisor;
