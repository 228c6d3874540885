//! The command line of `gyre map`.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use gyre_slam::mapping::Origin;

#[derive(Debug, Args)]
pub struct MapArguments {
    /// The folder of the run's results, its --out, with journal/keyframes.log.
    pub run: PathBuf,
    /// The folder of the map.
    #[arg(long)]
    pub out: PathBuf,
    /// The forms that are written: the map's own folder, map.png, map.tif, map.pgm with map.yaml
    /// for map_server, or web tiles.
    #[arg(long, value_enum, value_delimiter = ',', default_value = "folder,png")]
    pub format: Vec<MapFormat>,
    /// Draw along this trajectory (TUM). Default: the run's trajectory_slam.tum, or its
    /// trajectory.tum.
    #[arg(long, value_name = "FILE")]
    pub trajectory: Option<PathBuf>,
    /// Place the run in this map of earlier drives, and write a map of all. Its cells and its place
    /// on the earth stay.
    #[arg(long, value_name = "MAP", conflicts_with_all = ["trajectory", "cell_m", "origin"])]
    pub extend: Option<PathBuf>,
    /// Side of a cell, m.
    #[arg(long, default_value = "0.2")]
    pub cell_m: f64,
    /// Place of the first keyframe on the earth and its heading, degrees: latitude, longitude (WGS
    /// 84), clockwise from true north. Default: the run's place by GNSS.
    #[arg(long, value_name = "LAT,LON,HEADING", value_parser = origin, allow_hyphen_values = true)]
    pub origin: Option<Origin>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum MapFormat {
    /// map.toml and tiles/X_Y.png.
    Folder,
    /// map.png: the whole map with the trajectory in it.
    Png,
    /// map.tif, a GeoTIFF.
    Geotiff,
    /// map.pgm and map.yaml.
    Pgm,
    /// web/Z/X/Y.png.
    Web,
}

fn origin(text: &str) -> Result<Origin, String> {
    let numbers: Result<Vec<f64>, _> = text.split(',').map(|n| n.trim().parse()).collect();
    let Ok([latitude_deg, longitude_deg, heading_deg]) = numbers.as_deref() else {
        return Err("three numbers are needed, as in 51.76,-1.26,90".to_owned());
    };
    let origin = Origin {
        latitude_deg: *latitude_deg,
        longitude_deg: *longitude_deg,
        heading_deg: *heading_deg,
    };
    origin.validate().map_err(|error| error.to_string())?;
    Ok(origin)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_origin_is_three_numbers_on_the_earth() {
        let edinburgh =
            origin("55.95, -3.2,90").map(|o| (o.latitude_deg, o.longitude_deg, o.heading_deg));
        assert_eq!(edinburgh, Ok((55.95, -3.2, 90.0)));
        for text in [
            "",
            "55.95,-3.2",
            "55.95,-3.2,90,0",
            "north,0,0",
            "91,0,0",
            "nan,0,0",
        ] {
            assert!(origin(text).is_err(), "{text}");
        }
    }
}
