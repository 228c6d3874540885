//! A start where the supervisor has created nothing: what exists afterwards, the program has created.

use std::time::Instant;

use gyre_supervise::Scheduling;

use super::Examination;
use crate::{ConformanceError, rule::Rule, tape::LOOK};

impl Examination<'_> {
    pub(super) fn start_without_topics(&mut self) -> Result<(), ConformanceError> {
        let subject = self.subject;
        let rig = subject.empty_rig(self.signals, "absence")?;
        let mut process = rig.start(
            subject.stage.name(),
            &subject.command,
            &Scheduling::default(),
        )?;
        let since = Instant::now();
        while process.death().is_none() && rig.services().is_empty() {
            // It may wait for its topics as long as it likes.
            if since.elapsed() > subject.demands.patience {
                break;
            }
            if rig.sleep(&[], LOOK)? {
                return Err(ConformanceError::Interrupted);
            }
        }
        let created = rig.services().len();
        self.findings
            .require(Rule::CreatesNothing, created == 0, || {
                "it creates its topics where there are none: open them, so that the supervisor's sizes hold".to_owned()
            });
        process.kill()?;
        Ok(())
    }
}
