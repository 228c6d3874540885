//! Radar odometry as cooperating processes.
