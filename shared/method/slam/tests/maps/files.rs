//! Maps as files, read back.

use std::{collections::HashMap, fs, io::Cursor, path::Path};

use gyre_slam::mapping::*;
use tiff::{
    decoder::{Decoder, DecodingResult},
    tags::Tag,
};

use crate::{common::assert_refused, maps::scenes::*};

const ORIGIN: Origin = Origin {
    latitude_deg: 51.75,
    longitude_deg: -1.25,
    heading_deg: 90.0,
};

fn written(folder: &Path) -> Map {
    write_map(
        folder,
        &mut drawn(&drive(20, &wall())),
        Some(ORIGIN),
        "a test",
    )
    .unwrap();
    Map::open(folder).unwrap()
}

#[test]
fn a_folder_is_read_back_as_it_was_written() {
    let folder = tempfile::tempdir().unwrap();
    let mut map = written(folder.path());
    let mut evidence = drawn(&drive(20, &wall()));
    assert_eq!((map.keyframes(), map.origin()), (20, Some(ORIGIN)));
    assert_eq!(map.options(), evidence.options());
    assert_eq!(map.tiles(), evidence.tiles());
    for (tile, expected) in images(&mut evidence) {
        let mut image = TileImage::default();
        map.read(tile, &mut image).unwrap();
        assert!(image == expected, "{tile}");
    }
    let mut blank = TileImage::default();
    map.read(TileIndex { x: 99, y: 99 }, &mut blank).unwrap();
    assert!(blank == TileImage::default());
}

#[test]
fn a_new_map_replaces_the_old_one_and_nothing_else() {
    let folder = tempfile::tempdir().unwrap();
    written(folder.path());
    fs::write(folder.path().join("notes.txt"), "mine").unwrap();
    let far = gyre_geometry::pose(1000.0, 0.0, 0.0);
    let mut evidence = drawn(&[(far, keyframe(0, &far, &wall()))]);
    write_map(folder.path(), &mut evidence, None, "a test").unwrap();
    let map = Map::open(folder.path()).unwrap();
    assert_eq!(map.tiles(), evidence.tiles());
    let tiles = fs::read_dir(folder.path().join("tiles")).unwrap();
    assert_eq!(tiles.count(), map.tiles().len());
    assert!(folder.path().join("notes.txt").exists());
    fs::write(folder.path().join("tiles/holiday.jpg"), "mine").unwrap();
    let refused = write_map(folder.path(), &mut evidence, None, "a test");
    assert_refused(refused, "holiday.jpg is no tile");
    assert_eq!(Map::open(folder.path()).unwrap().tiles(), map.tiles());
}

#[test]
fn what_is_wrong_with_a_folder_is_said() {
    let folder = tempfile::tempdir().unwrap();
    assert_refused(Map::open(folder.path()), "is not a map: it has no map.toml");
    written(folder.path());
    let path = folder.path().join("map.toml");
    let text = fs::read_to_string(&path).unwrap();
    for (from, to, expected) in [
        (
            "version = 1",
            "version = 2",
            "its version is 2, and this program reads version 1: use the gyre that drew it, or draw it again with gyre map",
        ),
        ("version = 1", "", "map.toml has no version"),
        ("tile_cells = 256", "tile_cells = 512", "tiles of 512 cells"),
        ("cell_m = 0.2", "cell_m = 0.0", "the map's cell_m is 0"),
        ("[options]", "[opt", "map.toml: "),
        (
            "keyframes",
            "keyfarmes",
            "map.toml: unknown field `keyfarmes`",
        ),
    ] {
        fs::write(&path, text.replace(from, to)).unwrap();
        assert_refused(Map::open(folder.path()), expected);
    }
}

#[test]
fn a_damaged_tile_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let mut map = written(folder.path());
    let path = folder.path().join("tiles/0_0.png");
    let whole = fs::read(&path).unwrap();
    let mut read = || map.read(TileIndex { x: 0, y: 0 }, &mut TileImage::default());
    fs::write(&path, &whole[..whole.len() / 2]).unwrap();
    assert_refused(read(), "0_0.png: the tile is damaged");
    fs::remove_file(&path).unwrap();
    for words in ["cannot read", "0_0.png"] {
        assert_refused(read(), words);
    }
}

