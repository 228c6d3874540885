use std::ops::Range;

use super::antenna::Antenna;
use super::echoes::{Echo, NEGLIGIBLE_POWER};
use super::sweep_poses::{MARGIN, SweepPoses};

#[derive(Clone, Debug, Default)]
pub(super) struct BeamIndex {
    spans: Vec<Range<usize>>,
    /// The echoes of azimuth `a` are `numbers[starts[a]..starts[a + 1]]`.
    starts: Vec<usize>,
    numbers: Vec<u32>,
}

impl BeamIndex {
    pub fn sort(&mut self, echoes: &[Echo], antenna: &Antenna, sweep_poses: &SweepPoses) {
        let (azimuths, step_rad) = (sweep_poses.azimuths, sweep_poses.step_rad);
        let span = |echo: &Echo| {
            let reach =
                antenna.reach_rad((NEGLIGIBLE_POWER.sqrt() / echo.amplitude).min(1.0)) / step_rad;
            let reach = reach.min(MARGIN as f64);
            let (first, last) = (
                (echo.azimuth - reach).ceil(),
                (echo.azimuth + reach).floor(),
            );
            (first.max(0.0) as usize)..((last + 1.0).clamp(0.0, azimuths as f64) as usize)
        };
        self.spans.clear();
        self.spans.extend(echoes.iter().map(span));
        self.starts.clear();
        self.starts.resize(azimuths + 1, 0);
        self.spans
            .iter()
            .cloned()
            .flatten()
            .for_each(|azimuth| self.starts[azimuth] += 1);
        let mut end = 0;
        for start in &mut self.starts {
            end += *start;
            *start = end;
        }
        self.numbers.clear();
        self.numbers.resize(end, 0);
        // Backwards, so that each azimuth's end moves down to its start.
        for (number, span) in self.spans.iter().enumerate().rev() {
            for azimuth in span.clone() {
                self.starts[azimuth] -= 1;
                self.numbers[self.starts[azimuth]] = number as u32;
            }
        }
    }

    pub fn echoes(&self, azimuth: usize) -> &[u32] {
        &self.numbers[self.starts[azimuth]..self.starts[azimuth + 1]]
    }
}
