//! Maps in the forms of other programs.

mod geotiff;
mod pgm;
mod web;

pub use geotiff::write_geotiff;
pub use pgm::write_pgm;
pub use web::write_web_tiles;
