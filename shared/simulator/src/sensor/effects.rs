//! What makes scans hard, each to be switched off on its own: the section `[simulation.effects]`.

use serde::{Deserialize, Serialize};

/// Which of a real radar's effects are simulated. All are on by default. `gallery/README.md` in the crate's folder shows each off
/// and on, with its source.
///
/// Each has random numbers of its own: switching one changes nothing of the others.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Effects {
    /// Each azimuth is measured at its own time from its own pose; off: all at the middle of the sweep.
    pub sweep_motion: bool,
    /// Side lobes beside the antenna's main lobe, so that what is strong shows in azimuths beside it.
    pub side_lobes: bool,
    /// Echoes in one resolution cell interfere, and do so differently from every pose; off: their powers add up.
    pub speckle: bool,
    /// Smooth and tilted surfaces reflect into some directions only; off: all reflect to all sides.
    pub aspect: bool,
    /// Smooth walls shine where they face the sensor squarely: a spot that glides along with it.
    pub highlights: bool,
    /// What reflects has lobes of its own, and flickers as it is passed.
    pub scintillation: bool,
    /// The beam is a few degrees high and the vehicle nods, so that what is lit comes and goes.
    pub elevation: bool,
    /// Walls hide what is behind them.
    pub occlusion: bool,
    /// Metal and glass fronts mirror strong reflectors to where nothing is.
    pub multipath: bool,
    /// Strong echoes raise the noise in all bins of their azimuth (phase noise), most of all around them: streaks.
    pub phase_noise: bool,
    /// Echoes bounce on between houses: a tail like noise behind what is strong, longest down a street.
    pub reverberation: bool,
    /// The transmitter rings in the first bins.
    pub ringing: bool,
    /// The vehicle's own roof and rear reflect.
    pub own_vehicle: bool,
    /// Road, verges and fields send back a little, in patches.
    pub ground: bool,
    /// The receiver's own noise, the same in all azimuths.
    pub noise: bool,
    /// Faint lines at fixed ranges, from clocks and power supplies inside the radar.
    pub spurious_lines: bool,
    /// Another radar is heard in some azimuths.
    pub interference: bool,
    /// Rain, fog and snow weaken echoes and send back their own.
    pub weather: bool,
    /// Speed towards what is seen shifts its range.
    pub doppler: bool,
    /// The encoder's disc is off its axis and its counts jitter.
    pub encoder_wobble: bool,
    /// Some azimuths are lost and filled in from their neighbours.
    pub dropped_azimuths: bool,
}

impl Effects {
    /// All of them.
    pub const ALL: Self = Self::with(true);
    /// None: points, seen through a beam and a range window.
    pub const NONE: Self = Self::with(false);

    const fn with(on: bool) -> Self {
        Self {
            sweep_motion: on,
            side_lobes: on,
            speckle: on,
            aspect: on,
            highlights: on,
            scintillation: on,
            elevation: on,
            occlusion: on,
            multipath: on,
            phase_noise: on,
            reverberation: on,
            ringing: on,
            own_vehicle: on,
            ground: on,
            noise: on,
            spurious_lines: on,
            interference: on,
            weather: on,
            doppler: on,
            encoder_wobble: on,
            dropped_azimuths: on,
        }
    }
}

impl Default for Effects {
    fn default() -> Self {
        Self::ALL
    }
}
