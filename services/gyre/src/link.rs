//! `gyre link send` and `gyre link receive`.

use std::{env, path::PathBuf, process::ExitCode};

use gyre_configuration::terminal::{Failure, INTERRUPTED, execute_again, own, print};
use gyre_contract::{Footprint, run::LinkConfig};
use gyre_link::ONE_THREAD;
use gyre_results::Out;
use gyre_tools::doctor::check_shared_memory;
use gyre_transport::{run::sweep, wake::Signals};

use crate::arguments::{LinkEnd, NetworkArguments, ReceiveArguments, SendArguments};

pub fn link(end: &LinkEnd) -> Result<ExitCode, Failure> {
    set_environment()?;
    match end {
        LinkEnd::Send(arguments) => send(arguments),
        LinkEnd::Receive(arguments) => receive(arguments),
    }
}

fn send(arguments: &SendArguments) -> Result<ExitCode, Failure> {
    let link = link_of(&arguments.network);
    let sent = gyre_link::send(&arguments.out, &link, &arguments.topics, arguments.linger_s)?;
    print::note(format_args!("gyre link: {sent}"));
    if sent.is_incomplete {
        print::note(
            "gyre link: a receiver was out of reach at the end and has not everything; the run's journal has its poses",
        );
    }
    Ok(match sent.is_incomplete {
        true => ExitCode::FAILURE,
        false => ExitCode::SUCCESS,
    })
}

fn receive(arguments: &ReceiveArguments) -> Result<ExitCode, Failure> {
    let out = Out::lock(&arguments.out)?;
    sweep();
    let link = link_of(&arguments.network);
    let signals = Signals::install()?;
    let Some(seen) = gyre_link::ask(&link, &signals)? else {
        return Ok(ExitCode::from(INTERRUPTED));
    };
    let manifest = seen.manifest(out.path());
    check_shared_memory(&Footprint::new(&manifest.window, &manifest.limits))?;
    print::note(format_args!(
        "gyre link: the run {} is here as {}",
        link.name,
        out.path().display()
    ));
    let gyre = own().to_string_lossy().into_owned();
    let (out, topics) = (out.path(), &arguments.topics);
    let received = gyre_link::receive(out, &link, topics, gyre, seen, &signals)?;
    print::note(format_args!("gyre link: {received}"));
    Ok(match received.is_complete() {
        _ if received.is_interrupted => ExitCode::from(INTERRUPTED),
        true => ExitCode::SUCCESS,
        false => ExitCode::FAILURE,
    })
}

/// Executes the same command again with the environment that the network layer needs.
pub fn set_environment() -> Result<(), Failure> {
    let (name, value) = ONE_THREAD;
    if env::var_os(name).is_some_and(|set| set == value) {
        return Ok(());
    }
    let failed = execute_again(env::args_os(), name, value);
    Err(format!("cannot begin with {name} in the environment: {failed}").into())
}

fn link_of(arguments: &NetworkArguments) -> LinkConfig {
    let file = |path: &Option<PathBuf>| path.clone().unwrap_or_default();
    LinkConfig {
        name: arguments.name.clone(),
        listen: arguments.listen.clone(),
        connect: arguments.connect.clone(),
        ca: file(&arguments.ca),
        certificate: file(&arguments.certificate),
        key: file(&arguments.key),
        ..LinkConfig::default()
    }
}
