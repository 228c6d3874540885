//! The districts of a town and their land uses.

use nalgebra::Point2;
use rand::Rng;

use super::config::Character;
use super::random::{hash, smooth};

/// A kind of district.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum District {
    City,
    Suburb,
    Campus,
    Country,
}

/// A land use.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Use {
    /// A terraced house with a yard behind.
    Terrace,
    /// A detached house in a garden, with a garage.
    Detached,
    /// A block of flats with balconies.
    Flats,
    /// A hall, a school, offices.
    Hall,
    Church,
    /// Trees and bushes.
    Green,
    CarPark,
    Field,
    Farm,
    /// A passage between houses.
    Alley,
    /// Sheds and walls behind houses.
    Yards,
}

/// Scale on which the density of buildings changes, metres.
const BUILT_UP_M: f64 = 350.0;
/// Scale on which campuses appear, metres.
const CAMPUS_M: f64 = 450.0;

impl District {
    /// The district at a place, for a town of this character.
    pub(super) fn at(character: Character, seed: u64, place: Point2<f64>) -> Self {
        match character {
            Character::City => Self::City,
            Character::Suburb => Self::Suburb,
            Character::Campus => Self::Campus,
            Character::Country => Self::Country,
            Character::Mixed => Self::mixed(seed, place),
        }
    }

    fn mixed(seed: u64, place: Point2<f64>) -> Self {
        let built_up = smooth(hash(&[seed, 1]), place, BUILT_UP_M);
        let campus = smooth(hash(&[seed, 2]), place, CAMPUS_M);
        match built_up {
            _ if (0.35..0.75).contains(&built_up) && campus > 0.65 => Self::Campus,
            ..0.3 => Self::Country,
            ..0.5 => Self::Suburb,
            _ => Self::City,
        }
    }

    /// Uses with their shares, in the first row along a street or in the second.
    fn uses(self, first_row: bool) -> &'static [(Use, f64)] {
        match (self, first_row) {
            (Self::City, true) => &[
                (Use::Terrace, 0.75),
                (Use::Flats, 0.06),
                (Use::Hall, 0.03),
                (Use::Green, 0.03),
                (Use::CarPark, 0.02),
                (Use::Church, 0.02),
                (Use::Alley, 0.09),
            ],
            (Self::City, false) => &[(Use::Yards, 0.6), (Use::Terrace, 0.25), (Use::Hall, 0.15)],
            (Self::Suburb, true) => &[
                (Use::Detached, 0.8),
                (Use::Terrace, 0.06),
                (Use::Green, 0.06),
                (Use::Church, 0.01),
                (Use::Alley, 0.05),
                (Use::Hall, 0.02),
            ],
            (Self::Suburb, false) => &[(Use::Green, 0.4), (Use::Yards, 0.3), (Use::Detached, 0.3)],
            (Self::Campus, true) => &[
                (Use::Hall, 0.3),
                (Use::Flats, 0.2),
                (Use::Green, 0.32),
                (Use::CarPark, 0.18),
            ],
            (Self::Campus, false) => &[(Use::Green, 0.5), (Use::Hall, 0.3), (Use::CarPark, 0.2)],
            (Self::Country, true) => &[
                (Use::Field, 0.82),
                (Use::Farm, 0.06),
                (Use::Detached, 0.06),
                (Use::Green, 0.06),
            ],
            (Self::Country, false) => &[(Use::Field, 0.9), (Use::Green, 0.1)],
        }
    }

    /// Draws a use.
    pub(super) fn draw(self, first_row: bool, rng: &mut impl Rng) -> Use {
        let uses = self.uses(first_row);
        let mut left = rng.random::<f64>();
        let drawn = uses.iter().find(|(_, share)| {
            left -= share;
            left < 0.0
        });
        drawn.unwrap_or(&uses[0]).0
    }

    /// Minimum and maximum depth of the lots, metres.
    pub(super) fn depth_m(self) -> (f64, f64) {
        match self {
            Self::City => (15.0, 24.0),
            Self::Suburb => (26.0, 36.0),
            Self::Campus => (35.0, 55.0),
            Self::Country => (35.0, 50.0),
        }
    }

    /// Share of the stretches with parking bays, and of those with a row of trees.
    pub(super) fn kerb_shares(self) -> (f64, f64) {
        match self {
            Self::City => (0.55, 0.2),
            Self::Suburb => (0.45, 0.35),
            Self::Campus => (0.3, 0.5),
            Self::Country => (0.03, 0.15),
        }
    }
}

impl Use {
    /// Minimum and maximum width along the street, metres.
    pub(super) fn width_m(self) -> (f64, f64) {
        match self {
            Self::Terrace => (5.5, 12.0),
            Self::Detached => (11.0, 18.0),
            Self::Flats => (20.0, 38.0),
            Self::Hall => (24.0, 60.0),
            Self::Church => (24.0, 34.0),
            Self::Green => (12.0, 40.0),
            Self::CarPark => (18.0, 40.0),
            Self::Field => (25.0, 72.0),
            Self::Farm => (35.0, 55.0),
            Self::Alley => (2.0, 6.0),
            Self::Yards => (6.0, 12.0),
        }
    }

    /// Minimum depth, metres.
    pub(super) fn min_depth_m(self) -> f64 {
        match self {
            Self::Terrace | Self::Alley | Self::Yards | Self::Green | Self::Field => 7.0,
            Self::CarPark => 12.0,
            Self::Detached | Self::Flats | Self::Hall => 18.0,
            Self::Church | Self::Farm => 24.0,
        }
    }
}
