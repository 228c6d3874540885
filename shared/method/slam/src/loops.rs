use crate::estimation::{
    Constraint,
    places::{LoopCandidate, LoopOutcome},
};
use bytemuck::{Pod, Zeroable};
use gyre_geometry::UncertainMotion;
use gyre_storage::{LogMagic, Record};

use crate::exact::{ExactMotion, split};

/// A queried keyframe with its candidates, the most similar one first.
#[derive(Clone, Debug, PartialEq)]
pub struct Query {
    pub keyframe: usize,
    pub candidates: Vec<LoopCandidate>,
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Fixed {
    place: u64,
    similarity: f64,
    motion: ExactMotion,
    correlation: f64,
    searched: f64,
    runner_up: f64,
    chi_square: f64,
    outcome: u64,
}

const OUTCOMES: [LoopOutcome; 5] = [
    LoopOutcome::Accepted,
    LoopOutcome::LowCorrelation,
    LoopOutcome::Ambiguous,
    LoopOutcome::Undetermined,
    LoopOutcome::ContradictsOdometry,
];

impl Query {
    /// Returns the accepted loops as constraints from the found keyframe to the queried one, each
    /// with its candidate.
    pub fn loops(&self) -> impl Iterator<Item = (&LoopCandidate, Constraint)> {
        let accepted = |candidate: &&LoopCandidate| candidate.outcome == LoopOutcome::Accepted;
        self.candidates.iter().filter(accepted).map(|candidate| {
            let closing = Constraint::closing(candidate.place, self.keyframe, candidate.motion);
            (candidate, closing)
        })
    }
}

/// Little-endian: the keyframe, then the candidates.
impl Record for Query {
    const FILE: &'static str = "loops.log";
    const MAGIC: LogMagic = *b"gyre loops 1\n\0\0\0";

    fn encode(&self, bytes: &mut Vec<u8>) {
        bytes.extend_from_slice(&(self.keyframe as u64).to_le_bytes());
        for candidate in &self.candidates {
            let fixed = Fixed {
                place: candidate.place as u64,
                similarity: candidate.similarity,
                motion: ExactMotion::from(&candidate.motion),
                correlation: candidate.correlation,
                searched: candidate.searched,
                runner_up: candidate.runner_up,
                chi_square: candidate.chi_square,
                outcome: candidate.outcome as u64,
            };
            bytes.extend_from_slice(bytemuck::bytes_of(&fixed));
        }
    }

    /// `None` for an invalid length, and for an unknown verdict.
    fn decode(bytes: &[u8]) -> Option<Self> {
        let (keyframe, candidates) = split::<u64, Fixed>(bytes)?;
        let candidates = candidates.map(|fixed| fixed.candidate());
        Some(Self {
            keyframe: keyframe as usize,
            candidates: candidates.collect::<Option<_>>()?,
        })
    }
}

impl Fixed {
    fn candidate(&self) -> Option<LoopCandidate> {
        Some(LoopCandidate {
            place: self.place as usize,
            similarity: self.similarity,
            motion: UncertainMotion::from(&self.motion),
            correlation: self.correlation,
            searched: self.searched,
            runner_up: self.runner_up,
            chi_square: self.chi_square,
            outcome: *OUTCOMES.get(usize::try_from(self.outcome).ok()?)?,
        })
    }
}
