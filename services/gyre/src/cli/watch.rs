//! The arguments of `gyre watch`.

use std::{net::SocketAddr, path::PathBuf};

use clap::Args;
use gyre_tools::operate::RunChoice;

#[derive(Debug, Args)]
pub struct WatchArguments {
    #[command(flatten)]
    pub run: RunChoice,
    /// The address to serve at. Any but the loopback's needs the token of the address that is
    /// printed.
    #[arg(long, default_value = "127.0.0.1:8080", value_name = "ADDRESS")]
    pub listen: SocketAddr,
    /// Serve Foxglove and Lichtblick too, at this address by their WebSocket protocol. Any but the
    /// loopback's needs the token.
    #[arg(long, value_name = "ADDRESS", num_args = 0..=1, default_missing_value = "127.0.0.1:8765")]
    pub foxglove: Option<SocketAddr>,
    /// The file of the token, which is written with a random one if it is missing. Default: another
    /// token at each start.
    #[arg(long, value_name = "FILE")]
    pub token_file: Option<PathBuf>,
    /// Wait for a run that has not started yet.
    #[arg(long)]
    pub wait: bool,
}
