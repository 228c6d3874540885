use pathfinding::kuhn_munkres::kuhn_munkres_min;
use pathfinding::matrix::Matrix;

/// Costs are compared in thousandths.
const SCALE: f64 = 1000.0;

/// Assigns columns to rows, each to one at most, so that as many as possible of the allowed pairs
/// are made, and of all such assignments the sum of the costs is least (Kuhn and Munkres).
/// `costs` has a row for each track and a column for each measurement; `None` is not allowed.
/// Returns the column of each row.
pub fn assign(costs: &[Vec<Option<f64>>]) -> Vec<Option<usize>> {
    let columns = costs.first().map_or(0, Vec::len);
    if columns == 0 {
        return vec![None; costs.len()];
    }
    let scaled = |cost: f64| (cost.clamp(-1e6, 1e6) * SCALE).round() as i64;
    let all = costs.iter().flatten().flatten();
    let largest = all.map(|cost| scaled(*cost).abs()).max().unwrap_or(0);
    // One pair that is not made costs more than all that are.
    let none = (2 * largest + 1) * (costs.len() as i64 + 1);
    // A row of its own for each track that gets nothing: rows must not exceed columns.
    let rows = costs.iter().map(|row| {
        let pairs = row.iter().map(|cost| cost.map_or(2 * none, scaled));
        pairs
            .chain(std::iter::repeat_n(none, costs.len()))
            .collect::<Vec<i64>>()
    });
    let Ok(matrix) = Matrix::from_rows(rows) else {
        return vec![None; costs.len()];
    };
    let (_, assigned) = kuhn_munkres_min(&matrix);
    let allowed = |(row, column): (usize, usize)| {
        (column < columns && costs[row][column].is_some()).then_some(column)
    };
    assigned.into_iter().enumerate().map(allowed).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn value(costs: &[Vec<Option<f64>>], columns: &[Option<usize>]) -> (usize, f64) {
        let pairs = columns.iter().enumerate().filter_map(|(row, column)| {
            column.map(|column| costs[row][column].unwrap_or(f64::INFINITY))
        });
        let pairs: Vec<f64> = pairs.collect();
        (pairs.len(), pairs.iter().sum())
    }

    fn all(rows: usize, columns: usize) -> Vec<Vec<Option<usize>>> {
        (0..rows).fold(vec![Vec::new()], |partial, _| {
            let mut longer = Vec::new();
            for start in partial {
                for next in (0..columns).map(Some).chain([None]) {
                    if next.is_none() || !start.contains(&next) {
                        longer.push(start.iter().copied().chain([next]).collect());
                    }
                }
            }
            longer
        })
    }

    proptest! {
        #[test]
        fn no_other_assignment_makes_more_pairs_or_costs_less(
            costs in (1usize..4, 1usize..4).prop_flat_map(|(rows, columns)| {
                let cost = prop::option::of((-50..50i32).prop_map(f64::from));
                prop::collection::vec(prop::collection::vec(cost, columns), rows)
            }),
        ) {
            let (pairs, cost) = value(&costs, &assign(&costs));
            for other in all(costs.len(), costs[0].len()) {
                let (other_pairs, other_cost) = value(&costs, &other);
                if other_cost.is_finite() {
                    prop_assert!(
                        (pairs, -cost) >= (other_pairs, -other_cost),
                        "{pairs} pairs for {cost}, not {other_pairs} for {other_cost}"
                    );
                }
            }
        }
    }

    #[test]
    fn nothing_is_assigned_to_nothing() {
        assert_eq!(assign(&[]), []);
        assert_eq!(assign(&[vec![], vec![]]), [None, None]);
    }
}
