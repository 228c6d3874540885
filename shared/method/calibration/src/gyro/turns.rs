/// Time over which a turn is taken, s: longer than a scan, to average the noise of motions.
pub(crate) const BASELINE_S: f64 = 1.0;

#[derive(Clone, Copy, Debug)]
pub(crate) struct Turn {
    /// Start and end, s since the first scan.
    pub(crate) from_s: f64,
    pub(crate) to_s: f64,
    /// The angle, counter-clockwise, rad; or the distance ahead, m.
    pub(crate) amount: f64,
}

/// The turns from each scan to the first that is [`BASELINE_S`] later, from those since the scan
/// before; `starts` marks where the chain of motions restarts.
pub(crate) fn turns(stamps: &[i64], steps: &[f64], starts: &[bool]) -> Vec<Turn> {
    let since = |k: usize| (stamps[k] - stamps[0]) as f64 * 1e-9;
    let ends = (0..stamps.len()).map(|from| {
        let wanted_s = since(from) + BASELINE_S - 1e-3;
        let apart = (from..stamps.len()).position(|to| since(to) >= wanted_s);
        apart.map(|scans| from + scans)
    });
    let unbroken = |(from, to): &(usize, usize)| !starts[from + 1..=*to].contains(&true);
    ends.enumerate()
        .filter_map(|(from, to)| Some((from, to?)))
        .filter(unbroken)
        .map(|(from, to)| Turn {
            from_s: since(from),
            to_s: since(to),
            amount: steps[from + 1..=to].iter().sum(),
        })
        .collect()
}
