//! Table IIIa: how long mask, search and refinement take for a pair of scans, as far as a row has them, on one thread of this
//! process.
//!
//! - [`timer`]: a row at one size, again and again;
//! - [`learned`]: its mask.

mod learned;
mod timer;

use std::path::Path;

use gyre_radar::OwnedScan;
use serde::Serialize;

use super::{
    Sequence,
    models::{Model, Models, Note, note},
    peer::{Peer, PeerTimes},
    rows::{Line, Table, lines},
};
use gyre::Failure;
use timer::Timer;

/// Scans of the sequence whose searches are timed, in turn.
const SCANS: usize = 8;

/// The table and how it was measured.
#[derive(Debug, Serialize)]
pub struct Times {
    /// The sequence's folder.
    pub data: String,
    /// Its scans that were searched.
    pub scans: usize,
    /// Timed passes of each search, before the peer and after it together.
    pub passes: usize,
    /// The peer's version of PyTorch.
    pub peer_torch: Option<String>,
    /// Lines, size by size.
    pub lines: Vec<TimeLine>,
    /// Why rows are left out.
    pub left_out: Vec<Note>,
}

/// A row at one size.
#[derive(Debug, Serialize)]
pub struct TimeLine {
    /// Cells a side.
    pub n: usize,
    /// The row.
    pub row: &'static str,
    /// The network that masks.
    pub model: Option<Model>,
    /// What this program takes; `None` where it has no such row, or not the network for it.
    pub ours: Option<Median>,
    /// The peer's median, ms.
    pub peer_ms: Option<f64>,
    /// How many times longer the peer takes.
    pub peer_over_ours: Option<f64>,
    /// The paper's rates on a laptop and on a Jetson, Hz.
    pub paper_hz: [Option<f64>; 2],
}

/// A median time.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Median {
    /// Metres a cell.
    pub cell_m: f32,
    /// Angles that were tried, where all are.
    pub angles: Option<usize>,
    /// Of all passes, ms.
    pub ms: f64,
    /// Of the passes before and after the peer's, ms: alike on a quiet machine.
    pub halves_ms: [f64; 2],
}

/// Times all rows at all `sizes` on scans of `sequence`: `passes` passes, then the peer, then as many passes again.
pub fn measure(
    sequence: &Sequence,
    sizes: &[usize],
    passes: usize,
    models: &Models,
    peer: Option<&Peer>,
    out: &Path,
) -> Result<Times, Failure> {
    let scans = sequence.scans(SCANS)?;
    let angles = sequence.configuration(&[])?.exhaustive.candidates();
    let both = 2 * passes;
    let mut times = Times {
        data: sequence.data.display().to_string(),
        scans: scans.len(),
        passes: both,
        peer_torch: None,
        lines: Vec::new(),
        left_out: Vec::new(),
    };
    let at_size = |&n: &usize| Ok((n, timers(sequence, n, models, &scans, &mut times.left_out)?));
    let sizes: Result<Vec<_>, Failure> = sizes.iter().map(at_size).collect();
    for (n, mut timed) in sizes? {
        half(&mut timed, passes)?;
        let report = out.join(format!("peer-{n}.json"));
        let theirs = peer
            .map(|peer| peer.time(n, both, angles, &report))
            .transpose()?;
        half(&mut timed, passes)?;
        times.lines.extend(
            timed
                .into_iter()
                .map(|(line, timer)| TimeLine::new(n, &line, timer, theirs.as_ref())),
        );
        times.peer_torch = theirs.map(|theirs| theirs.torch);
    }
    Ok(times)
}

/// The rows at one size. Where the network of one is missing there is only what the papers and the peer say, if they do.
fn timers(
    sequence: &Sequence,
    n: usize,
    models: &Models,
    scans: &[OwnedScan],
    left_out: &mut Vec<Note>,
) -> Result<Vec<(Line, Option<Timer>)>, Failure> {
    let mut timed = Vec::new();
    for line in lines(Table::Times) {
        let mask = line.row.and_then(|row| row.mask.as_ref());
        let timer = match (
            line.row,
            mask.map(|mask| models.find(mask, n, None)).transpose(),
        ) {
            (Some(row), Ok(model)) => Some(Timer::new(sequence, row, model, n, scans)?),
            (_, Err(reason)) => {
                note(left_out, reason, format!("{} at {n}", line.name));
                None
            }
            (None, Ok(_)) => None,
        };
        if timer.is_some() || line.figures.is_some() {
            timed.push((line, timer));
        }
    }
    Ok(timed)
}

fn half(timed: &mut [(Line, Option<Timer>)], passes: usize) -> Result<(), Failure> {
    timed
        .iter_mut()
        .filter_map(|(_, timer)| timer.as_mut())
        .try_for_each(|timer| timer.half(passes))
}

impl TimeLine {
    fn new(n: usize, line: &Line, timer: Option<Timer>, peer: Option<&PeerTimes>) -> Self {
        let model = timer.as_ref().and_then(|timer| timer.model.clone());
        let ours = timer.map(Timer::median);
        let peer_ms = line.peer.and_then(|row| peer?.median_ms(n, row));
        Self {
            n,
            row: line.name,
            model,
            ours,
            peer_ms,
            peer_over_ours: ours.and_then(|ours| Some(peer_ms? / ours.ms)),
            paper_hz: line.figures.map_or([None; 2], |figures| figures.hz(n)),
        }
    }
}
