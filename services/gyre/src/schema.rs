//! `gyre schema`: the schema of configurations for editors, and the reference in Markdown that is
//! made from it.
//!
//! Keys, types, defaults and descriptions come from the configuration structures and their doc
//! comments.

mod markdown;
mod transform;

use std::process::ExitCode;

use schemars::{Schema, generate::SchemaSettings};

use crate::{Failure, cli::SchemaArguments, configuration::Configuration, print};

/// Prints the schema, or the reference.
///
/// # Errors
/// Standard output cannot be written.
pub fn schema(arguments: &SchemaArguments) -> Result<ExitCode, Failure> {
    print::line(match arguments.markdown {
        true => markdown::reference(&generate()),
        false => json(),
    })?;
    Ok(ExitCode::SUCCESS)
}

fn json() -> String {
    format!("{:#}", generate().as_value())
}

/// The schema, with each section where it belongs: editors and the reference need not follow
/// references.
fn generate() -> Schema {
    let settings = SchemaSettings::draft07().with(|settings| settings.inline_subschemas = true);
    let mut schema = settings
        .with_transform(transform::ForToml)
        .into_generator()
        .into_root_schema_for::<Configuration>();
    schema.insert("title".to_owned(), "Gyre configuration".into());
    schema
}

#[cfg(test)]
mod tests {
    use super::*;

    const RENEW: &str = "renew it with `gyre schema`, as CONTRIBUTING.md says";

    #[test]
    fn the_schema_for_editors_is_current() {
        let kept = include_str!("../../../docs/gyre.schema.json");
        assert!(kept.trim_end() == json(), "docs/gyre.schema.json: {RENEW}");
    }

    #[test]
    fn the_configuration_reference_is_current() {
        let kept = include_str!("../../../docs/configuration.md");
        let current = markdown::reference(&generate());
        assert!(kept.trim_end() == current, "docs/configuration.md: {RENEW}");
    }

    #[test]
    fn every_key_is_described() {
        let reference = markdown::reference(&generate());
        let bare: Vec<_> = reference
            .lines()
            .filter(|line| line.ends_with("|  |"))
            .collect();
        assert!(bare.is_empty(), "{bare:#?}");
    }
}
