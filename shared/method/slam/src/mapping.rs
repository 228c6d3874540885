//! Maps of keyframes: how often each place returned power of how often it was looked at.
//!
//! 1. The points of a keyframe are deskewed and freed of the Doppler shift by its velocity.
//! 2. A sector of one degree was looked at as far as the farthest return within the beam: a radar
//!    sees past and over things. A look weighs half at 30 m, and less beyond.
//! 3. A return is spread along its arc as its bearing is uncertain, and adds its weight there.
//! 4. The evidence of a cell is its returns divided by its looks, with one extra look that returned
//!    nothing. So what moves fades, and a street is no brighter for being driven often.
//!
//! Sums are integers, so that the map is the same whatever the order. The map frame is the frame of
//! the poses. Rows of pictures run from the highest y to the lowest.

mod drawing;
mod evidence;
mod export;
mod georeference;
mod map;
mod options;
mod picture;
mod pixels;
mod source;
mod store;
mod strips;
mod tile;
mod view;

pub use drawing::Drawing;
pub use evidence::Evidence;
pub use export::{Grid, grid, write_geotiff, write_pgm, write_web_tiles};
pub use georeference::{Origin, OriginError};
pub use map::{Map, require_tiles_only, write_map};
pub use options::{MapOptions, OptionError};
pub use picture::{Overlay, legible, map_png};
pub use pixels::encode as encode_png;
pub use source::{MapError, TileSource};
pub use tile::{Cell, TILE_CELLS, TileExtent, TileImage, TileIndex};
pub use view::View;
