//! Suggestions for misspelt names.

/// The candidate nearest to `name`, if at most a third of its letters differ.
#[must_use]
pub fn nearest<'a>(name: &str, candidates: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    if name.len() > MAX_LETTERS {
        return None;
    }
    let far = |candidate: &str| strsim::damerau_levenshtein(name, candidate);
    let (distance, candidate) = candidates.into_iter().map(|candidate| (far(candidate), candidate)).min()?;
    (3 * distance <= name.len().max(candidate.len())).then_some(candidate)
}

/// Longer names are not compared: no key has so many letters, and the comparison takes quadratic time.
const MAX_LETTERS: usize = 100;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_slip_is_recognised_and_another_word_is_not() {
        let names = ["wheel_base_m", "wheel_ratio", "name"];
        assert_eq!(nearest("wheelbase_m", names), Some("wheel_base_m"));
        assert_eq!(nearest("nmae", names), Some("name"));
        assert_eq!(nearest("colour", names), None);
        assert_eq!(nearest(&"wheel_base_m".repeat(1_000), names), None);
    }
}
