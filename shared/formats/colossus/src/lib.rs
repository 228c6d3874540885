//! Navtech's network protocol Colossus (TCP), without I/O: bytes in, messages out; azimuths in,
//! scans out.
//!
//! Reading order:
//! - [`message`]: the messages of a radar and its clients;
//! - [`configuration`]: the radar's description of itself, its first message;
//! - [`health`]: the radar's message beside azimuths;
//! - [`write`](mod@write): messages as bytes, for clients and servers;
//! - [`parser`]: messages from any pieces of a stream of bytes, damaged ones included;
//! - [`asterix`]: the same messages from the datagrams of a radar that sends by UDP;
//! - [`clock`]: the time of each azimuth;
//! - [`sweep`]: azimuths to scans.
//!
//! A client connects to [`PORT`]. The radar sends its configuration, the client sends
//! [`Request::StartFft`], and the radar sends azimuths until [`Request::StopFft`]. A radar has at
//! most three clients.

mod address;
pub mod asterix;
pub mod clock;
pub mod configuration;
pub mod health;
mod kept;
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
pub use sweep::{Constants, Counters, Sweep, SweepAssembler};
pub use write::{write_azimuth, write_configuration, write_keep_alive, write_other, write_request};
