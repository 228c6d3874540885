//! The gallery shows every effect.

use std::path::Path;

use gyre_worlds::{Profile, SimulationConfig};

#[test]
fn the_gallery_shows_every_switch_and_radar_and_has_all_pictures() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("gallery");
    let page = std::fs::read_to_string(folder.join("README.md")).unwrap();
    let switches = toml::Table::try_from(SimulationConfig::default().resolved().effects).unwrap();
    for key in switches.keys() {
        assert!(
            page.contains(&format!("(`effects.{key}`)")),
            "{key} is not shown"
        );
    }
    for profile in Profile::ALL {
        let name = toml::Value::try_from(profile).unwrap();
        assert!(page.contains(name.as_str().unwrap()), "{name} is not shown");
    }
    let pictures = page
        .split("](")
        .skip(1)
        .filter_map(|rest| rest.split_once(".png)"))
        .map(|(name, _)| name);
    for name in pictures.clone() {
        let bytes = std::fs::metadata(folder.join(name).with_extension("png"))
            .unwrap()
            .len();
        assert!(bytes < 14_000, "{name}: {bytes} bytes");
    }
    let files = std::fs::read_dir(&folder).unwrap().count() - 1;
    assert_eq!(files, pictures.count(), "pictures that no page shows");
}
