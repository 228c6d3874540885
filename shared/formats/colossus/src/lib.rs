//! Navtech's network protocol Colossus (TCP), without I/O: bytes in, messages out; azimuths in,
//! scans out.
//!
//! A client connects to [`PORT`]. The radar sends its configuration, the client sends
//! [`Request::StartFft`], and the radar sends azimuths until [`Request::StopFft`]. A radar has at
//! most three clients.

mod address;
pub mod asterix;
pub mod clock;
pub mod configuration;
pub mod health;
mod malformed;
pub mod message;
pub mod parser;
mod protobuf;
pub mod sweep;
pub mod write;

pub use address::{Address, BadAddress};
pub use asterix::Datagrams;
pub use clock::{ByteOrder, ClockFormat, FoundClock, RadarClock, SplitUnit};
pub use configuration::{BadConfiguration, Configuration};
pub use health::{Health, HealthStatus, Reading};
pub use malformed::Malformed;
pub use message::{Azimuth, Message, PORT, Powers, Request, decode};
pub use parser::{Damage, Event, Parser};
pub use sweep::{Counters, Sweep, SweepAssembler};
pub use write::{write_azimuth, write_configuration, write_keep_alive, write_other, write_request};
