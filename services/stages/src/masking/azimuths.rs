//! The lost azimuths of each scan, found from the scan before. A restarted masking continues from
//! the record in the poses.

use gyre_masking::Sweep;
use gyre_radar::{LostAzimuthFinder, LostAzimuths, lost::stale_rows};

#[derive(Default)]
pub struct Azimuths {
    finder: LostAzimuthFinder,
    /// The scan that it has found them in last.
    last: Option<(u64, LostAzimuths)>,
}

impl Azimuths {
    /// Returns where azimuths of a sweep were lost: the next one, or the last one again. `known` is
    /// the finding of an earlier masking. Where a chain of motions `starts`, nothing is known of
    /// the scan before.
    pub fn lost(
        &mut self,
        sweep: &Sweep<'_>,
        known: Option<LostAzimuths>,
        starts: bool,
    ) -> LostAzimuths {
        if let Some((number, lost)) = self.last
            && number == sweep.number
        {
            return lost;
        }
        if starts {
            self.finder.reset();
        }
        // Another masking's finding about this scan, if it has found all.
        let known = known.filter(|known| known.count() == stale_rows(&sweep.scan));
        let lost = match known {
            Some(known) => {
                self.finder.set_previous(&sweep.scan, &known);
                known
            }
            None => self.finder.find(&sweep.scan, sweep.twist),
        };
        self.last = Some((sweep.number, lost));
        lost
    }

    pub fn last(&self) -> LostAzimuths {
        self.last.map(|(_, lost)| lost).unwrap_or_default()
    }
}
