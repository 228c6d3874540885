//! The largest load that passes: doubled until one fails, then bisected.

/// Returns the largest level from `first` on that passes, or `None` if the first one fails. No level above `most` is tried. `grow` says
/// which level to try after one that has passed.
///
/// # Errors
/// What `passes` returns.
pub fn largest<E>(
    first: u32,
    most: u32,
    grow: impl Fn(u32) -> u32,
    mut passes: impl FnMut(u32) -> Result<bool, E>,
) -> Result<Option<u32>, E> {
    let (mut low, mut high) = (None, first);
    while passes(high)? {
        low = Some(high);
        let next = grow(high).min(most);
        if next <= high {
            return Ok(low);
        }
        high = next;
    }
    let Some(mut low) = low else {
        return Ok(None);
    };
    while high - low > 1 {
        let middle = low + (high - low) / 2;
        match passes(middle)? {
            true => low = middle,
            false => high = middle,
        }
    }
    Ok(Some(low))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The result for a limit, and the levels that were tried.
    fn found(limit: u32, most: u32) -> (Option<u32>, Vec<u32>) {
        let mut tried = Vec::new();
        let passes = |level| {
            tried.push(level);
            Ok::<_, ()>(level <= limit)
        };
        let found = largest(1, most, |level| level * 2, passes);
        (found.ok().flatten(), tried)
    }

    #[test]
    fn the_largest_level_that_passes_is_found() {
        for limit in 1..40 {
            assert_eq!(found(limit, 1000).0, Some(limit));
        }
        assert_eq!(found(5, 1000).1, [1, 2, 4, 8, 6, 5]);
    }

    #[test]
    fn nothing_is_tried_above_the_most_and_a_first_one_that_fails_is_the_last() {
        assert_eq!(found(100, 6), (Some(6), vec![1, 2, 4, 6]));
        assert_eq!(found(0, 6), (None, vec![1]));
    }
}
