//! The name that was probably meant by an unknown name.

#![cfg(feature = "declare")]

/// The candidate that was probably meant by `word`. A third of the letters may differ, case does not count, and a
/// beginning of three letters is enough.
#[must_use]
pub fn did_you_mean<'c>(word: &str, candidates: &[&'c str]) -> Option<&'c str> {
    let word = word.to_lowercase();
    let close = candidates.iter().filter_map(|candidate| {
        let known = candidate.to_lowercase();
        let length = word.chars().count().max(known.chars().count());
        let distance = strsim::osa_distance(&word, &known);
        let begun = word.len() >= 3 && known.starts_with(&word);
        (distance * 3 <= length || begun).then_some((distance, *candidate))
    });
    close.min_by_key(|(distance, _)| *distance).map(|(_, candidate)| candidate)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slips_are_recognised_and_other_words_are_not() {
        let known = ["threshold", "probability", "type", "ekf"];
        assert_eq!(did_you_mean("treshold", &known), Some("threshold"));
        assert_eq!(did_you_mean("Tpye", &known), Some("type"));
        assert_eq!(did_you_mean("prob", &known), Some("probability"));
        assert_eq!(did_you_mean("sigma", &known), None);
        assert_eq!(did_you_mean("x", &["y"]), None);
    }
}
