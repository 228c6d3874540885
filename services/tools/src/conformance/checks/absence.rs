//! A start where the supervisor has created nothing: all that exists afterwards is the program's.

use std::time::Instant;

use gyre_supervise::Scheduling;

use super::Examination;
use crate::conformance::{ProgramError, reference::POLL_PERIOD, rule::Rule};

impl Examination<'_> {
    pub(super) fn start_without_topics(&mut self) -> Result<(), ProgramError> {
        let test = self.context.test;
        let rig = test.rig("absence", self.context.signals, false)?;
        let command = &test.candidate.command;
        let mut process = rig.start(self.stage().name(), command, &Scheduling::default())?;
        let since = Instant::now();
        // It may wait for its topics as long as it likes.
        let mut has_created = !rig.services().is_empty();
        while process.death().is_none()
            && !has_created
            && since.elapsed() <= test.demands.item_timeout
        {
            if rig.sleep(&[], POLL_PERIOD)? {
                return Err(ProgramError::Interrupted);
            }
            has_created = !rig.services().is_empty();
        }
        self.findings
            .require(Rule::CreatesNothing, !has_created, || {
                "it creates its topics where there are none: open them, so that the supervisor's sizes hold".to_owned()
            });
        Ok(process.kill()?)
    }
}
