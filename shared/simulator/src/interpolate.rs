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
