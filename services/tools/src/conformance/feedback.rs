//! Masking: the motion of item `seq - lag` comes from `motion`, or after a restart from `pose`. The
//! stage waits for it, and for no later one, or no scan would be admitted any more.

use gyre_configuration::terminal::Failure;
use gyre_contract::{Masked, Message, Motion, Scan};

use crate::conformance::{
    Examination,
    report::Rule,
    session::{Pace, Session},
};

impl Examination<'_> {
    pub(crate) fn feedback(&mut self) -> Result<(), Failure> {
        if self.context.test.candidate.manifest.window.lag == 0 {
            return Ok(());
        }
        self.motions_of_the_search()?;
        self.motions_of_poses()
    }

    /// Returns whether any of its rasters is motion-compensated. One that compensates nothing need
    /// not wait.
    fn compensates(&self) -> bool {
        let mut headers = self.outputs.iter().map(|it| it.header::<Masked>());
        headers.any(|header| header.is_ok_and(|header| header.compensated == 1))
    }

    /// A window of scans before the first pose: all motions come from the search, one after the
    /// other.
    fn motions_of_the_search(&mut self) -> Result<(), Failure> {
        let (compensates, end) = (self.compensates(), self.context.reference.end());
        let (mut session, _) = self.begin("motions", Pace::Hold, u64::MAX)?;
        session.findings.checked(Rule::WaitsForMotion);
        let (limit, window) = (
            session.arguments().patience_s,
            session.harness.rig.manifest().window,
        );
        let (lag, scans) = (window.lag as u64, (window.scans as u64).min(end));
        (0..scans).try_for_each(|seq| session.send_inputs(seq))?;
        for motion in 0..scans.saturating_sub(lag) {
            session.feed(&[Motion::TOPIC], motion)?;
            let answered = motion + lag;
            let waited = session.wait(limit, |session| session.has(answered))?;
            session.findings.require(Rule::WaitsForMotion, waited.is_done(), || {
                format!("it has the motion of item {motion} from `motion`, and sends nothing about item {answered}: it waits for more than the motion {lag} items before")
            });
            if !compensates || !waited.is_done() {
                continue;
            }
            session.rest()?;
            let early = session.has(answered + 1);
            session.findings.require(Rule::WaitsForMotion, !early, || {
                format!("it sent item {} before the motion of item {} was there: the result depends on which is faster", answered + 1, motion + 1)
            });
        }
        let when = "when all motions come from `motion`";
        Ok(session.compare(0.., Rule::WaitsForMotion, when)?)
    }

    /// A start in the middle of the stream: the motions up to the newest pose come with the poses
    /// alone.
    fn motions_of_poses(&mut self) -> Result<(), Failure> {
        let reference = self.context.reference;
        let mut session = Session::open(self.context, "poses", &mut self.findings)?;
        let (window, newest) = (session.harness.rig.manifest().window, reference.end() / 2);
        session.restart_inputs(newest)?;
        session.pace = Pace::Hold;
        session.starts()?;
        session.harness.connect()?;
        let last = (newest + window.lag as u64).min(newest + window.scans as u64);
        let first = (newest + 1).saturating_sub(window.look_back as u64);
        let last = last.min(reference.topic(Scan::TOPIC).len() as u64 - 2);
        (first..=last).try_for_each(|seq| session.send_inputs(seq))?;
        let limit = session.arguments().patience_s;
        let waited = session.wait(limit, |session| session.has(last))?;
        session.findings.require(Rule::WaitsForMotion, waited.is_done(), || {
            format!("after a restart it has the motions up to item {newest} from `pose`, and sends nothing about item {last}")
        });
        let when = "when the motions come with the poses, as after a restart";
        Ok(session.compare(0.., Rule::WaitsForMotion, when)?)
    }
}
