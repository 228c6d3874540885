//! Errors of configurations.

use std::path::PathBuf;

use thiserror::Error;

/// Why a configuration is rejected.
#[derive(Debug, Error)]
pub enum ConfigurationError {
    #[error("cannot read the configuration {path}: {source}")]
    Unreadable {
        path: PathBuf,
        /// The error of the operating system.
        source: std::io::Error,
    },
    /// A name that neither a file nor a configuration of the program has.
    #[error(
        "`{name}` is neither a file nor a configuration of the program, which `gyre config` lists{suggestion}"
    )]
    Unknown { name: String, suggestion: String },
    #[error("the configuration {path} is a folder: {remedy}")]
    Folder {
        path: PathBuf,
        /// The advice, with the path to name instead.
        remedy: String,
    },
    #[error(
        "{0:?} has a name that is not UTF-8, which a configuration cannot hold: rename it, or name a link to it"
    )]
    Name(PathBuf),
    #[error("{path}: {reason}")]
    Syntax {
        path: PathBuf,
        /// The place and the reason.
        reason: String,
    },
    #[error("[{section}] has no key `{key}`{suggestion}")]
    UnknownKey {
        section: String,
        key: String,
        suggestion: String,
    },
    #[error("[{section}]: {reason}")]
    Value { section: String, reason: String },
    #[error("--set {0}: expected section.key=value, as in masking.kind=none")]
    Override(String),
}
