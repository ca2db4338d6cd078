//! File names of a capture: plain, or with `*` for any run of characters in the last part.

use std::path::{Path, PathBuf};

/// The files `pattern` stands for in `folder`, sorted by name; a plain name stands for itself, there or not.
pub(super) fn matching(folder: &Path, pattern: &str) -> std::io::Result<Vec<PathBuf>> {
    let whole = folder.join(pattern);
    if !pattern.contains('*') {
        return Ok(vec![whole]);
    }
    let (Some(parent), Some(last)) = (whole.parent(), whole.file_name()) else { return Ok(Vec::new()) };
    let last = last.to_string_lossy().into_owned();
    let parent = if parent == Path::new("") { Path::new(".") } else { parent };
    let mut found = Vec::new();
    for entry in std::fs::read_dir(parent)? {
        let entry = entry?;
        if fits(&last, &entry.file_name().to_string_lossy()) {
            found.push(entry.path());
        }
    }
    found.sort();
    Ok(found)
}

/// Whether `name` is `pattern` with every `*` replaced by something.
fn fits(pattern: &str, name: &str) -> bool {
    let mut parts = pattern.split('*');
    let Some(mut rest) = parts.next().and_then(|first| name.strip_prefix(first)) else { return false };
    let mut parts: Vec<&str> = parts.collect();
    let Some(last) = parts.pop() else { return rest.is_empty() };
    for part in parts {
        // The earliest place leaves most for the parts that follow.
        let Some(at) = rest.find(part) else { return false };
        rest = &rest[at + part.len()..];
    }
    rest.ends_with(last)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stars_stand_for_anything() {
        assert!(fits("r-*.png", "r-01.png") && fits("*", "x") && fits("a*b*c", "a1b2b3c"));
        assert!(!fits("r-*.png", "d-01.png") && !fits("r-*.png", "r-01.tif") && !fits("ab*ba", "aba"));
    }
}
