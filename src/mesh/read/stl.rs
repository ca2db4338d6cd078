//! STL, binary and text.
//!
//! The two are told apart by size, not by the word "solid": binary files begin with it too, and a binary file's length
//! follows from its count (84 + 50·n). Normals are ignored: they follow from the order of corners. A text file may hold several solids.

use glam::DVec3;

use super::Source;
use super::raw::{RawMesh, finite};
use crate::mesh::error::{Fault, Parsed, quote};
use crate::words::counted;

const HEADER: usize = 84;
const RECORD: usize = 50;

pub(super) fn parse(source: &Source) -> Parsed<RawMesh> {
    let bytes = source.bytes;
    let count = bytes.get(80..HEADER).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]) as usize);
    let exact = count.is_some_and(|n| bytes.len() == HEADER + RECORD * n);
    let looks_like_text =
        bytes.trim_ascii_start().get(..5).is_some_and(|w| w.eq_ignore_ascii_case(b"solid")) && !bytes.contains(&0);
    if looks_like_text && !exact {
        return text(bytes);
    }
    let Some(count) = count else {
        let found = format!("{} bytes that begin with {}", bytes.len(), quote(bytes));
        return Err(Fault::new("the header", found, "`solid` or a header of 84 bytes"));
    };
    binary(bytes, count)
}

fn binary(bytes: &[u8], count: usize) -> Parsed<RawMesh> {
    let body = &bytes[HEADER..];
    if body.len() < RECORD * count {
        let found = format!("{} bytes after a header that claims {count} triangles", body.len());
        return Err(Fault::new("byte 80", found, format!("{} bytes", RECORD * count)));
    }
    let mut raw = RawMesh::new(1.0);
    if body.len() > RECORD * count {
        raw.warnings.push(format!("{} after the last triangle ignored", counted(body.len() - RECORD * count, "byte")));
    }
    raw.positions.reserve(3 * count);
    raw.triangles.reserve(count);
    for (t, record) in body.chunks_exact(RECORD).take(count).enumerate() {
        for corner in record[12..48].chunks_exact(12) {
            let at = |i: usize| f64::from(f32::from_le_bytes([corner[i], corner[i + 1], corner[i + 2], corner[i + 3]]));
            raw.positions.push(finite(DVec3::new(at(0), at(4), at(8)), || format!("triangle {t}"))?);
        }
        push_last_three(&mut raw, || format!("triangle {t}"))?;
    }
    Ok(raw)
}

fn text(bytes: &[u8]) -> Parsed<RawMesh> {
    let mut raw = RawMesh::new(1.0);
    // Line of the facet being read.
    let mut facet: Option<usize> = None;
    let mut corners = 0;
    let mut solid_open = false;
    let mut number = 0;
    for line in bytes.split(|&b| b == b'\n') {
        number += 1;
        let place = || format!("line {number}");
        let mut words = line.split(u8::is_ascii_whitespace).filter(|w| !w.is_empty());
        let Some(keyword) = words.next() else { continue };
        match (keyword.to_ascii_lowercase().as_slice(), facet) {
            (b"solid", None) => solid_open = true,
            (b"endsolid", None) => solid_open = false,
            (b"facet", None) => (facet, corners) = (Some(number), 0),
            (b"outer" | b"endloop", Some(_)) => {}
            (b"vertex", Some(_)) if corners < 3 => {
                let mut p = [0.0; 3];
                for value in &mut p {
                    let number = words.next().and_then(|w| std::str::from_utf8(w).ok()?.parse().ok());
                    *value =
                        number.ok_or_else(|| Fault::new(place(), quote(line), "`vertex x y z` with three numbers"))?;
                }
                raw.positions.push(finite(DVec3::from_array(p), place)?);
                corners += 1;
            }
            (b"endfacet", Some(_)) if corners == 3 => {
                push_last_three(&mut raw, place)?;
                facet = None;
            }
            (_, Some(start)) => {
                let expected = format!("corner {} of the facet begun in line {start}", (corners + 1).min(3));
                let expected = if corners == 3 { "endloop and endfacet".to_owned() } else { expected };
                return Err(Fault::new(place(), quote(line), expected));
            }
            (_, None) => return Err(Fault::new(place(), quote(line), "solid, facet or endsolid")),
        }
    }
    if facet.is_some() || solid_open {
        return Err(Fault::new(format!("line {number}"), "the end of the file", "endfacet and endsolid"));
    }
    Ok(raw)
}

fn push_last_three(raw: &mut RawMesh, place: impl Fn() -> String) -> Parsed<()> {
    // Positions stay below 3 · MAX_TRIANGLES, far from u32's limit.
    let end = raw.positions.len() as u32;
    raw.push(place, [end - 3, end - 2, end - 1], None)
}
