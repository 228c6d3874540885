//! The things that commands work on: a recording, a configuration, a radar. All commands receive
//! them in one form, [`Inputs`], and recognise each by its content.

mod config;
mod given;
mod kind;

pub use config::{ConfigArguments, config};
pub use given::{Given, Inputs, configuration};
pub use kind::Kind;
