//! `gyre watch`: shows a running run in a browser, and to Prometheus and Foxglove.

use std::{net::SocketAddr, path::PathBuf};

use clap::Args;
use gyre_client::Run;
use gyre_configuration::terminal::{Failure, print};
use gyre_results::absolute;
use gyre_tools::operate::RunChoice;
use gyre_transport::wake::Signals;
use gyre_watch::{Endpoint, Server, Token};

use crate::earlier;

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

/// Serves the page until a signal arrives. From another machine it is read with a token alone.
pub fn watch(arguments: &WatchArguments) -> Result<(), Failure> {
    // Before the server starts, so that a wrong folder is reported at once.
    let run = arguments.run.folder()?;
    if !arguments.wait {
        Run::open(&run)?;
    }
    let token = token(arguments)?;
    let listen = |address: SocketAddr| {
        let is_open = address.ip().is_loopback() && arguments.token_file.is_none();
        Endpoint::listen(address, token.clone().filter(|_| !is_open))
    };
    let page = listen(arguments.listen)?;
    let foxglove = arguments.foxglove.map(listen).transpose()?;
    let out = absolute(&run)?;
    print::note(format_args!(
        "gyre: {} is shown at {}",
        out.display(),
        page.url("http")
    ));
    if let Some(foxglove) = &foxglove {
        print::note(format_args!(
            "gyre: Foxglove and Lichtblick connect to {}",
            foxglove.url("ws")
        ));
    }
    if lets_others_in(arguments) {
        print::note(
            "gyre: whoever knows such an address can look on, and the network between carries it unencrypted",
        );
    }
    let signals = Signals::install()?;
    let shown = Server { page, foxglove }.show(out, earlier::is_complete, &signals);
    Ok(shown.map_err(|error| format!("cannot serve: {error}"))?)
}

fn token(arguments: &WatchArguments) -> Result<Option<Token>, Failure> {
    let Some(path) = &arguments.token_file else {
        return match lets_others_in(arguments) {
            true => Ok(Some(Token::random()?)),
            false => Ok(None),
        };
    };
    let token = Token::of_file(path);
    let failed = |error| format!("cannot use the token of {}: {error}", path.display());
    Ok(Some(token.map_err(failed)?))
}

fn lets_others_in(arguments: &WatchArguments) -> bool {
    let mut addresses = [arguments.listen].into_iter().chain(arguments.foxglove);
    addresses.any(|address| !address.ip().is_loopback())
}
