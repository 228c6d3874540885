//! The run that a command is for.

use gyre_stage::control::Control;
use gyre_terminal::Failure;

use crate::arguments::RunChoice;

/// Returns the run that is meant: the one that is named, or the only one.
///
/// # Errors
/// There is no such run, or there are several and none is named.
pub fn chosen(choice: &RunChoice) -> Result<Control, Failure> {
    if let Some(out) = &choice.out {
        return Ok(Control::of(out)?);
    }
    let mut runs = Control::of_all();
    match (runs.pop(), runs.is_empty()) {
        (None, _) => Err("no run is running: `gyre up` or `gyre run` starts one".into()),
        (Some(run), true) => Ok(run),
        (Some(last), false) => {
            let names = runs.iter().chain([&last]).map(|run| run.out().display());
            let names: Vec<String> = names.map(|name| name.to_string()).collect();
            let names = names.join(", ");
            Err(format!("several runs are running: choose one with --out, of {names}").into())
        }
    }
}
