mod geotiff;
mod grid;
mod pgm;
mod web;

pub use geotiff::write_geotiff;
pub use grid::{Grid, grid};
pub use pgm::write_pgm;
pub use web::write_web_tiles;
