//! Interpolation in tables of measured values.

/// The value of a table at a place: linear between its entries, constant before the first and after
/// the last. `None` for an empty table.
pub(crate) fn interpolate(table: &[(f64, f64)], at: f64) -> Option<f64> {
    let next = table.partition_point(|entry| entry.0 <= at);
    let (Some(before), Some(after)) = (table.get(next.saturating_sub(1)), table.get(next)) else {
        return table.last().map(|last| last.1);
    };
    if next == 0 {
        return Some(after.1);
    }
    Some(before.1 + (after.1 - before.1) * (at - before.0) / (after.0 - before.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_between_before_and_after_the_entries() {
        let table = [(1.0, 10.0), (3.0, 30.0), (4.0, 0.0)];
        let found = [-5.0, 1.0, 2.0, 3.5, 4.0, 99.0].map(|at| interpolate(&table, at));
        assert_eq!(
            found,
            [
                Some(10.0),
                Some(10.0),
                Some(20.0),
                Some(15.0),
                Some(0.0),
                Some(0.0)
            ]
        );
        assert_eq!(interpolate(&[], 1.0), None);
    }
}
