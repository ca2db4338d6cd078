//! Wavefront MTL: names, diffuse colours and their textures.

use std::path::Path;

use super::{Source, raw::RawMesh, texture};
use crate::mesh::SurfaceMaterial;
use crate::mesh::error::quote;

/// Words that `map_Kd` options are followed by.
const MAP_OPTIONS: [(&str, usize); 11] = [
    ("-blendu", 1),
    ("-blendv", 1),
    ("-boost", 1),
    ("-bm", 1),
    ("-cc", 1),
    ("-clamp", 1),
    ("-imfchan", 1),
    ("-mm", 2),
    ("-o", 3),
    ("-s", 3),
    ("-t", 3),
];

/// Appends the library's materials. Whatever is wrong with it becomes a warning; what can be read is kept.
pub(super) fn read(obj: &Source, path: &Path, materials: &mut Vec<SurfaceMaterial>, raw: &mut RawMesh) {
    let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let library = Source { path, bytes: &[], ..*obj };
    let bytes = match library.read(path) {
        Ok(bytes) => bytes,
        Err(reason) => {
            raw.lose_color(format!("material library `{name}` cannot be read ({reason}): its materials are white"));
            return;
        }
    };
    let start = materials.len();
    for (number, line) in (1..).zip(bytes.split(|&b| b == b'\n')) {
        let line = String::from_utf8_lossy(line);
        let (keyword, rest) = line.trim().split_once(char::is_whitespace).unwrap_or((line.trim(), ""));
        let rest = rest.trim();
        let known = materials.len() > start;
        match (keyword, materials.last_mut()) {
            ("newmtl", _) => materials.push(super::raw::plain(rest, [1.0; 4])),
            ("Kd", Some(material)) if known => match color(rest) {
                Some([r, g, b]) => material.base_color = [r, g, b, material.base_color[3]],
                None => raw.lose_color(format!(
                    "{name}, line {number}: found colour {}, expected three numbers: the material stays white",
                    quote(rest.as_bytes())
                )),
            },
            ("d", Some(material)) if known => {
                if let Some(alpha) = rest.parse::<f32>().ok().filter(|a| a.is_finite()) {
                    material.base_color[3] = alpha;
                }
            }
            ("map_Kd", Some(material)) if known => {
                let file = map_file(rest);
                match library.read(&library.companion(&file)).and_then(|bytes| texture::decode(&bytes)) {
                    Ok(texture) => material.base_color_texture = Some(texture),
                    Err(reason) => raw.lose_color(format!(
                        "{name}, line {number}: texture {} of material `{}` cannot be read ({reason}): it stays plain",
                        quote(file.as_bytes()),
                        material.name
                    )),
                }
            }
            _ => {}
        }
    }
}

/// One number stands for all three channels, as the format has it.
fn color(text: &str) -> Option<[f32; 3]> {
    let values: Vec<f32> = text.split_whitespace().map(str::parse).collect::<Result<_, _>>().ok()?;
    match values[..] {
        [grey] if grey.is_finite() => Some([grey; 3]),
        [r, g, b] if r.is_finite() && g.is_finite() && b.is_finite() => Some([r, g, b]),
        _ => None,
    }
}

/// The file name that follows the options; it may hold spaces.
fn map_file(text: &str) -> String {
    let mut words = text.split_whitespace().peekable();
    let mut skipped = false;
    while let Some(&(_, arguments)) = words.peek().and_then(|word| MAP_OPTIONS.iter().find(|(name, _)| name == word)) {
        words.next();
        skipped = true;
        // Trailing arguments of -o, -s and -t may be left out.
        for i in 0..arguments {
            let is_number = words.peek().is_some_and(|w| w.parse::<f32>().is_ok());
            if i > 0 && !is_number {
                break;
            }
            words.next();
        }
    }
    if skipped { words.collect::<Vec<_>>().join(" ") } else { text.to_owned() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn map_options_are_skipped() {
        for (text, file) in [
            ("a b.png", "a b.png"),
            ("-s 2 2 2 -clamp on wood.png", "wood.png"),
            ("-o 0.5 wood grain.png", "wood grain.png"),
            ("", ""),
        ] {
            assert_eq!(map_file(text), file);
        }
    }
}
