//! Maps of scenes whose look is known.
#![allow(clippy::unwrap_used)]

mod changes;
mod evidence;
mod files;
mod pictures;
mod scenes;
