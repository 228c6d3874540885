//! The help: commands in groups, each with examples.

use clap::{Arg, Command, CommandFactory};
use gyre_terminal::{WIDTH, wrap};

use super::Gyre;

/// The examples of a command.
type Examples = [&'static str; 2];

/// The groups of commands, in the order of the help.
const GROUPS: [(&str, &[(&str, Examples)]); 6] = [
    ("Start", &START),
    ("See the results", &RESULTS),
    ("Many drives, another radar", &RADARS),
    ("Operate a running run", &OPERATE),
    ("Take it elsewhere", &ELSEWHERE),
    ("Replace a stage, measure, set up", &DEVELOP),
];

const START: [(&str, Examples); 5] = [
    (
        "demo",
        [
            "gyre demo",
            "gyre demo --set masking.kind=threshold --fresh",
        ],
    ),
    (
        "run",
        ["gyre run DRIVE", "gyre run oxford DRIVE --out out/oxford"],
    ),
    (
        "inspect",
        ["gyre inspect DRIVE", "gyre inspect drive.mcap --json"],
    ),
    ("config", ["gyre config", "gyre config oxford > robot.toml"]),
    ("doctor", ["gyre doctor", "gyre doctor --out /data/out"]),
];

const RESULTS: [(&str, Examples); 5] = [
    (
        "report",
        [
            "gyre report out/demo --open",
            "gyre report out/a out/b other.tum",
        ],
    ),
    (
        "evaluate",
        [
            "gyre evaluate out/demo",
            "gyre evaluate other.tum truth.tum --plots plots",
        ],
    ),
    (
        "map",
        [
            "gyre map out/demo --out town",
            "gyre map out/demo --out town --format geotiff --origin 51.76,-1.26,90",
        ],
    ),
    (
        "localise",
        [
            "gyre localise DRIVE --map town",
            "gyre localise oxford DRIVE --map town --out out/localised",
        ],
    ),
    (
        "export",
        [
            "gyre export out/demo --mcap demo-bag",
            "gyre export out/drive --format radiate --out repaired",
        ],
    ),
];

const RADARS: [(&str, Examples); 4] = [
    (
        "batch",
        [
            "gyre batch DRIVES --config oxford",
            "gyre batch drives.csv --out out/batch --jobs 4",
        ],
    ),
    (
        "calibrate",
        [
            "gyre calibrate robot.toml DRIVE --distance-m 1520",
            "gyre calibrate DRIVE --with ANOTHER-DRIVE",
        ],
    ),
    (
        "masks",
        ["gyre masks DRIVE", "gyre masks demo --scans 10,20"],
    ),
    (
        "simulate",
        [
            "gyre simulate demo --out recording",
            "gyre simulate --trajectory drive.tum --format boreas --out recording",
        ],
    ),
];

const OPERATE: [(&str, Examples); 11] = [
    (
        "up",
        ["gyre up 192.168.0.1 robot.toml", "gyre up demo --fresh"],
    ),
    ("down", ["gyre down", "gyre down out/radar"]),
    ("ps", ["gyre ps", "gyre ps out/radar --check"]),
    ("top", ["gyre top", "gyre top out/radar --once"]),
    (
        "watch",
        ["gyre watch", "gyre watch out/radar --listen 0.0.0.0:8080"],
    ),
    ("logs", ["gyre logs -f", "gyre logs masking out/radar"]),
    ("echo", ["gyre echo", "gyre echo out/radar motion"]),
    (
        "record",
        [
            "gyre record --to drive.mcap",
            "gyre record out/radar --to drive.mcap",
        ],
    ),
    (
        "restart",
        ["gyre restart masking", "gyre restart masking out/radar"],
    ),
    (
        "swap",
        [
            "gyre swap masking --command ./my-masking",
            "gyre swap masking out/radar",
        ],
    ),
    (
        "shadow",
        [
            "gyre shadow masking --command ./my-masking --scans 200",
            "gyre shadow refinement out/radar",
        ],
    ),
];

const ELSEWHERE: [(&str, Examples); 3] = [
    ("ros2", ["gyre ros2", "gyre ros2 out/radar --domain 7"]),
    (
        "link",
        [
            "gyre link send out/radar --listen tcp/127.0.0.1:7447",
            "gyre link receive out/seen --connect tcp/127.0.0.1:7447",
        ],
    ),
    (
        "radar-server",
        ["gyre radar-server demo", "gyre radar-server DRIVE --rate 2"],
    ),
];

const DEVELOP: [(&str, Examples); 7] = [
    (
        "new",
        [
            "gyre new stage masking --python",
            "gyre new stage rotation-search --rust --gyre ../gyre",
        ],
    ),
    (
        "conformance",
        [
            "gyre conformance masking --python my_mask.py",
            "gyre conformance refinement radiate DRIVE",
        ],
    ),
    (
        "stress",
        [
            "gyre stress demo --quick",
            "gyre stress radiate DRIVE --scenario kills",
        ],
    ),
    (
        "stage",
        [
            "gyre stage refinement",
            "gyre stage masking --python my_mask.py",
        ],
    ),
    (
        "schema",
        ["gyre schema > gyre.json", "gyre schema --markdown"],
    ),
    (
        "completions",
        [
            "gyre completions bash > ~/.local/share/bash-completion/completions/gyre",
            "gyre completions fish > ~/.config/fish/completions/gyre.fish",
        ],
    ),
    ("man", ["gyre man man1", "gyre man ~/.local/share/man/man1"]),
];

/// The exit codes of all commands.
const EXIT_CODES: &str = "Exit codes: 0 done, 1 failed, 2 wrong arguments, 130 interrupted.";

/// Columns of the names of commands.
const NAMES: usize = 16;

/// Returns the command line of `gyre`, with groups and examples in its help.
pub fn command() -> Command {
    // A negative number is a value: the parser of the option before it reports its own error.
    let of_option = |arg: Arg| {
        let has_value = arg.get_action().takes_values() && !arg.is_positional();
        arg.allow_negative_numbers(has_value)
    };
    let mut command = Gyre::command().mut_subcommands(|it| it.mut_args(of_option));
    for (name, examples) in GROUPS.iter().flat_map(|(_, commands)| *commands) {
        let [first, second] = examples;
        let examples = format!("Examples:\n  {first}\n  {second}");
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
    for (group, commands) in GROUPS {
        text += &format!("\n{group}:\n");
        for (name, _) in commands {
            let indent = format!("\n  {:NAMES$}", "");
            let about = wrap(&about(name), WIDTH - NAMES - 2).join(&indent);
            text += &format!("  {name:NAMES$}{about}\n");
        }
    }
    text + "\n`gyre help COMMAND` has the options of a command, and examples.\n" + EXIT_CODES
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    fn all() -> impl Iterator<Item = &'static (&'static str, Examples)> {
        GROUPS.iter().flat_map(|(_, commands)| *commands)
    }

    #[test]
    fn each_command_is_in_one_group() {
        let command = Gyre::command();
        let visible = command.get_subcommands().filter(|it| !it.is_hide_set());
        let mut visible: Vec<&str> = visible.map(Command::get_name).collect();
        let mut grouped: Vec<&str> = all().map(|(name, _)| *name).collect();
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
                assert_eq!(parsed.subcommand_name(), Some(*name), "{example}");
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
