//! The style of a terrace.

use rand::Rng;
use rand_chacha::ChaCha8Rng;

use super::boundary::Boundary;
use super::facade::Material;

/// The common properties of a terrace.
pub(super) struct TerraceStyle {
    pub setback_m: f64,
    pub front: Material,
    /// The boundary in front of the houses.
    pub before: Option<Boundary>,
}

impl TerraceStyle {
    pub(super) fn draw(rng: &mut ChaCha8Rng) -> Self {
        let front = match rng.random::<f64>() {
            ..0.7 => Material::Brick,
            ..0.82 => Material::Concrete,
            _ => Material::Glass,
        };
        match rng.random::<f64>() {
            ..0.5 => Self {
                setback_m: 0.0,
                front,
                before: None,
            },
            ..0.65 => Self {
                setback_m: rng.random_range(0.3..1.0),
                front,
                before: None,
            },
            ..0.88 => Self {
                setback_m: rng.random_range(1.5..3.0),
                front,
                before: Some(Boundary::Railing),
            },
            _ => Self {
                setback_m: rng.random_range(1.5..3.0),
                front,
                before: Some(Boundary::Wall),
            },
        }
    }
}
