//! The commands that operate running runs: `gyre up`, `down`, `ps`, `logs`, `top`, `restart`,
//! `swap` and `echo`.
//!
//! Each asks the supervisor of a run at its control socket ([`gyre_client::control`]); nothing of a
//! run is looked up elsewhere, but its logs.

mod background;
mod choice;
mod echo;
mod hz;
mod logs;
mod processes;
mod programs;
mod top;

pub(crate) use background::status_of;
pub use background::{detach_if_asked, down, up};
pub use choice::{RunChoice, chosen};
pub use echo::{EchoArguments, echo};
pub use logs::{LogsArguments, logs};
pub use processes::{PsArguments, ps};
pub use programs::{RestartArguments, SwapArguments, restart, swap};
pub use top::{TopArguments, top};
