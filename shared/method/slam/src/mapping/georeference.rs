use nalgebra::{Matrix2, Vector2};
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// Where the map frame lies on the earth (WGS 84).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Origin {
    pub latitude_deg: f64,
    pub longitude_deg: f64,
    /// Heading of the frame's x axis, degrees clockwise from true north.
    pub heading_deg: f64,
}

#[derive(Clone, Copy, Debug, PartialEq, Error)]
#[error(
    "the origin {}, {}, {} is none: latitude from -80 to 84, longitude from -180 to 180 and heading from -360 to 360 degrees are needed",
    .0.latitude_deg, .0.longitude_deg, .0.heading_deg
)]
pub struct OriginError(Origin);

/// The linear map from the frame of a map to a projected or local coordinate system:
/// `offset + matrix * (x, y)`, m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Georeference {
    /// EPSG code of the system; `None` for the map's own frame.
    pub epsg: Option<u16>,
    pub matrix: Matrix2<f64>,
    pub offset: Vector2<f64>,
}

/// UTM: scale at the central meridian, its easting (m), and the radius of the earth (m), which
/// determines the growth of the scale away from the meridian.
const UTM_SCALE: f64 = 0.9996;
const UTM_EASTING_M: f64 = 500_000.0;
const EARTH_M: f64 = 6_371_000.0;

impl Origin {
    /// Checks that the origin is on the earth, within UTM.
    pub fn validate(&self) -> Result<(), OriginError> {
        let fits = (-80.0..84.0).contains(&self.latitude_deg)
            && (-180.0..180.0).contains(&self.longitude_deg)
            && (-360.0..=360.0).contains(&self.heading_deg);
        fits.then_some(()).ok_or(OriginError(*self))
    }
}

impl Georeference {
    pub fn new(origin: Option<Origin>) -> Result<Self, OriginError> {
        let Some(origin) = origin else {
            return Ok(Self {
                epsg: None,
                matrix: Matrix2::identity(),
                offset: Vector2::zeros(),
            });
        };
        origin.validate()?;
        let (latitude, longitude) = (origin.latitude_deg, origin.longitude_deg);
        let zone = utm::lat_lon_to_zone_number(latitude, longitude);
        // Degrees of latitude and longitude in; northing, easting and convergence (degrees) out.
        let (northing, easting, _) = utm::to_utm_wgs84(latitude, longitude, zone);
        let scale =
            UTM_SCALE * (1.0 + 0.5 * ((easting - UTM_EASTING_M) / (UTM_SCALE * EARTH_M)).powi(2));
        let (sin, cos) =
            (origin.heading_deg.to_radians() - convergence(latitude, longitude, zone)).sin_cos();
        let hemisphere = if latitude < 0.0 { 32_700 } else { 32_600 };
        Ok(Self {
            epsg: Some(hemisphere + u16::from(zone)),
            // x ahead at the heading, y to the left of it; east, then north.
            matrix: scale * Matrix2::new(sin, -cos, cos, sin),
            offset: Vector2::new(easting, northing),
        })
    }
}

/// The angle from true to grid north, rad clockwise: from the UTM coordinates of a point a little
/// farther north.
fn convergence(latitude: f64, longitude: f64, zone: u8) -> f64 {
    let step_deg = 1e-4;
    let (south, west, _) = utm::to_utm_wgs84(latitude - step_deg, longitude, zone);
    let (north, east, _) = utm::to_utm_wgs84(latitude + step_deg, longitude, zone);
    // True north leans west of grid north where the easting falls on the way.
    -(east - west).atan2(north - south)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn georeference([latitude_deg, longitude_deg, heading_deg]: [f64; 3]) -> Georeference {
        let origin = Origin {
            latitude_deg,
            longitude_deg,
            heading_deg,
        };
        Georeference::new(Some(origin)).unwrap()
    }

    #[test]
    fn the_frame_of_a_map_lies_on_the_earth_by_its_heading() {
        // Near Edinburgh, on the central meridian of zone 30.
        let east = georeference([55.95, -3.0, 90.0]);
        assert_eq!(east.epsg, Some(32_630));
        // Grid north is true north there, and the easting 500 km.
        assert!((east.offset.x - 500_000.0).abs() < 1e-3, "{}", east.offset);
        let off_m = (east.offset.y - 6_200_551.0).abs();
        assert!(off_m < 100.0, "{}", east.offset);
        let ahead = east.matrix * Vector2::new(1.0, 0.0);
        assert!((ahead - Vector2::new(0.9996, 0.0)).norm() < 1e-9);
        let left = east.matrix * Vector2::new(0.0, 1.0);
        assert!((left - Vector2::new(0.0, 0.9996)).norm() < 1e-9);
    }

    #[test]
    fn a_step_to_true_north_ends_where_its_latitude_says() {
        for longitude_deg in [-5.5, -3.0, -0.5] {
            let [here, there] =
                [0.0, 0.001].map(|north| georeference([51.75 + north, longitude_deg, 0.0]));
            let moved = there.offset - here.offset;
            let direction = here.matrix * Vector2::new(1.0, 0.0);
            let angle = direction.perp(&moved) / (direction.norm() * moved.norm());
            assert!(angle.abs() < 1e-5, "{longitude_deg}: {angle}");
        }
    }

    #[test]
    fn a_place_beyond_utm_is_refused() {
        let origin = Origin {
            latitude_deg: 89.0,
            longitude_deg: 0.0,
            heading_deg: 0.0,
        };
        let refused = Georeference::new(Some(origin)).unwrap_err().to_string();
        assert!(refused.contains("the origin 89, 0, 0 is none"), "{refused}");
    }
}
