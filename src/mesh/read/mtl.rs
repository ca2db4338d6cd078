//! Wavefront MTL: names, diffuse colours and their textures. Keywords count in any case.
//!
//! Of `map_Kd`'s options `-s` and `-o` place the texture (uv′ = s·uv + o, v upwards, as three.js has it), `-clamp on`
//! goes on with the texture's edge beyond it. `-mm` and `-t`, which change what the texture shows, are not read and
//! said to be lost; the others do not matter.

use std::path::Path;

use glam::DVec2;

use super::support::{self, Fate};
use super::text::{Statements, expected_number, has_comma, or_latin_1, without_comment};
use super::{Source, raw::RawMesh, texture};
use crate::encoding::decoded;
use crate::mesh::error::quote;
use crate::mesh::{SurfaceMaterial, Wrap};

/// Statements whose argument is a name or a file.
const NAMED: [&str; 2] = ["newmtl", "map_kd"];

/// Options of `map_Kd` and the words that follow each.
const MAP_OPTIONS: [(&str, usize); 12] = [
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
    ("-texres", 1),
];

/// Those that change what the texture shows, or where.
const PLACING: [&str; 4] = ["-mm", "-o", "-s", "-t"];

/// Statements by which a material that has no colour else may be given one.
const ELSEWHERE: [&str; 3] = ["Ke", "map_Ka", "map_Ke"];

/// A material as a library defines it.
pub(super) struct Definition {
    pub(super) material: SurfaceMaterial,
    /// Whether it states a diffuse colour or a texture of it.
    pub(super) has_color: bool,
    /// Another statement that gives it a colour and is not read.
    pub(super) elsewhere: Option<&'static str>,
    /// How the texture lies: uv′ = scale · uv + offset, v upwards.
    pub(super) scale: DVec2,
    pub(super) offset: DVec2,
}

/// Appends the library's materials. Whatever is wrong with it becomes a warning; what can be read is kept.
pub(super) fn read(obj: &Source, path: &Path, materials: &mut Vec<Definition>, raw: &mut RawMesh) {
    let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let library = Source { path, bytes: &[], ..*obj };
    let bytes = library.read(path);
    let text = bytes.as_deref().map_err(String::clone);
    let text = match text.and_then(|bytes| decoded(bytes).map_err(|broken| broken.to_string())) {
        Ok(text) => text,
        Err(reason) => {
            raw.lose_color(format!("material library `{name}` cannot be read ({reason}): its materials are white"));
            return;
        }
    };
    let start = materials.len();
    for (number, line) in Statements::new(&text, &NAMED) {
        let line = or_latin_1(&line);
        let (keyword, rest) = line.trim().split_once(char::is_whitespace).unwrap_or((line.trim(), ""));
        let rest = rest.trim();
        let known = materials.len() > start;
        match (keyword.to_ascii_lowercase().as_str(), materials.last_mut()) {
            ("newmtl", _) => materials.push(Definition {
                material: super::raw::plain(rest, [1.0; 4]),
                has_color: false,
                elsewhere: None,
                scale: DVec2::ONE,
                offset: DVec2::ZERO,
            }),
            ("kd", Some(Definition { material, has_color, .. })) if known => {
                *has_color = true;
                match color(rest) {
                    Some([r, g, b]) => material.base_color = [r, g, b, material.base_color[3]],
                    None => raw.lose_color(format!(
                        "{name}, line {number}: found colour {}, expected {}: the material stays white",
                        quote(rest.as_bytes()),
                        expected_number(rest.as_bytes(), "three numbers of 0 to 1")
                    )),
                }
            }
            (keyword @ ("d" | "tr"), Some(Definition { material, .. })) if known => {
                if let Some(value) = rest.parse::<f32>().ok().filter(|a| a.is_finite()) {
                    let alpha = if keyword == "d" { value } else { 1.0 - value };
                    material.base_color[3] = alpha;
                    if alpha <= 0.0 {
                        let material = &material.name;
                        raw.warnings.push(format!(
                            "{name}, line {number}: material `{material}` is wholly transparent; its surface is \
                             printed all the same"
                        ));
                    }
                }
            }
            ("map_kd", Some(definition)) if known => {
                definition.has_color = true;
                let mut map = Map::parse(rest);
                if !library.companion(&map.file).exists() {
                    map.file.truncate(without_comment(&map.file).len());
                }
                let file = quote(map.file.as_bytes());
                if map.has_comma {
                    raw.lose_color(format!(
                        "{name}, line {number}: found options {}, expected {}",
                        quote(rest.as_bytes()),
                        expected_number(rest.as_bytes(), "numbers")
                    ));
                }
                if map.unread {
                    raw.lose_color(format!(
                        "{name}, line {number}: the options -mm and -t of texture {file} are not read"
                    ));
                }
                match library.read(&library.companion(&map.file)).and_then(|bytes| texture::decode(&bytes)) {
                    Ok(texture) => {
                        let (texture, told) = texture::without_holes(texture, &format!("texture {file}"));
                        raw.warnings.extend(told.map(|told| format!("{name}, line {number}: {told}")));
                        definition.material.base_color_texture = Some(texture);
                        definition.material.wrap = [if map.clamp { Wrap::Clamp } else { Wrap::Repeat }; 2];
                        (definition.scale, definition.offset) = (map.scale, map.offset);
                    }
                    Err(reason) => raw.lose_color(format!(
                        "{name}, line {number}: texture {file} of material `{}` cannot be read ({reason}): it stays \
                            plain",
                        definition.material.name
                    )),
                }
            }
            (keyword @ ("ke" | "map_ka" | "map_ke"), Some(definition)) if known => {
                let shows = keyword != "ke" || color(rest).is_some_and(|rgb| rgb != [0.0; 3]);
                let found = || ELSEWHERE.into_iter().find(|known| known.eq_ignore_ascii_case(keyword));
                definition.elsewhere = if shows { found() } else { definition.elsewhere };
            }
            (keyword, Some(Definition { material, .. }))
                if known && support::fate("MTL", keyword) == Some(Fate::Warned) =>
            {
                let material = &material.name;
                raw.warnings.push(format!("{name}, line {number}: {keyword} of material `{material}` is not read"));
            }
            _ => {}
        }
    }
}

