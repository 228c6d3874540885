//! `gyre watch`: shows a running run in a browser, and to Prometheus.

use std::{io, path::PathBuf, process::ExitCode};

use gyre_stage::{observer::ObservedRun, wake::Signals};
use gyre_watch::{Server, Token};

use crate::{Failure, cli::WatchArguments, earlier, print};

/// Serves the page until a signal arrives. From another machine it is read with a token alone.
///
/// # Errors
/// There is no such run, the token's file cannot be used, or the address cannot be served at.
pub fn watch(arguments: &WatchArguments) -> Result<ExitCode, Failure> {
    // Before anything is served: one who watches the wrong folder is told at once.
    if !arguments.wait {
        ObservedRun::writing_to(&arguments.out)?;
    }
    let server = Server::listen(arguments.listen, token(arguments)?)?;
    let out = absolute(&arguments.out)?;
    print::note(format_args!(
        "gyre: {} is shown at {}",
        out.display(),
        link(&server)
    ));
    if !arguments.listen.ip().is_loopback() {
        print::note(
            "gyre: whoever knows this address can look on, and the network between carries it unencrypted",
        );
    }
    let signals = Signals::install()?;
    server.show(out, earlier::is_complete, &signals)?;
    Ok(ExitCode::SUCCESS)
}

/// Returns the token of the file, or a random one if other machines can connect.
fn token(arguments: &WatchArguments) -> Result<Option<Token>, Failure> {
    let Some(path) = &arguments.token_file else {
        return match arguments.listen.ip().is_loopback() {
            true => Ok(None),
            false => Ok(Some(Token::random()?)),
        };
    };
    let token = Token::of_file(path);
    let failed = |error| format!("cannot use the token of {}: {error}", path.display());
    Ok(Some(token.map_err(failed)?))
}

/// Returns the folder's full name, which need not exist yet.
fn absolute(out: &PathBuf) -> io::Result<PathBuf> {
    out.canonicalize().or_else(|_| std::path::absolute(out))
}

/// Returns the address for a browser. One of all interfaces is reached by the machine's name.
fn link(server: &Server) -> String {
    let address = server.address();
    let host = match address.ip().is_unspecified() {
        true => {
            let system = rustix::system::uname();
            let name = system.nodename().to_string_lossy();
            format!("{name}:{}", address.port())
        }
        false => address.to_string(),
    };
    let token = server.token().map(Token::as_str);
    let query = token.map_or(String::new(), |token| format!("?token={token}"));
    format!("http://{host}/{query}")
}
