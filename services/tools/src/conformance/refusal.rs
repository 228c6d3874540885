//! Inputs that break the contract: the program ends with exit code 3 and a sentence, and sends
//! nothing about them.

use gyre_client::RunError;
use gyre_configuration::terminal::Failure;
use gyre_contract::{Masked, Message, Motion, Pose, Rotation, Scan};
use gyre_supervise::rig::Recorded;

use crate::conformance::{Examination, report::Rule, result::floats, session::Pace};

const WRONG: u64 = 2;

impl Examination<'_> {
    pub(crate) fn refusals(&mut self) -> Result<(), Failure> {
        let (reference, topics) = (self.context.reference, self.context.test.candidate.topics());
        for topic in topics.inputs() {
            let Some(valid) = reference.get(topic, WRONG) else {
                continue;
            };
            let mut wrong = malformed(topic, valid)?;
            if topics.forward.contains(&topic) {
                let later = reference.get(topic, WRONG + 1);
                wrong.extend(later.map(|later| ("a sequence gap", later.clone())));
            }
            for (i, wrong) in wrong.iter().enumerate() {
                self.context
                    .test
                    .announce(&format!("`{topic}` with {}", wrong.0));
                // Each in a folder of its own, so that no state is kept from one to the next.
                self.refusal(&format!("refusal-{topic}-{i}"), topic, wrong)?;
            }
        }
        Ok(())
    }

    fn refusal(
        &mut self,
        name: &str,
        topic: &'static str,
        (fault, message): &Malformed,
    ) -> Result<(), Failure> {
        let (mut session, true) = self.begin(name, Pace::Window, WRONG)? else {
            return Ok(());
        };
        if !session.reach(WRONG - 1)?.is_done() {
            // Other scenarios judge its work on valid items.
            return Ok(());
        }
        session.pace = Pace::Hold;
        let forward = session.harness.topics.forward.clone();
        for other in forward.iter().filter(|other| **other != topic) {
            session.feed(&[*other], WRONG)?;
        }
        session.harness.feed(topic, message)?;
        let ending = session.ended_within(session.arguments().patience_s)?;
        let is_sent = forward.contains(&topic) && session.has(WRONG);
        session
            .findings
            .require(Rule::RefusesMalformed, !is_sent, || {
                format!("it sent item {WRONG}, although its input on `{topic}` had {fault}")
            });
        let code = i32::from(RunError::TRANSIENT);
        let item = format!("an item on `{topic}` with {fault}");
        let breach = match ending {
            None => format!("it continues after {item}"),
            Some(death) if death.code != Some(code) => {
                format!("{item}: {death}, and the code has to be {code}")
            }
            Some(death) if death.last_output.is_none() => {
                format!("{item}: it writes nothing to standard error")
            }
            Some(_) => return Ok(()),
        };
        session.findings.broken(Rule::RefusesMalformed, breach);
        Ok(())
    }
}

/// A message that no stage may send, after the name of its fault.
type Malformed = (&'static str, Recorded);

const SHORTER: &str = "a payload shorter than its header states";

/// Returns messages of a topic that differ from a valid one by one field that breaks its rule.
fn malformed(topic: &str, valid: &Recorded) -> Result<Vec<Malformed>, RunError> {
    let item = valid.item();
    let mut unknown = item;
    unknown.flags |= 16;
    let mut late = item;
    late.previous_scan = item.scan + 1;
    let mut all = vec![
        ("an unknown flag", valid.about(&unknown)),
        ("a previous scan after its scan", valid.about(&late)),
    ];
    all.extend(match topic {
        Scan::TOPIC => changes::<Scan>(
            valid,
            &[
                ("an angle that is NaN", &|h| h.azimuth_rad[3] = f32::NAN),
                (SHORTER, &|h| h.first_byte = u32::MAX),
            ],
        )?,
        Masked::TOPIC => masks(valid)?,
        Rotation::TOPIC => changes::<Rotation>(
            valid,
            &[
                ("an angle that is NaN", &|h| h.rotation.angle_rad = f64::NAN),
                ("a negative variance", &|h| h.rotation.variance_rad2 = -1.0),
            ],
        )?,
        Pose::TOPIC => changes::<Pose>(valid, &[("a pose that is NaN", &|h| h.x_m = f64::NAN)])?,
        // The topic `refined` has the same header.
        _ => changes::<Motion>(
            valid,
            &[
                ("a motion that is NaN", &|h| h.motion.x_m = f64::NAN),
                ("a covariance that is none", &|h| {
                    h.motion.covariance[0] = -1.0
                }),
            ],
        )?,
    });
    Ok(all)
}

type Change<'a, M> = (&'static str, &'a dyn Fn(&mut <M as Message>::Header));

fn changes<M: Message<Header: Copy>>(
    valid: &Recorded,
    changes: &[Change<'_, M>],
) -> Result<Vec<Malformed>, RunError> {
    let changed = changes.iter().map(|(name, change)| {
        let mut header = valid.header::<M>()?;
        change(&mut header);
        Ok((*name, valid.with::<M>(&header)))
    });
    changed.collect()
}

fn masks(valid: &Recorded) -> Result<Vec<Malformed>, RunError> {
    let mut all = changes::<Masked>(
        valid,
        &[
            ("a velocity that is NaN", &|h| h.twist[0] = f32::NAN),
            ("rasters of another size", &|h| h.n += 1),
            (SHORTER, &|h| h.points = u32::MAX),
        ],
    )?;
    let header = valid.header::<Masked>()?;
    let mut values = floats(&valid.payload);
    if !header.points(&values).unwrap_or_default().is_empty() {
        let blocks = (header.n as usize * header.n as usize).div_ceil(16) * 16;
        values[blocks * header.rasters as usize + 2] = f32::NAN;
        let message = Recorded::of::<Masked>(&header, bytemuck::cast_slice(&values), 0);
        all.push(("a point that is NaN", message));
    }
    Ok(all)
}