/// One number stands for all three channels, as the format has it.
fn color(text: &str) -> Option<[f32; 3]> {
    let values: Vec<f32> = text.split_whitespace().map(str::parse).collect::<Result<_, _>>().ok()?;
    // Bytes would all be white; a little beyond 1 is rounding.
    if values.iter().any(|value| !(0.0..=1.01).contains(value)) {
        return None;
    }
    match values[..] {
        [grey] => Some([grey; 3]),
        [r, g, b] => Some([r, g, b]),
        _ => None,
    }
}

/// The argument of `map_Kd`.
#[derive(Debug, PartialEq)]
struct Map {
    /// May hold spaces.
    file: String,
    clamp: bool,
    scale: DVec2,
    offset: DVec2,
    /// An option changes the colours and is not read.
    unread: bool,
    /// A number of an option that matters has a comma.
    has_comma: bool,
}

impl Map {
    fn parse(text: &str) -> Self {
        let mut map = Self {
            file: String::new(),
            clamp: false,
            scale: DVec2::ONE,
            offset: DVec2::ZERO,
            unread: false,
            has_comma: false,
        };
        let mut words = text.split_whitespace().peekable();
        let mut has_options = false;
        let option_of = |word: &&str| MAP_OPTIONS.iter().find(|(name, _)| word.eq_ignore_ascii_case(name));
        while let Some(&(name, arguments)) = words.peek().and_then(option_of) {
            words.next();
            has_options = true;
            let mut numbers = Vec::new();
            let mut word = "";
            // Trailing arguments of -o, -s and -t may be left out.
            for i in 0..arguments {
                let with_comma = words.peek().is_some_and(|word| has_comma(word.as_bytes()));
                let number = words.peek().and_then(|w| w.parse::<f64>().ok()).filter(|n| n.is_finite());
                map.has_comma |= with_comma && PLACING.contains(&name);
                if i > 0 && number.is_none() && !with_comma {
                    break;
                }
                numbers.extend(number);
                word = words.next().unwrap_or("");
            }
            let pair = |default: f64| DVec2::new(at(&numbers, 0, default), at(&numbers, 1, default));
            match name {
                "-clamp" => map.clamp = word.eq_ignore_ascii_case("on"),
                "-s" => map.scale = pair(1.0),
                "-o" => map.offset = pair(0.0),
                "-t" => map.unread |= numbers.iter().any(|&n| n != 0.0),
                "-mm" => map.unread |= (at(&numbers, 0, 0.0), at(&numbers, 1, 1.0)) != (0.0, 1.0),
                _ => {}
            }
        }
        map.file = if has_options { words.collect::<Vec<_>>().join(" ") } else { text.to_owned() };
        map
    }
}

fn at(numbers: &[f64], index: usize, default: f64) -> f64 {
    numbers.get(index).copied().unwrap_or(default)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn map_options_end_where_the_file_begins() {
        for (text, file) in [
            ("a b.png", "a b.png"),
            ("-s 2 2 2 -clamp on wood.png", "wood.png"),
            ("-o 0.5 wood grain.png", "wood grain.png"),
            ("-CLAMP off -texres 512 wood.png", "wood.png"),
            ("", ""),
        ] {
            assert_eq!(Map::parse(text).file, file);
        }
    }

    #[test]
    fn map_options_place_the_texture() {
        let map = Map::parse("-O 0.25 -s 2 3 1 -Clamp On x.png");
        assert_eq!((map.scale, map.offset, map.clamp), (DVec2::new(2.0, 3.0), DVec2::new(0.25, 0.0), true));
        assert!(!Map::parse("-mm 0 1 -t 0 0 0 x.png").unread);
        assert!(Map::parse("-mm 0.2 1 x.png").unread && Map::parse("-t 0.1 x.png").unread);
        for (text, has_comma) in [
            ("-bm 0,5 x.png", false),
            ("-boost 1,5 -texres 5,0 x.png", false),
            ("-s 0,5 1,0 x.png", true),
            ("-O 1, 0, 0 x.png", true),
            ("-mm 0 0,9 x.png", true),
            ("-bm 0,5 -t 0,1 x.png", true),
        ] {
            let map = Map::parse(text);
            assert_eq!((map.has_comma, map.file.as_str()), (has_comma, "x.png"), "{text}");
        }
    }
}