#[test]
fn pgm_and_yaml_say_what_is_occupied_free_and_unknown_and_where() {
    let folder = tempfile::tempdir().unwrap();
    let mut map = written(folder.path());
    write_pgm(folder.path(), &mut map).unwrap();
    let yaml = fs::read_to_string(folder.path().join("map.yaml")).unwrap();
    let map: HashMap<&str, &str> = yaml.lines().filter_map(|it| it.split_once(": ")).collect();
    assert_eq!(map["image"], "map.pgm");
    let resolution: f64 = map["resolution"].parse().unwrap();
    let origin: [f64; 3] = serde_json::from_str(map["origin"]).unwrap();
    let bytes = fs::read(folder.path().join("map.pgm")).unwrap();
    let parts: Vec<&[u8]> = bytes.splitn(4, |byte| *byte == b'\n').collect();
    let [b"P5", size, b"255", pixels] = parts[..] else {
        panic!("{:?}", &bytes[..20]);
    };
    let size = std::str::from_utf8(size).unwrap().split_once(' ').unwrap();
    let [width, height]: [usize; 2] = [size.0, size.1].map(|side| side.parse().unwrap());
    assert_eq!(pixels.len(), width * height);
    let at = |x_m: f64, y_m: f64| {
        let column = ((x_m - origin[0]) / resolution) as usize;
        let row = height - 1 - ((y_m - origin[1]) / resolution) as usize;
        pixels[row * width + column]
    };
    assert_eq!([at(0.1, 20.1), at(0.1, 15.1), at(0.1, 40.0)], [0, 254, 205]);
}

#[test]
fn a_geotiff_has_the_cells_and_their_place_on_the_earth() {
    let folder = tempfile::tempdir().unwrap();
    let mut map = written(folder.path());
    let path = folder.path().join("map.tif");
    for (origin, epsg) in [(Some(ORIGIN), Some(32_630)), (None, None)] {
        write_geotiff(&path, &mut map, origin).unwrap();
        let mut decoder = Decoder::new(Cursor::new(fs::read(&path).unwrap())).unwrap();
        let (width, height) = decoder.dimensions().unwrap();
        let keys = decoder.get_tag_u16_vec(Tag::GeoKeyDirectoryTag).unwrap();
        let code = keys.chunks_exact(4).find(|key| key[0] == 3072);
        assert_eq!(code.map(|key| key[3]), epsg);
        let bands = decoder.get_tag_ascii_string(Tag::Unknown(42_112)).unwrap();
        assert!(bands.contains(">evidence<") && bands.contains(">looked<"));
        let matrix = decoder
            .get_tag_f64_vec(Tag::ModelTransformationTag)
            .unwrap();
        let DecodingResult::U8(pixels) = decoder.read_image().unwrap() else {
            panic!("8 bits a band");
        };
        assert_eq!(pixels.len(), 2 * (width * height) as usize);
        // From a place through column and row to coordinates.
        let extent = TileExtent::of(&map.tiles()).unwrap();
        let corner = extent.corner_m(map.cell_m());
        let (column, row) = (
            (0.1 - corner.x) / 0.2,
            f64::from(height) - (20.1 - corner.y) / 0.2,
        );
        let evidence = pixels[2 * (row as usize * width as usize + column as usize)];
        let expected = cell(&mut drawn(&drive(20, &wall())), 0.1, 20.1);
        assert_eq!(evidence, expected.evidence);
        let east = matrix[0] * column + matrix[1] * row + matrix[3];
        let north = matrix[4] * column + matrix[5] * row + matrix[7];
        match origin {
            None => assert!((east - 0.1).abs() < 1e-9 && (north - 20.1).abs() < 1e-9),
            // East is ahead, so that 20 m to the left are 20 m north, but for the convergence of
            // 1.4 degrees there.
            Some(_) => {
                let (northing, easting, _) = utm::to_utm_wgs84(51.75, -1.25, 30);
                assert!((east - easting).abs() < 0.7, "{}", east - easting);
                let left_m = north - northing;
                assert!((left_m - 20.1).abs() < 0.1, "{left_m}");
            }
        }
    }
}

#[test]
fn web_tiles_are_a_pyramid_down_to_the_cells() {
    let folder = tempfile::tempdir().unwrap();
    let mut map = written(folder.path());
    write_web_tiles(folder.path(), &mut map).unwrap();
    let json = fs::read_to_string(folder.path().join("tiles.json")).unwrap();
    let extent = TileExtent::of(&map.tiles()).unwrap();
    let zoom = extent
        .cells()
        .map(|cells| cells / TILE_CELLS)
        .into_iter()
        .max()
        .unwrap();
    let zoom = zoom.next_power_of_two().ilog2();
    assert!(json.contains(&format!("\"maxzoom\": {zoom}")), "{json}");
    let count = |zoom: u32| {
        let columns = fs::read_dir(folder.path().join(zoom.to_string())).unwrap();
        columns
            .map(|column| fs::read_dir(column.unwrap().path()).unwrap().count())
            .sum::<usize>()
    };
    assert_eq!((count(0), count(zoom)), (1, map.tiles().len()));
}

#[test]
fn a_map_without_keyframes_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let refused = write_map(folder.path(), &mut drawn(&[]), None, "a test");
    assert_refused(refused, "the map is empty: no keyframe was drawn");
}
