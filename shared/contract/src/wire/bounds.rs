//! The bounds of a field, which a check and a document read.

use std::{
    f64::consts::PI,
    fmt::{self, Display},
};

use gyre_geometry::covariance;

use crate::limits::Limits;

/// Tolerance for a yaw of pi, rad.
const ROUNDING_RAD: f64 = 1e-9;

/// The largest coordinate of a pose, m: more than a way around the earth.
pub const REACH_M: f64 = 1e8;
pub const REACH: Bounds = Bounds::Within(-REACH_M, REACH_M);

#[derive(Clone, Copy, Debug)]
pub enum Bounds {
    Any,
    Finite,
    NotNegative,
    Within(f64, f64),
    AtLeast(u64),
    /// One of as many codes as there are names, from 0.
    Codes(&'static [&'static str]),
    /// A set of these bits.
    Bits(u64),
    /// An angle from minus half a turn to half a turn, rad.
    HalfTurn,
    /// Within so many widths of the raster, m.
    Widths(f64),
    /// x and y within a width of the raster, yaw within half a turn.
    Motion,
    /// The upper triangle of a covariance of (x, y, yaw), row by row.
    Covariance,
    /// Variance of x, covariance, variance of y.
    Covariance2,
    /// Equal to a property of the run.
    OfRun(fn(&Limits) -> f64),
    /// At most a property of the run.
    AtMost(fn(&Limits) -> f64),
    /// An array. The field of this name states how many of its elements have a meaning.
    CountedBy(&'static str),
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Number {
    Whole(u64),
    Signed(i64),
    Single(f32),
    Double(f64),
}

impl Number {
    pub fn as_f64(self) -> f64 {
        match self {
            Self::Whole(number) => number as f64,
            Self::Signed(number) => number as f64,
            Self::Single(number) => number.into(),
            Self::Double(number) => number,
        }
    }
}

impl Display for Number {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Whole(number) => number.fmt(f),
            Self::Signed(number) => number.fmt(f),
            Self::Single(number) => number.fmt(f),
            Self::Double(number) => number.fmt(f),
        }
    }
}

/// The end of a violation's sentence, behind the name of the field.
pub(crate) fn require(
    holds: bool,
    value: impl Display,
    expected: impl Display,
) -> Result<(), String> {
    match holds {
        true => Ok(()),
        false => Err(format!(" is {value}, but must be {expected}")),
    }
}

/// Names the field of a violation.
pub(crate) fn field(name: &str, checked: Result<(), String>) -> Result<(), String> {
    checked.map_err(|violation| format!("{name}{violation}"))
}

impl Bounds {
    /// Returns whether they are of an array as a whole.
    pub(super) fn is_of_all(&self) -> bool {
        matches!(self, Self::Motion | Self::Covariance | Self::Covariance2)
    }

    pub(super) fn check(&self, number: Option<Number>, limits: &Limits) -> Result<(), String> {
        let Some(number) = number else {
            return Ok(());
        };
        let value = number.as_f64();
        let within = |reach: f64| (-reach..=reach).contains(&value);
        let holds = match *self {
            Self::Finite => value.is_finite(),
            Self::NotNegative => value >= 0.0 && value.is_finite(),
            Self::Within(first, last) => (first..=last).contains(&value),
            Self::AtLeast(least) => value >= least as f64,
            Self::Codes(names) => value < names.len() as f64,
            Self::Bits(all) => (value as u64) & !all == 0,
            Self::HalfTurn => within(PI + ROUNDING_RAD),
            Self::Widths(widths) => within(widths * limits.extent_m()),
            Self::OfRun(property) => value == property(limits),
            Self::AtMost(property) => value <= property(limits),
            Self::Any
            | Self::CountedBy(_)
            | Self::Motion
            | Self::Covariance
            | Self::Covariance2 => true,
        };
        require(holds, number, Expected(self, Some(limits)))
    }

    pub(super) fn check_all(&self, bytes: &[u8], limits: &Limits) -> Result<(), String> {
        let values: &[f64] = bytemuck::cast_slice(bytes);
        let holds = match (self, values) {
            (Self::Covariance, packed) => packed
                .try_into()
                .is_ok_and(covariance::is_positive_semidefinite),
            (Self::Covariance2, [xx, xy, yy]) => {
                [xx, yy].iter().all(|it| **it >= 0.0 && it.is_finite()) && xy.is_finite()
            }
            (Self::Motion, values) => {
                let bounds = [Self::Widths(1.0), Self::Widths(1.0), Self::HalfTurn];
                let mut parts = bounds.iter().zip(values).enumerate();
                return parts.try_for_each(|(index, (bounds, value))| {
                    let checked = bounds.check(Some(Number::Double(*value)), limits);
                    field(&format!("[{index}]"), checked)
                });
            }
            _ => true,
        };
        require(
            holds,
            format_args!("{values:?}"),
            Expected(self, Some(limits)),
        )
    }
}

impl Display for Bounds {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        Expected(self, None).fmt(f)
    }
}

/// Bounds in words, with the numbers of a run if they are known.
struct Expected<'a>(&'a Bounds, Option<&'a Limits>);

impl Display for Expected<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self(bounds, limits) = *self;
        match (bounds, limits) {
            (Bounds::Any | Bounds::CountedBy(_), _) => Ok(()),
            (Bounds::Finite, _) => write!(f, "finite"),
            (Bounds::NotNegative, _) => write!(f, "finite, 0 or more"),
            (Bounds::Within(first, last), _) => {
                write!(f, "from {} to {}", Short(*first), Short(*last))
            }
            (Bounds::AtLeast(least), _) => write!(f, "{least} or more"),
            (Bounds::Codes(names), _) => write!(f, "0 to {}", names.len() - 1),
            (Bounds::Bits(all), _) => write!(f, "bits of 1 to {}", all.div_ceil(2)),
            (Bounds::HalfTurn, _) => write!(f, "within half a turn"),
            (Bounds::Widths(widths), Some(limits)) => {
                let reach_m = widths * limits.extent_m();
                write!(f, "from {} to {reach_m}", -reach_m)
            }
            (Bounds::Widths(1.0), None) => write!(f, "within a width of the raster"),
            (Bounds::Widths(widths), None) => write!(f, "within {widths} widths of the raster"),
            (Bounds::Motion, _) => {
                write!(f, "within a width of the raster, and within half a turn")
            }
            (Bounds::Covariance, _) => write!(f, "finite and positive semidefinite"),
            (Bounds::Covariance2, _) => write!(f, "finite, with variances of 0 or more"),
            (Bounds::OfRun(property), Some(limits)) => write!(f, "{}", property(limits) as f32),
            (Bounds::OfRun(_), None) => write!(f, "that of the run"),
            (Bounds::AtMost(property), Some(limits)) => write!(f, "at most {}", property(limits)),
            (Bounds::AtMost(_), None) => write!(f, "at most that of the run"),
        }
    }
}

/// A number in its shorter form.
struct Short(f64);

impl Display for Short {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0.abs() >= 1e6 {
            true => write!(f, "{:e}", self.0),
            false => write!(f, "{}", self.0),
        }
    }
}
