//! The things that commands work on: a recording, a configuration, a radar. All commands receive
//! them in one form, and recognise each by its content.
//!
//! - [`Inputs`]: the arguments;
//! - [`Given`]: the things that they name;
//! - [`Kind`]: what one of them is;
//! - [`config`](config()): the configurations in the program.

mod config;
mod given;
mod kind;

pub use config::{ConfigArguments, config};
pub use given::{Given, Inputs, configuration};
pub use kind::Kind;
