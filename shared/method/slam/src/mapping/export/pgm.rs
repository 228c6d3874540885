//! PGM and YAML as ROS `map_server` reads them.

use std::path::Path;

use gyre_storage::Draft;

use crate::mapping::{MapError, TileSource, strips};

/// The values of `map_server`'s form: with the thresholds below a cell is occupied, free or
/// unknown.
const OCCUPIED: u8 = 0;
const FREE: u8 = 254;
const UNKNOWN: u8 = 205;

pub fn write_pgm(folder: &Path, source: &mut impl TileSource) -> Result<(), MapError> {
    let extent = strips::extent(source, "PGM")?;
    let [columns, rows] = extent.cells();
    let (cell_m, corner) = (source.cell_m(), extent.corner_m(source.cell_m()));
    let mut picture = Draft::create(&folder.join("map.pgm"))?;
    picture.append(format!("P5\n{columns} {rows}\n255\n"))?;
    strips::for_each(source, &extent, |cells| {
        let pixels = cells
            .iter()
            .map(|it| it.occupancy([UNKNOWN, FREE, OCCUPIED]));
        Ok(picture.append(pixels.collect::<Vec<u8>>())?)
    })?;
    let mut yaml = Draft::create(&folder.join("map.yaml"))?;
    // The origin is the lower left corner of the picture. 205 is 0.196 of the way to occupied, and
    // not below the free threshold.
    yaml.append(format!(
        "image: map.pgm\nmode: trinary\nresolution: {cell_m}\norigin: [{:.3}, {:.3}, 0.0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n",
        corner.x, corner.y
    ))?;
    picture.commit()?;
    yaml.commit()?;
    Ok(gyre_storage::sync_folder(folder)?)
}
