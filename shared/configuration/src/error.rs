//! Errors of configurations.

use std::path::PathBuf;

use thiserror::Error;

/// Why a configuration is rejected.
#[derive(Debug, Error)]
pub enum ConfigurationError {
    /// The file cannot be read.
    #[error("cannot read the configuration {path}: {source}")]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// The error of the operating system.
        source: std::io::Error,
    },
    /// A name that neither a file nor a configuration of the program has.
    #[error(
        "`{name}` is neither a file nor a configuration of the program, which `gyre config` lists{suggestion}"
    )]
    Unknown {
        /// The name.
        name: String,
        /// The nearest known one.
        suggestion: String,
    },
    /// It is a folder.
    #[error("the configuration {path} is a folder: {remedy}")]
    Folder {
        /// The folder.
        path: PathBuf,
        /// The advice, with the path to name instead.
        remedy: String,
    },
    /// A path that a configuration cannot hold.
    #[error(
        "{0:?} has a name that is not UTF-8, which a configuration cannot hold: rename it, or name a link to it"
    )]
    Name(PathBuf),
    /// The file is not TOML.
    #[error("{path}: {reason}")]
    Syntax {
        /// The file.
        path: PathBuf,
        /// The place and the reason.
        reason: String,
    },
    /// An unknown key.
    #[error("[{section}] has no key `{key}`{suggestion}")]
    UnknownKey {
        /// The section.
        section: String,
        /// The key.
        key: String,
        /// The nearest known one.
        suggestion: String,
    },
    /// A value that a key cannot have.
    #[error("[{section}]: {reason}")]
    Value {
        /// The section.
        section: String,
        /// The reason.
        reason: String,
    },
    /// `--set` without a key and a value.
    #[error("--set {0}: expected section.key=value, as in masking.kind=none")]
    Override(String),
}
