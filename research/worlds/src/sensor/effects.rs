//! The effects that make real scans difficult, each with a switch: the section
//! `[simulation.effects]`.

use serde::{Deserialize, Serialize};

/// Switches for the simulated effects of real radars. All up to `dropped_azimuths` are on by
/// default; the others are as `simulation.realism` says. `gallery/README.md` in the crate's folder
/// shows each off and on, with its source.
///
/// Each has its own random numbers, so switching one does not change the others.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Effects {
    /// Each azimuth is measured at its own time from its own pose; off: all at the middle of the
    /// sweep.
    pub sweep_motion: bool,
    /// Side lobes of the antenna: strong echoes appear in neighbouring azimuths.
    pub side_lobes: bool,
    /// Echoes in one resolution cell interfere, differently from every pose; off: their powers are
    /// added.
    pub speckle: bool,
    /// Smooth and tilted surfaces reflect in some directions only; off: all reflect in all
    /// directions.
    pub aspect: bool,
    /// Specular reflections of smooth walls at normal incidence, which move along with the sensor.
    pub highlights: bool,
    /// Scatterers have lobes, so their echoes fluctuate as the sensor passes.
    pub scintillation: bool,
    /// The beam has a height of a few degrees and the vehicle pitches and rolls, so returns come
    /// and go.
    pub elevation: bool,
    /// Walls hide what is behind them.
    pub occlusion: bool,
    /// Metal and glass fronts mirror strong reflectors: ghost targets.
    pub multipath: bool,
    /// Strong echoes raise the noise in all bins of their azimuth (phase noise), mostly next to
    /// them: streaks.
    pub phase_noise: bool,
    /// Multiple reflections between houses: a noise-like tail behind strong echoes, longest along a
    /// street.
    pub reverberation: bool,
    /// The transmitter rings in the first bins.
    pub ringing: bool,
    /// The vehicle's own roof and rear reflect.
    pub own_vehicle: bool,
    /// Road, verges and fields scatter back weakly, in patches.
    pub ground: bool,
    /// Thermal noise of the receiver, the same in all azimuths.
    pub noise: bool,
    /// Faint lines at fixed ranges, from clocks and power supplies inside the radar.
    pub spurious_lines: bool,
    /// Another radar interferes in some azimuths.
    pub interference: bool,
    /// Rain, fog and snow attenuate echoes and scatter back.
    pub weather: bool,
    /// Closing speed shifts the measured range.
    pub doppler: bool,
    /// The encoder's disc is eccentric and its counts jitter.
    pub encoder_wobble: bool,
    /// Some azimuths are lost and interpolated from their neighbours.
    pub dropped_azimuths: bool,
    /// The host loses azimuths as that of RADIATE: the columns behind them move up, and the last
    /// ones are of the scan before. Only for `output.format = "radiate"`. Default: as
    /// `simulation.realism` says.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lost_azimuths: Option<bool>,
    /// The road has hills: they tilt the vehicle and its beam, raise and lower what is seen, and
    /// where the ground rises into the beam it is bright. Default: as `simulation.realism` says.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub hills: Option<bool>,
    /// Things above or below the antenna are measured along the slant, too far. Default: as
    /// `simulation.realism` says.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub slant_range: Option<bool>,
    /// Leaves and twigs sway, so that their echoes are others in each scan. Default: as
    /// `simulation.realism` says.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sway: Option<bool>,
    /// Paths with one bounce off a smooth wall. Default: as `simulation.realism` says.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub one_bounce: Option<bool>,
    /// The mount vibrates, so the beam swings about the bearings that the encoder reports. Default:
    /// as `simulation.realism` says.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub vibration: Option<bool>,
    /// Dirt on the radome attenuates some sectors. Default: as `simulation.realism` says.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub dirt: Option<bool>,
    /// The radar's range offset, bins and eccentricity deviate from what its recording says.
    /// Default: as `simulation.realism` says.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub miscalibration: Option<bool>,
}

impl Effects {
    /// The effects that are on by default.
    pub const ALL: Self = Self::with(true);
    /// No effects: ideal points, seen through a beam and a range window.
    pub const NONE: Self = Self::with(false);

    /// The switches that `simulation.realism` decides, but for lost azimuths, which not all formats
    /// have.
    pub(crate) fn of_the_road(&mut self) -> [&mut Option<bool>; 7] {
        [
            &mut self.hills,
            &mut self.slant_range,
            &mut self.sway,
            &mut self.one_bounce,
            &mut self.vibration,
            &mut self.dirt,
            &mut self.miscalibration,
        ]
    }

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
            lost_azimuths: None,
            hills: None,
            slant_range: None,
            sway: None,
            one_bounce: None,
            vibration: None,
            dirt: None,
            miscalibration: None,
        }
    }
}

impl Default for Effects {
    fn default() -> Self {
        Self::ALL
    }
}

/// Returns whether a switch that realism decides is on.
pub(crate) fn is_on(switch: Option<bool>) -> bool {
    switch == Some(true)
}
