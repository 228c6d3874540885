//! Places on the earth (WGS 84) as coordinates in a plane that touches it.
//!
//! The plane is the local tangent plane of surveying (east, north, up) without its up: a place is
//! projected along the vertical of the origin. Within 10 km of it lengths are right to 2e-6 of
//! them.

/// Semi-major axis of the ellipsoid WGS 84, m.
const SEMI_MAJOR_M: f64 = 6_378_137.0;
const FLATTENING: f64 = 1.0 / 298.257_223_563;
const ECCENTRICITY_2: f64 = FLATTENING * (2.0 - FLATTENING);
/// Newton steps from the plane to the earth: each takes the error down by the share that the place
/// is of the earth's radius.
const STEPS: usize = 12;

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Geographic {
    /// Latitude (WGS 84), degrees.
    pub latitude_deg: f64,
    pub longitude_deg: f64,
}

/// A plane that touches the earth, with axes to the east and to the north.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LocalPlane {
    origin: Geographic,
    altitude_m: f64,
    origin_m: [f64; 3],
}

impl LocalPlane {
    /// Creates the plane that touches at a place of this altitude above the ellipsoid, m.
    pub fn new(origin: Geographic, altitude_m: f64) -> Self {
        Self {
            origin,
            altitude_m,
            origin_m: earth_centred(origin, altitude_m),
        }
    }

    pub fn origin(&self) -> Geographic {
        self.origin
    }

    /// Returns the coordinates of a place at the altitude of the origin: m east and north.
    pub fn east_north(&self, place: Geographic) -> [f64; 2] {
        let at = earth_centred(place, self.altitude_m);
        let [x, y, z] = [0, 1, 2].map(|axis| at[axis] - self.origin_m[axis]);
        let (sin_lat, cos_lat) = self.origin.latitude_deg.to_radians().sin_cos();
        let (sin_lon, cos_lon) = self.origin.longitude_deg.to_radians().sin_cos();
        let outward = x * cos_lon + y * sin_lon;
        [y * cos_lon - x * sin_lon, z * cos_lat - outward * sin_lat]
    }

    /// Returns the place of coordinates in the plane, m east and north, at most 1,000 km away.
    pub fn place(&self, [east_m, north_m]: [f64; 2]) -> Geographic {
        let mut place = self.origin;
        for _ in 0..STEPS {
            let [east, north] = self.east_north(place);
            let (sin, cos) = place.latitude_deg.to_radians().sin_cos();
            let bend = 1.0 - ECCENTRICITY_2 * sin * sin;
            let across = SEMI_MAJOR_M / bend.sqrt() + self.altitude_m;
            let along = SEMI_MAJOR_M * (1.0 - ECCENTRICITY_2) / bend.powf(1.5) + self.altitude_m;
            place.latitude_deg += ((north_m - north) / along).to_degrees();
            place.longitude_deg += ((east_m - east) / (across * cos)).to_degrees();
        }
        place
    }

    /// Returns the heading at coordinates in the plane of a direction that is `yaw_rad`
    /// counter-clockwise from its east: degrees clockwise from the true north there, -180 to 180.
    pub fn heading_deg(&self, [east_m, north_m]: [f64; 2], yaw_rad: f64) -> f64 {
        let (sin, cos) = yaw_rad.sin_cos();
        let here = Self::new(self.place([east_m, north_m]), self.altitude_m);
        let [east, north] = here.east_north(self.place([east_m + cos, north_m + sin]));
        east.atan2(north).to_degrees()
    }
}

fn earth_centred(place: Geographic, altitude_m: f64) -> [f64; 3] {
    let (sin_lat, cos_lat) = place.latitude_deg.to_radians().sin_cos();
    let (sin_lon, cos_lon) = place.longitude_deg.to_radians().sin_cos();
    let radius_m = SEMI_MAJOR_M / (1.0 - ECCENTRICITY_2 * sin_lat * sin_lat).sqrt();
    let outward_m = (radius_m + altitude_m) * cos_lat;
    [
        outward_m * cos_lon,
        outward_m * sin_lon,
        (radius_m * (1.0 - ECCENTRICITY_2) + altitude_m) * sin_lat,
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn place(latitude_deg: f64, longitude_deg: f64) -> Geographic {
        Geographic {
            latitude_deg,
            longitude_deg,
        }
    }

    #[test]
    fn a_minute_of_latitude_is_a_nautical_mile_at_45_degrees() {
        // Meridian arc of WGS 84 from 44 deg 59.5' to 45 deg 0.5': 1,852.2 m.
        let half = 0.5 / 60.0;
        let plane = LocalPlane::new(place(45.0 - half, 7.0), 0.0);
        let [east, north] = plane.east_north(place(45.0 + half, 7.0));
        assert!(east.abs() < 1e-9, "{east}");
        assert!((north - 1852.2).abs() < 0.1, "{north}");
    }

    #[test]
    fn north_of_another_meridian_is_turned_by_the_convergence() {
        let plane = LocalPlane::new(place(55.95, -3.2), 0.0);
        let at = [5000.0, 0.0];
        let expected = 5000.0 / SEMI_MAJOR_M * 55.95f64.to_radians().tan();
        let turned = plane
            .heading_deg(at, std::f64::consts::FRAC_PI_2)
            .to_radians();
        assert!((turned - expected).abs() < 5e-6, "{turned} {expected}");
    }

    proptest! {
        #[test]
        fn a_place_is_found_again_from_its_coordinates(
            lat in -85.0..85.0f64, lon in -180.0..180.0f64, altitude in -400.0..4000.0f64,
            at in prop::array::uniform2(-50e3..50e3f64),
        ) {
            let plane = LocalPlane::new(place(lat, lon), altitude);
            let [east, north] = plane.east_north(plane.place(at));
            prop_assert!((east - at[0]).hypot(north - at[1]) < 1e-6);
        }

        #[test]
        fn small_steps_have_the_lengths_of_the_ellipsoid(
            lat in -80.0..80.0f64, lon in -180.0..180.0f64, step in -1e-4..1e-4f64,
        ) {
            let plane = LocalPlane::new(place(lat, lon), 0.0);
            let sin = lat.to_radians().sin();
            let bend = 1.0 - ECCENTRICITY_2 * sin * sin;
            let along = SEMI_MAJOR_M * (1.0 - ECCENTRICITY_2) / bend.powf(1.5);
            let across = SEMI_MAJOR_M / bend.sqrt() * lat.to_radians().cos();
            let north = plane.east_north(place(lat + step, lon));
            let east = plane.east_north(place(lat, lon + step));
            prop_assert!((north[1] - along * step.to_radians()).abs() < 1e-3);
            prop_assert!((east[0] - across * step.to_radians()).abs() < 1e-3);
        }
    }
}
