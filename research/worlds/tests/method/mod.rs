//! The method on simulated worlds: statistics over whole drives.

mod covariances;
mod doppler;
mod k2pi;
mod lost_azimuths;
mod stop_and_go;
mod tunnel;
