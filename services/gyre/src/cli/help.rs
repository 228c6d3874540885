//! The help: commands in groups, each with examples.

use clap::{Arg, Command, CommandFactory};
use gyre_configuration::terminal::{WIDTH, wrap};

use super::Gyre;

/// The groups of commands in the order of the help, with examples of each command.
const GROUPS: &str = "\
Start:
gyre demo
gyre demo --set masking.kind=threshold --fresh
gyre run DRIVE
gyre run oxford DRIVE --out out/oxford
gyre inspect DRIVE
gyre inspect drive.mcap --json
gyre config
gyre config oxford > robot.toml
gyre doctor

See the results:
gyre report out/demo --open
gyre report out/a out/b other.tum
gyre evaluate out/demo
gyre evaluate other.tum truth.tum --plots plots
gyre map out/demo --out town
gyre map out/demo --out town --format geotiff --origin 51.76,-1.26,90
gyre localise DRIVE --map town
gyre localise oxford DRIVE --map town --out out/localised
gyre export out/demo --mcap demo-bag
gyre export out/drive --format radiate --out repaired

Many drives, another radar:
gyre batch DRIVES --config oxford
gyre batch drives.csv --out out/batch --jobs 4
gyre benchmark boreas DRIVES --out out/boreas
gyre calibrate robot.toml DRIVE --distance-m 1520
gyre calibrate DRIVE --with ANOTHER-DRIVE
gyre masks DRIVE
gyre masks demo --scans 10,20
gyre simulate demo --out recording
gyre simulate --trajectory drive.tum --format boreas --out recording

Operate a running run:
gyre up 192.168.0.1 robot.toml
gyre up demo --fresh
gyre down
gyre down out/radar
gyre ps
gyre ps out/radar --check
gyre top
gyre top out/radar --once
gyre watch
gyre watch out/radar --listen 0.0.0.0:8080
gyre logs -f
gyre logs masking out/radar
gyre echo
gyre echo out/radar motion
gyre record --to drive.mcap
gyre record out/radar --to drive.mcap
gyre restart masking
gyre restart masking out/radar
gyre swap masking --command ./my-masking
gyre swap masking out/radar
gyre reset
gyre reset out/radar --pose 12,-3,90 --keep-map
gyre new-map
gyre new-map out/radar
gyre locate out/radar --pose 12,-3,90
gyre shadow masking --command ./my-masking --scans 200
gyre shadow refinement out/radar

Take it elsewhere:
gyre ros2
gyre ros2 out/radar --domain 7
gyre link send out/radar --listen tcp/127.0.0.1:7447
gyre link receive out/seen --connect tcp/127.0.0.1:7447
gyre radar-server demo
gyre radar-server DRIVE --rate 2

Replace a stage, measure, set up:
gyre new stage masking --python
gyre new stage rotation-search --rust --gyre ../gyre
gyre conformance masking --python my_mask.py
gyre conformance refinement radiate DRIVE
gyre stress demo --quick
gyre stress radiate DRIVE --scenario kills
gyre stage refinement
gyre stage masking --python my_mask.py
gyre schema > gyre.json
gyre schema --markdown
gyre completions bash > ~/.local/share/bash-completion/completions/gyre
gyre completions fish > ~/.config/fish/completions/gyre.fish
gyre man man1
gyre man ~/.local/share/man/man1";

/// Returns the titles of the groups, each with the lines of its examples.
fn groups() -> impl Iterator<Item = (&'static str, &'static str)> {
    let groups = GROUPS.split("\n\n");
    groups.filter_map(|group| group.split_once('\n'))
}

/// Returns the commands of a group, each with its examples.
fn commands(group: &'static str) -> Vec<(&'static str, Vec<&'static str>)> {
    let name = |example: &'static str| example.split(' ').nth(1).unwrap_or_default();
    let examples: Vec<&str> = group.lines().collect();
    let of_commands = examples.chunk_by(|&one, &next| name(one) == name(next));
    of_commands
        .map(|examples| (name(examples[0]), examples.to_vec()))
        .collect()
}

const EXIT_CODES: &str = "Exit codes: 0 done, 1 failed, 2 wrong arguments, 130 interrupted.";

const NAMES: usize = 16;

/// Returns the command line of `gyre`, with groups and examples in its help.
pub fn command() -> Command {
    // A negative number is a value: the parser of the option before it reports its own error.
    let of_option = |arg: Arg| {
        let has_value = arg.get_action().takes_values() && !arg.is_positional();
        arg.allow_negative_numbers(has_value)
    };
    let mut command = Gyre::command().mut_subcommands(|it| it.mut_args(of_option));
    for (name, examples) in groups().flat_map(|(_, group)| commands(group)) {
        let examples = format!("Examples:\n  {}", examples.join("\n  "));
        command = command.mut_subcommand(name, |it| it.after_help(examples));
    }
    let list = list(&command);
    command
        .help_template(
            "{about-with-newline}\n{usage-heading} {usage}{after-help}\n\nOptions:\n{options}",
        )
        .after_help(list)
}

/// Returns the groups, each command with the first sentence about it.
fn list(command: &Command) -> String {
    let about = |name: &str| {
        let found = command.find_subcommand(name).and_then(Command::get_about);
        let about = found.map(ToString::to_string).unwrap_or_default();
        about.split(". ").next().unwrap_or_default().to_owned()
    };
    let mut text = String::new();
    let indent = format!("\n  {:NAMES$}", "");
    for (title, group) in groups() {
        text += &format!("\n{title}\n");
        for (name, _) in commands(group) {
            let about = wrap(&about(name), WIDTH - NAMES - 2).join(&indent);
            text += &format!("  {name:NAMES$}{about}\n");
        }
    }
    text + "\n`gyre help COMMAND` has the options of a command, and examples.\n" + EXIT_CODES
}

#[cfg(test)]
mod tests {
    use super::*;

    fn all() -> Vec<(&'static str, Vec<&'static str>)> {
        groups().flat_map(|(_, group)| commands(group)).collect()
    }

    #[test]
    fn each_command_is_in_one_group() {
        let command = Gyre::command();
        let visible = command.get_subcommands().filter(|it| !it.is_hide_set());
        let mut visible: Vec<&str> = visible.map(Command::get_name).collect();
        let mut grouped: Vec<&str> = all().into_iter().map(|(name, _)| name).collect();
        visible.sort_unstable();
        grouped.sort_unstable();
        assert_eq!(grouped, visible);
    }

    #[test]
    fn each_example_is_a_command_line_of_its_command() {
        for (name, examples) in all() {
            for example in examples {
                let (line, _) = example.split_once(" > ").unwrap_or((example, ""));
                let words = line.split(' ');
                let parsed = command().try_get_matches_from(words);
                let parsed = parsed.unwrap_or_else(|error| panic!("{example}: {error}"));
                assert_eq!(parsed.subcommand_name(), Some(name), "{example}");
            }
        }
    }

    #[test]
    fn a_number_below_zero_is_the_value_of_its_option() {
        let parsed = command().try_get_matches_from(["gyre", "run", "--rate", "-4"]);
        let refused = parsed.unwrap_err().to_string();
        assert!(refused.contains("invalid value '-4'"), "{refused}");
    }

    #[test]
    fn the_help_fits_a_terminal() {
        let mut command = command().term_width(WIDTH);
        let help = command.render_help().to_string();
        for line in help.lines() {
            assert!(line.chars().count() <= WIDTH, "{line}");
        }
        assert!(help.contains("\nStart:\n  demo"), "{help}");
    }
}
