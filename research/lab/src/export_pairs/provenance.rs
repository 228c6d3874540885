//! `pairs.toml`: the provenance of `pairs.npy`.

use std::{fs, path::Path};

use gyre_configuration::{Configuration, terminal::Failure};
use serde_json::json;
use toml::Table;

use crate::{recording::{Recording, Track, folder_name}, report::{Record, record}};

/// The file's first line; a file with another is somebody else's.
const FIRST_LINE: &str = "# What the .npy file of this name was made of, by gyre export-pairs.\n";

/// The sections of the configuration that the records depend on.
const SECTIONS: [&str; 6] = [
    "raster",
    "masking",
    "rotation",
    "translation",
    "dataset",
    "simulation",
];

/// Scans that follow each other, none left out: those with one number in `sequence`. What is said
/// of them, and how many they are.
pub type Sequence = (Record, usize);

/// Refuses a name that is no `.npy` file's, or beside which another file is in the way: a
/// configuration, say.
pub fn check_place(pairs: &Path) -> Result<(), Failure> {
    let (named, beside) = (pairs.display(), pairs.with_extension("toml"));
    if pairs.extension().is_none_or(|extension| extension != "npy") {
        return Err(format!("--out {named}: the file's name must end in .npy").into());
    }
    match fs::read(&beside) {
        Ok(text) if !text.starts_with(FIRST_LINE.as_bytes()) => Err(format!(
            "{} would be overwritten to say what {named} is made of, but is no export's: choose another --out",
            beside.display()
        )
        .into()),
        _ => Ok(()),
    }
}

/// Begins a sequence with a recording's scan `first_scan`, without scans.
pub fn sequence(
    number: usize,
    recording: &Recording,
    truth: &Track,
    first_scan: usize,
) -> Sequence {
    let of = json!({
        "sequence": number,
        "name": folder_name(Path::new(&recording.data)),
        "source": recording.data,
        "format": recording.dataset.format(),
        "ground_truth": truth.path,
        "first_scan": first_scan,
    });
    (record(of), 0)
}

/// Returns the text of the file: all that the records depend on.
///
/// # Errors
/// A value that TOML cannot hold.
pub fn to_toml(configuration: &Configuration, sequences: Vec<Sequence>) -> Result<String, Failure> {
    // Through text: a table made directly has other digits in its f32 values.
    let mut table: Table = configuration.to_toml()?.parse()?;
    table.retain(|section, _| SECTIONS.contains(&section));
    let scans: usize = sequences.iter().map(|(_, scans)| scans).sum();
    let counted = |(mut of, scans): Sequence| {
        of.insert("scans".to_owned(), json!(scans));
        of
    };
    table.extend(Table::try_from(json!({
        "version": env!("CARGO_PKG_VERSION"),
        "scans": scans,
        "n": configuration.odometry.raster.n,
        "sequences": sequences.into_iter().map(counted).collect::<Vec<_>>(),
    }))?);
    table.extend(option_env!("GYRE_COMMIT").map(|commit| ("commit".to_owned(), commit.into())));
    Ok(format!("{FIRST_LINE}{}", toml::to_string_pretty(&table)?))
}
