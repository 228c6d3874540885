use std::{io::Cursor, path::Path};

use tiff::{
    TiffError,
    encoder::{Compression, DeflateLevel, TiffEncoder, colortype::Gray8},
    tags::{ExtraSamples, Tag},
};

use crate::mapping::{
    MapError, Origin, TILE_CELLS, TileSource, georeference::Georeference, strips,
};

const MODEL_TYPE: u16 = 1024;
const PROJECTED: u16 = 1;
const USER_DEFINED: u16 = 32_767;
const RASTER_TYPE: u16 = 1025;
const PIXEL_IS_AREA: u16 = 1;
const CITATION: u16 = 1026;
const PROJECTED_CRS: u16 = 3072;
const LINEAR_UNITS: u16 = 3076;
const METRE: u16 = 9001;
const LOCAL: &str = "Gyre map frame|";
const GDAL_METADATA: Tag = Tag::Unknown(42_112);
const BANDS: &str = "<GDALMetadata>\
    <Item name=\"DESCRIPTION\" sample=\"0\" role=\"description\">evidence</Item>\
    <Item name=\"DESCRIPTION\" sample=\"1\" role=\"description\">looked</Item>\
    </GDALMetadata>";

/// Writes the map as one GeoTIFF of two bands: evidence, and how often a cell was looked at as
/// opacity (see [`Cell`](crate::mapping::Cell)). With an origin it is in the UTM zone of that,
/// turned by the heading; without, in metres of the map frame.
pub fn write_geotiff(
    path: &Path,
    source: &mut impl TileSource,
    origin: Option<Origin>,
) -> Result<(), MapError> {
    let georeference = Georeference::new(origin)?;
    let extent = strips::extent(source, "GeoTIFF")?;
    let [columns, rows] = extent.cells();
    let top_left = extent.corner_m(source.cell_m())
        + nalgebra::Vector2::new(0.0, rows as f64 * source.cell_m());
    let transformation = transformation(&georeference, &top_left, source.cell_m());
    // The encoder compresses data that it gets as a whole, and not data that it gets strip by
    // strip.
    let mut pixels = Vec::with_capacity(2 * columns * rows);
    strips::for_each(source, &extent, |cells| {
        pixels.extend_from_slice(bytemuck::cast_slice(cells));
        Ok(())
    })?;
    let mut bytes = Cursor::new(Vec::new());
    let mut encode = || -> Result<(), TiffError> {
        let mut encoder = TiffEncoder::new(&mut bytes)?
            .with_compression(Compression::Deflate(DeflateLevel::Balanced));
        let mut image = encoder.new_image::<Gray8>(columns as u32, rows as u32)?;
        image.extra_samples(&[ExtraSamples::UnassociatedAlpha])?;
        image.rows_per_strip(TILE_CELLS as u32)?;
        let tags = image.encoder();
        tags.write_tag(Tag::ModelTransformationTag, &transformation[..])?;
        tags.write_tag(Tag::GeoKeyDirectoryTag, &keys(&georeference)[..])?;
        tags.write_tag(GDAL_METADATA, BANDS)?;
        if georeference.epsg.is_none() {
            tags.write_tag(Tag::GeoAsciiParamsTag, LOCAL)?;
        }
        image.write_data(&pixels)
    };
    encode().map_err(|error| MapError::Encode(error.to_string()))?;
    Ok(gyre_storage::write(path, bytes.into_inner())?)
}

/// The matrix from columns and rows of the picture to coordinates.
fn transformation(
    georeference: &Georeference,
    top_left: &nalgebra::Vector2<f64>,
    cell_m: f64,
) -> [f64; 16] {
    let corner = georeference.offset + georeference.matrix * top_left;
    let right = georeference.matrix.column(0) * cell_m;
    let down = -georeference.matrix.column(1) * cell_m;
    [
        right.x, down.x, 0.0, corner.x, //
        right.y, down.y, 0.0, corner.y, //
        0.0, 0.0, 0.0, 0.0, //
        0.0, 0.0, 0.0, 1.0,
    ]
}

/// The directory of keys: version, revision, their number; then each with the place, the count and
/// the value.
fn keys(georeference: &Georeference) -> Vec<u16> {
    let mut keys = vec![1, 1, 1, 4];
    let system = match georeference.epsg {
        Some(epsg) => [
            [MODEL_TYPE, 0, 1, PROJECTED],
            [RASTER_TYPE, 0, 1, PIXEL_IS_AREA],
            [PROJECTED_CRS, 0, 1, epsg],
            [LINEAR_UNITS, 0, 1, METRE],
        ],
        None => [
            [MODEL_TYPE, 0, 1, USER_DEFINED],
            [RASTER_TYPE, 0, 1, PIXEL_IS_AREA],
            [
                CITATION,
                Tag::GeoAsciiParamsTag.to_u16(),
                LOCAL.len() as u16,
                0,
            ],
            [LINEAR_UNITS, 0, 1, METRE],
        ],
    };
    keys.extend(system.as_flattened());
    keys
}
