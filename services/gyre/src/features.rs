//! The message of a build without `--features full` about a missing feature.

#[cfg(not(feature = "link"))]
pub const LINK: &str = "zenoh, which links machines";

/// Returns why a part of Gyre is refused that this build lacks.
pub fn absent(part: &str) -> String {
    format!(
        "this gyre was built without {part}: build it with `cargo run --release --locked --features full -- ...`, or install its package or container"
    )
}
