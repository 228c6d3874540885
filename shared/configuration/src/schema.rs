//! The schema of configurations for editors, and the reference in Markdown that is made from it.
//!
//! Keys, types, defaults and descriptions come from the configuration structures and their doc
//! comments.

mod markdown;
mod transform;

use schemars::{Schema, generate::SchemaSettings};

use crate::configuration::Configuration;

pub fn reference() -> String {
    markdown::reference(&generate())
}

pub fn json() -> String {
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
        assert!(
            kept.trim_end() == reference(),
            "docs/configuration.md: {RENEW}"
        );
    }

    #[test]
    fn every_key_is_described() {
        let reference = reference();
        let bare: Vec<_> = reference
            .lines()
            .filter(|line| line.ends_with("|  |"))
            .collect();
        assert!(bare.is_empty(), "{bare:#?}");
    }
}
