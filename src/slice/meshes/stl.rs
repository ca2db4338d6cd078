//! Binary STL: the format every printer's software reads. No units and no topology; millimetres by custom, and named in
//! the header.

use std::io::{self, Write};

use glam::Vec3;

use super::{MaterialMeshes, MaterialPart};

/// Bytes before the number of triangles.
const HEADER: usize = 80;
/// Bytes per triangle.
const RECORD: usize = 50;
/// Triangles written at a time.
const BATCH: usize = 4096;

/// Writes one part of `meshes`.
///
/// # Errors
/// Those of `out`, and a part of more than 2³² triangles.
pub fn write_stl(meshes: &MaterialMeshes, part: &MaterialPart, mut out: impl Write) -> io::Result<()> {
    let count = u32::try_from(part.triangles.len())
        .map_err(|_| io::Error::other(format!("{} triangles, expected at most 2^32 in STL", part.triangles.len())))?;
    out.write_all(&header(&part.name))?;
    out.write_all(&count.to_le_bytes())?;
    let mut buffer = Vec::with_capacity(BATCH * RECORD);
    for batch in part.triangles.chunks(BATCH) {
        buffer.clear();
        for triangle in batch {
            let corners = triangle.map(|v| meshes.positions[v as usize]);
            let [a, b, c] = corners.map(Vec3::from);
            let normal = (b - a).cross(c - a).normalize_or_zero();
            for vector in [normal.to_array()].iter().chain(&corners) {
                buffer.extend(vector.iter().flat_map(|value| value.to_le_bytes()));
            }
            buffer.extend([0, 0]);
        }
        out.write_all(&buffer)?;
    }
    out.flush()
}

/// Must not begin with "solid", which would make it a text file to many readers.
fn header(name: &str) -> [u8; HEADER] {
    let text = format!("lumislice material mesh; unit mm; {name}");
    let mut header = [b' '; HEADER];
    let plain = text.bytes().map(|byte| if byte.is_ascii_graphic() || byte == b' ' { byte } else { b'?' });
    for (slot, byte) in header.iter_mut().zip(plain) {
        *slot = byte;
    }
    header
}
