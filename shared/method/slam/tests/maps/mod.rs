//! Maps of scenes whose look is known.
#![allow(clippy::unwrap_used)]

mod evidence;
mod files;
mod pictures;
mod scenes;
