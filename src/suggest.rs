//! "Did you mean …?": the known name nearest to a mistyped one.

/// Names at most this share of the longer one's length apart (in edits) count as a slip of the pen: `heigth-mm`, `j750-27`.
/// One edit is always allowed, so that two-letter names can be mistyped too.
const MAX_EDITS_PER_CHAR: f64 = 0.34;

/// The name in `known` nearest to `word` by Damerau–Levenshtein distance, case ignored; the first one on a tie,
/// `None` when nothing is near.
pub(crate) fn suggest<'a>(word: &str, known: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    // Far longer words cannot be near; measuring them would cost the product of the lengths.
    const LONGEST: usize = 64;
    if word.len() > LONGEST {
        return None;
    }
    let word = word.to_lowercase();
    let mut best: Option<(usize, &str)> = None;
    for name in known {
        let edits = strsim::damerau_levenshtein(&word, &name.to_lowercase());
        let length = word.chars().count().max(name.chars().count());
        let allowed = ((length as f64 * MAX_EDITS_PER_CHAR) as usize).max(1);
        if edits <= allowed && best.is_none_or(|(fewest, _)| edits < fewest) {
            best = Some((edits, name));
        }
    }
    best.map(|(_, name)| name)
}

/// A hint for an unknown name: "did you mean `x`?", or else the list of what is known.
pub(crate) fn hint<'a>(word: &str, known: impl IntoIterator<Item = &'a str> + Clone) -> String {
    match suggest(word, known.clone()) {
        Some(name) => format!("did you mean `{name}`?"),
        None => {
            let names: Vec<&str> = known.into_iter().collect();
            if names.is_empty() { "none is known".to_owned() } else { format!("expected one of {}", names.join(", ")) }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slips_are_understood_and_strangers_are_not() {
        let known = ["mesh", "height-mm", "scale", "unit"];
        assert_eq!(suggest("heigth-mm", known), Some("height-mm"));
        assert_eq!(suggest("height_mm", known), Some("height-mm"));
        assert_eq!(suggest("Unit", known), Some("unit"));
        assert_eq!(suggest("inches", ["mm", "inch"]), Some("inch"));
        assert_eq!(suggest("colour", known), None);
        assert_eq!(suggest(&"mesh".repeat(100), known), None);
        assert_eq!(hint("colour", ["a", "b"]), "expected one of a, b");
    }

    #[test]
    fn the_first_name_wins_a_tie() {
        assert_eq!(suggest("bat", ["cat", "rat"]), Some("cat"));
    }
}
