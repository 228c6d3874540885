//! Maps of scenes whose look is known.

mod evidence;
mod files;
mod pictures;
mod scenes;
