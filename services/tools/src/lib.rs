//! Tools that are started by hand, a module for each.

pub mod bar;
pub mod batch;
pub mod benchmark;
pub mod conformance;
pub mod doctor;
pub mod export;
pub mod maps;
pub mod masks;
pub mod new;
pub mod operate;
pub mod radar_server;
pub mod report;
pub mod stress;
