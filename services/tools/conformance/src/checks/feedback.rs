//! Masking: the motion of item `seq - lag` comes from `motion`, or after a restart from `pose`. The stage waits for it, and for no later
//! one, or no scan would be admitted any more.

use gyre_messages::{Masked, Message, Scan};

use super::{Examination, compare, stream::starts};
use crate::{
    ConformanceError,
    rule::Rule,
    session::{Pace, Session, Waited},
};

impl Examination<'_> {
    pub(super) fn feedback(&mut self) -> Result<(), ConformanceError> {
        if self.subject.manifest.window.lag == 0 {
            return Ok(());
        }
        self.motions_of_the_search()?;
        self.motions_of_poses()
    }

    /// Whether any of its rasters is motion-compensated. One that compensates nothing need not wait.
    fn compensates(&self) -> bool {
        self.outputs.iter().any(|it| {
            it.header::<Masked>()
                .is_ok_and(|header| header.compensated == 1)
        })
    }

    /// A window of scans before the first pose: all motions come from the search, one after the other.
    fn motions_of_the_search(&mut self) -> Result<(), ConformanceError> {
        let compensates = self.compensates();
        let rig = self.subject.rig(self.signals, "motions")?;
        let mut session = Session::open(self.subject, &rig, self.tape, &mut self.findings)?;
        session.pace = Pace::Hold;
        starts(&mut session)?;
        session.connect_all()?;
        session.findings.checked(Rule::WaitsForMotion);
        let demands = &self.subject.demands;
        let (lag, scans) = (
            rig.manifest().window.lag as u64,
            rig.manifest().window.scans as u64,
        );
        let scans = scans.min(self.tape.end());
        (0..scans).try_for_each(|seq| session.send_inputs(seq))?;
        for motion in 0..scans.saturating_sub(lag) {
            session.send_motion(motion)?;
            let answered = motion + lag;
            let has = |session: &Session<'_>| session.about(answered).next().is_some();
            let waited = session.wait(demands.patience, has)?;
            session.findings.require(
                Rule::WaitsForMotion,
                matches!(waited, Waited::Done),
                || format!("it has the motion of item {motion} from `motion`, and sends nothing about item {answered}: it waits for more than the motion {lag} items before"),
            );
            if !compensates || !matches!(waited, Waited::Done) {
                continue;
            }
            session.rest(demands.quiet)?;
            let early = session.about(answered + 1).next().is_some();
            session.findings.require(Rule::WaitsForMotion, !early, || {
                format!("it sent item {} before the motion of item {} was there: the result depends on which is faster", answered + 1, motion + 1)
            });
        }
        let all = 0..session.outputs.len();
        let when = "when all motions come from `motion`";
        compare(
            &mut session,
            &self.reference,
            all,
            Rule::WaitsForMotion,
            when,
        )
    }

    /// A start in the middle of the stream: the motions up to the newest pose come with the poses alone.
    fn motions_of_poses(&mut self) -> Result<(), ConformanceError> {
        let rig = self.subject.rig(self.signals, "poses")?;
        let mut session = Session::open(self.subject, &rig, self.tape, &mut self.findings)?;
        let (window, newest) = (rig.manifest().window, self.tape.end() / 2);
        session.restart_inputs(newest)?;
        session.pace = Pace::Hold;
        starts(&mut session)?;
        session.connect_all()?;
        let last = (newest + window.lag as u64).min(newest + window.scans as u64);
        let first = (newest + 1).saturating_sub(window.look_back as u64);
        let last = last.min(self.tape.topic(Scan::TOPIC).len() as u64 - 2);
        (first..=last).try_for_each(|seq| session.send_inputs(seq))?;
        let has = |session: &Session<'_>| session.about(last).next().is_some();
        let waited = session.wait(self.subject.demands.patience, has)?;
        session.findings.require(
            Rule::WaitsForMotion,
            matches!(waited, Waited::Done),
            || format!("after a restart it has the motions up to item {newest} from `pose`, and sends nothing about item {last}"),
        );
        let all = 0..session.outputs.len();
        let when = "when the motions come with the poses, as after a restart";
        compare(
            &mut session,
            &self.reference,
            all,
            Rule::WaitsForMotion,
            when,
        )
    }
}
