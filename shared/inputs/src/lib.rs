//! The things that commands work on: a recording, a configuration, a radar. All commands are given
//! them in one way, and each is recognised by what it is.
//!
//! - [`Inputs`]: the arguments;
//! - [`Given`]: what they name;
//! - [`Kind`]: what one of them is;
//! - [`config`](config()): the configurations in the program.

mod config;
mod given;
mod kind;

pub use config::{ConfigArguments, config};
pub use given::{Given, InputError, Inputs, configuration};
pub use kind::Kind;
