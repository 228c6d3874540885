mod compensation;
mod placement;
mod reading;
mod robustness;
pub(crate) mod scene;
