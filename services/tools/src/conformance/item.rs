//! The item of a message that a stage has sent: the fields copied from its input, and its own hop.

use gyre_contract::{Item, StageId, flag};

/// Returns the fields of an output's item that a stage has to copy from its input and has not.
pub(crate) fn not_copied(stage: StageId, input: &Item, output: &Item) -> Vec<&'static str> {
    let mut hops = output.hops;
    hops[stage as usize] = input.hops[stage as usize];
    let places = Item::lost_azimuths;
    let passes_flags = output.flags & !flag::SYNC == input.flags & !flag::SYNC;
    let fields = [
        ("scan", output.scan == input.scan),
        ("previous_scan", output.previous_scan == input.previous_scan),
        ("published", output.published == input.published),
        ("generation", output.generation == input.generation),
        ("numbered_from", output.numbered_from == input.numbered_from),
        ("stamp_ns", output.stamp_ns == input.stamp_ns),
        ("due_ns", output.due_ns == input.due_ns),
        ("flags", passes_flags),
        (
            "lost (the places of lost azimuths)",
            stage <= StageId::Masking || places(output) == places(input),
        ),
        ("hops (the stamps of the stages before)", hops == input.hops),
    ];
    let missing = fields.into_iter().filter(|(_, copied)| !copied);
    missing.map(|(field, _)| field).collect()
}

/// Returns the fault in the time stamps of a stage's own hop; `None` if they are in order, and
/// between the time of sending the input (if known) and the time of reading the output, both
/// CLOCK_MONOTONIC, ns.
pub(crate) fn wrong_stamps(
    stage: StageId,
    output: &Item,
    sent_ns: Option<i64>,
    read_ns: i64,
) -> Option<String> {
    let (seq, hop) = (output.seq, output.hops[stage as usize]);
    let stamps = [
        ("received_ns", hop.received_ns),
        ("started_ns", hop.started_ns),
        ("finished_ns", hop.finished_ns),
        ("published_ns", hop.published_ns),
    ];
    if let Some((name, _)) = stamps.iter().find(|(_, stamp)| *stamp == 0) {
        return Some(format!("item {seq}: {name} of its own hop is 0"));
    }
    if let Some(pair) = stamps.windows(2).find(|pair| pair[0].1 > pair[1].1) {
        return Some(format!("item {seq}: {} is after {}", pair[0].0, pair[1].0));
    }
    let is_between =
        hop.published_ns <= read_ns && sent_ns.is_none_or(|sent_ns| hop.received_ns >= sent_ns);
    (!is_between).then(|| {
        format!(
            "item {seq}: its stamps are not between those of its input and of its reader; they are to be CLOCK_MONOTONIC, ns"
        )
    })
}

pub(crate) fn work_ns(stage: StageId, item: &Item) -> i64 {
    let hop = item.hops[stage as usize];
    hop.finished_ns.saturating_sub(hop.started_ns)
}
