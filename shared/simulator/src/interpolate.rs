/// The value of a table at a place: linear between its entries, constant before the first and after
/// the last.
pub(crate) fn interpolate(table: &[(f64, f64)], at: f64) -> f64 {
    let next = table.partition_point(|entry| entry.0 <= at);
    match (next, table.get(next)) {
        (_, None) => table[table.len() - 1].1,
        (0, Some(first)) => first.1,
        (_, Some(after)) => {
            let before = table[next - 1];
            before.1 + (after.1 - before.1) * (at - before.0) / (after.0 - before.0)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_between_before_and_after_the_entries() {
        let table = [(1.0, 10.0), (3.0, 30.0), (4.0, 0.0)];
        let found = [-5.0, 1.0, 2.0, 3.5, 4.0, 99.0].map(|at| interpolate(&table, at));
        assert_eq!(found, [10.0, 10.0, 20.0, 15.0, 0.0, 0.0]);
    }
}
