//! The documentation names every key and every bound.

use super::{appearance, object, options, output, ranges, target};

const PAGE: &str = include_str!("../../../docs/job.md");

#[test]
fn every_key_is_documented() {
    let tables = [
        object::KEYS,
        options::PRINTER_KEYS,
        options::MATERIALS_KEYS,
        options::CLUSTERS_KEYS,
        options::STACKING_KEYS,
        options::LIMIT_KEYS,
        appearance::APPEARANCE_KEYS,
        options::FIELD_KEYS,
        output::OUTPUT_KEYS,
        super::ROOT_KEYS,
    ];
    let of_kinds = target::KINDS.iter().flat_map(|(_, keys)| *keys);
    for key in tables.into_iter().flatten().chain(of_kinds) {
        let named = [format!("`{key}`"), format!("[{key}]"), format!(".{key}]")];
        assert!(named.iter().any(|name| PAGE.contains(name)), "docs/job.md does not mention {key}");
    }
}

#[test]
fn every_bound_is_documented() {
    use ranges as r;
    let row = |key: &str| {
        let row = PAGE.lines().find(|line| line.starts_with(&format!("| `{key}`")));
        row.unwrap_or_else(|| panic!("docs/job.md has no row for {key}"))
    };
    let numbers = [
        ("height-mm", r::HEIGHT),
        ("scale", r::SCALE),
        ("rotate-deg", r::ANGLE),
        ("position-mm", r::POSITION),
        ("pitch-mm", r::PITCH),
        ("tray-mm", r::TRAY),
        ("stack", crate::optics::LAYER),
        ("albedo-value", r::ALBEDO),
        ("max-albedo", r::MAX_ALBEDO),
        ("subsurface-scale", r::SUBSURFACE_SCALE),
        ("subsurface-anisotropy", r::ANISOTROPY),
        ("tile-mm", r::TILE),
        ("mean-free-path-mm", r::MEAN_FREE_PATH),
        ("max-thickness-mm", r::MAX_THICKNESS),
        ("dc-weight", r::DC_WEIGHT),
        ("min-depth-mm", r::LIMIT_DEPTH),
        ("min-mm", r::LIMIT_MIN),
        ("max-mm", r::LIMIT_MAX),
        ("lp-exponent", r::LP_EXPONENT),
        ("mesh-pitch-mm", r::PITCH),
        ("min-layer-mm", r::PITCH),
        ("layer-step-mm", r::PITCH),
    ];
    for (key, range) in numbers {
        let bounds = format!("{} to {}", range.min, range.max).replace('-', "−");
        assert!(row(key).contains(&bounds), "{key} ranges from {bounds}, says the code");
    }
    let integers = [
        ("max-colors", r::COLORS),
        ("min-slices", r::SLICES),
        ("k", r::CLUSTERS),
        ("units", r::UNITS),
        ("depth", r::DEPTH),
        ("profiles", r::CLUSTERS),
    ];
    for (key, range) in integers {
        let bounds = format!("{} to {}", range.min, range.max);
        assert!(row(key).contains(&bounds), "{key} ranges from {bounds}, says the code");
    }
    assert!(row("seed").contains("0 to 2⁶³ − 1"));
}
