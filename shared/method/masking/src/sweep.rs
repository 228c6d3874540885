use gyre_geometry::{PolarScan, Twist};

#[derive(Clone, Copy, Debug)]
pub struct Sweep<'a> {
    /// The number that identifies the scan in later calls.
    pub number: u64,
    pub scan: PolarScan<'a>,
    /// The velocity of the sensor; `None` if it is unknown.
    pub twist: Option<Twist>,
}
