//! `gyre masks`: draws the mask's effect on scans.

mod drawing;
mod inspector;

use std::{num::NonZeroUsize, ops::Range, path::PathBuf};

use clap::Args;
use drawing::Canvas;
use gyre_configuration::{
    describe_masks_in_process,
    terminal::{Failure, inputs::Inputs, print},
};
use gyre_results::Content;
use inspector::{HEADER, MaskInspector};

/// Number of scans that are drawn by default, and maximum on the overview.
const FEW: usize = 8;
const OVERVIEW: &str = "masks.png";

#[derive(Debug, Args)]
pub struct MasksArguments {
    /// The scans, and the configuration: its raster, masking and search.
    #[command(flatten)]
    pub inputs: Inputs,
    /// The folder of masks.png and of a scan-NUMBER.png for each scan.
    #[arg(long, default_value = "out/masks")]
    pub out: PathBuf,
    /// Numbers of the scans to draw. Default: eight, evenly spread.
    #[arg(long, value_delimiter = ',')]
    pub scans: Vec<usize>,
    /// Draw every Nth scan.
    #[arg(long, conflicts_with = "scans")]
    pub every: Option<NonZeroUsize>,
    /// Print JSON instead of a table.
    #[arg(long)]
    pub json: bool,
}

pub fn masks(arguments: &MasksArguments) -> Result<(), Failure> {
    let configuration = arguments.inputs.configuration()?;
    let played = gyre_configuration::open(&configuration)?;
    let chosen = choose(
        arguments,
        configuration.source.played(played.dataset.scans()),
        &configuration.data(),
    )?;
    let mut inspector = MaskInspector::new(&configuration, played)?;
    describe_masks_in_process(&configuration)?
        .iter()
        .for_each(print::note);
    let out = &arguments.out;
    Content::MASKS.require_place(out)?;
    gyre_storage::create_folder(out)?;
    if !arguments.json {
        print::line(HEADER)?;
    }
    let (mut overview, apart) = (Vec::new(), chosen.len().div_ceil(FEW));
    let mut figures = Vec::new();
    for (index, number) in chosen.into_iter().enumerate() {
        let Some(inspection) = inspector.inspect(number)? else {
            continue;
        };
        figures.push(inspection.figures());
        if let Some(figures) = figures.last().filter(|_| !arguments.json) {
            print::line(figures)?;
        }
        let picture = Canvas::of(&inspection);
        picture.write(&out.join(format!("scan-{number:06}.png")))?;
        if index % apart == 0 {
            overview.push(picture);
        }
    }
    if overview.is_empty() {
        let data = configuration.data();
        return Err(format!("{data}: none of the chosen scans can be read").into());
    }
    Canvas::stack(&overview).write(&out.join(OVERVIEW))?;
    if arguments.json {
        print::line(serde_json::to_string_pretty(&figures)?)?;
    }
    Ok(())
}

fn choose(
    arguments: &MasksArguments,
    played: Range<usize>,
    data: &str,
) -> Result<Vec<usize>, Failure> {
    if played.is_empty() {
        return Err(format!("{data} has no scans to draw").into());
    }
    let mut numbers = arguments.scans.iter();
    if let Some(number) = numbers.find(|number| !played.contains(number)) {
        let (first, last) = (played.start, played.end - 1);
        return Err(format!(
            "--scans {number}: the scans of {data} that are played have the numbers {first} to {last}"
        )
        .into());
    }
    let mut chosen = arguments.scans.clone();
    if chosen.is_empty() {
        let every = arguments.every.map(usize::from);
        let every = every.unwrap_or(played.len().div_ceil(FEW));
        chosen = played.step_by(every).collect();
    }
    chosen.sort_unstable();
    chosen.dedup();
    Ok(chosen)
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;

    #[derive(Parser)]
    struct Masks {
        #[command(flatten)]
        arguments: MasksArguments,
    }

    fn chosen(options: &str, played: Range<usize>) -> Result<Vec<usize>, Failure> {
        let words = ["masks", "c.toml"].into_iter();
        let words = words.chain(options.split_whitespace());
        choose(&Masks::try_parse_from(words)?.arguments, played, "drive")
    }

    #[test]
    fn scans_are_chosen_among_those_that_are_played() {
        assert_eq!(chosen("--scans 7,3,7", 0..10).unwrap(), [3, 7]);
        assert_eq!(chosen("--every 4", 2..12).unwrap(), [2, 6, 10]);
        assert_eq!(chosen("", 0..3).unwrap(), [0, 1, 2]);
        let eight = [10, 12, 14, 16, 18, 20, 22, 24];
        assert_eq!(chosen("", 10..26).unwrap(), eight);
        let refused = |options, played| chosen(options, played).unwrap_err().to_string();
        let sentence = "--scans 20: the scans of drive that are played have the numbers 10 to 19";
        assert_eq!(refused("--scans 10,20", 10..20), sentence);
        assert_eq!(refused("", 5..5), "drive has no scans to draw");
        assert!(chosen("--every 0", 0..9).is_err() && chosen("--every 2 --scans 1", 0..9).is_err());
    }
}
