//! The run that a command is for.

use std::{
    env,
    io::{self, IsTerminal, Write as _},
    path::{Path, PathBuf},
};

use gyre_stage::control::Control;
use gyre_terminal::{Failure, print};

use crate::operate::arguments::RunChoice;

impl RunChoice {
    pub fn folder(&self) -> Result<PathBuf, Failure> {
        match self.named() {
            Some(run) => Ok(run.to_owned()),
            None => Ok(chosen(self)?.out().to_owned()),
        }
    }
}

/// Returns the run that is meant: the one that is named, or the only one, which is named here.
pub fn chosen(choice: &RunChoice) -> Result<Control, Failure> {
    if let Some(out) = choice.named() {
        return Ok(Control::of(out)?);
    }
    let run = only_run()?;
    name(&run);
    Ok(run)
}

/// Returns the run that is meant by a command that changes it. Without a name that is one which was
/// started from the current folder; for any other a person is asked, `what` being done to it.
pub fn chosen_to_change(choice: &RunChoice, what: &str) -> Result<Control, Failure> {
    if let Some(out) = choice.named() {
        return Ok(Control::of(out)?);
    }
    let run = only_run()?;
    let started_in = run.status()?.started_in;
    match env::current_dir().is_ok_and(|here| here == started_in) {
        true => name(&run),
        false => confirm(run.out(), &started_in, what)?,
    }
    Ok(run)
}

fn name(run: &Control) {
    print::note(format_args!("gyre: of the run in {}", run.out().display()));
}

fn only_run() -> Result<Control, Failure> {
    let mut runs = Control::of_all();
    if runs.len() > 1 {
        let names = runs.iter().map(|run| run.out().display().to_string());
        let names = names.collect::<Vec<_>>().join(", ");
        return Err(format!("several runs are running: name one of {names}").into());
    }
    let none = "no run is running: `gyre up` or `gyre run` starts one";
    Ok(runs.pop().ok_or(none)?)
}

/// Asks on a terminal whether a run from elsewhere is meant.
fn confirm(out: &Path, started_in: &Path, what: &str) -> Result<(), Failure> {
    let (out, started_in) = (out.display(), started_in.display());
    if !(io::stdin().is_terminal() && io::stderr().is_terminal()) {
        return Err(format!(
            "the only run writes to {out} and was started from {started_in}, not from here: if it is meant, name it: {out}"
        )
        .into());
    }
    write!(
        io::stderr(),
        "gyre: the only run writes to {out} and was started from {started_in}: {what}? [y/N] "
    )?;
    let mut answer = String::new();
    io::stdin().read_line(&mut answer)?;
    match agrees(&answer) {
        true => Ok(()),
        false => Err("nothing was done".into()),
    }
}

fn agrees(answer: &str) -> bool {
    matches!(answer.trim().to_lowercase().as_str(), "y" | "yes")
}

#[cfg(test)]
mod tests {
    use super::agrees;

    #[test]
    fn nothing_but_a_yes_agrees() {
        assert!(["y\n", "Y", " yes\n"].into_iter().all(agrees));
        assert!(!["", "\n", "n", "no", "yesterday"].into_iter().any(agrees));
    }
}
