use crate::estimation::Constraint;
use bytemuck::{Pod, Zeroable};
use gyre_geometry::UncertainMotion;
use gyre_storage::{LogMagic, Record};

use crate::exact::{ExactMotion, split};

#[derive(Clone, Debug, PartialEq)]
pub struct LoopCandidate {
    pub place: usize,
    pub similarity: f64,
    /// The pose of the queried keyframe in the frame of the found one, with its covariance; a
    /// covariance of zero if the two were not aligned.
    pub motion: UncertainMotion,
    /// Masked correlation of the submaps at the motion; the search's correlation without an
    /// alignment.
    pub correlation: f64,
    /// Correlation on whole cells at the candidate's angle, of the best translation and of the
    /// runner-up: another translation, or the best at the other angle. Their difference is the
    /// margin.
    pub searched: f64,
    pub runner_up: f64,
    /// Chi-square of the motion against the odometry, with three degrees of freedom; NaN if it was
    /// rejected before.
    pub chi_square: f64,
    pub outcome: LoopOutcome,
}

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

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LoopOutcome {
    /// The two submaps show the same place.
    Accepted,
    /// The correlation is below 0.65.
    LowCorrelation,
    /// Another motion correlates nearly as well: less than 0.1 below.
    Ambiguous,
    Undetermined,
    /// The motion contradicts the odometry between the two keyframes.
    ContradictsOdometry,
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
