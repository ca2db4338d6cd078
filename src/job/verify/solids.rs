//! The material meshes: whole, closed and of the size the manifest says.
//!
//! A mesh is closed and consistently oriented if every edge is walked once each way. That is tested in constant memory:
//! to a sum goes a 128-bit hash of every edge as it is walked, and from it the hash of the same edge walked back. The
//! sum is 0 for a closed mesh, and for any other one with a chance of 2⁻¹²⁸. Vertices are the same if their coordinates
//! are.

use std::{
    fs::File,
    io::{BufReader, Read},
};

use glam::DVec3;

use super::{Check, Finding, Verification, VerifyError, files::Sound};
use crate::job::manifest::MeshRecord;
use crate::parallel;

/// Bytes before the number of triangles in a binary STL file.
const HEADER: usize = 80;
/// Bytes per triangle.
const RECORD: usize = 50;
/// STL rounds coordinates to 24 bits: the volume of a mesh as thin as 1/1000 of its distance from the origin keeps four
/// digits.
const VOLUME_TOLERANCE: f64 = 1e-3;

pub(super) fn check(check: &Check<'_>, sound: &Sound<'_>, result: &mut Verification) -> Result<(), VerifyError> {
    let records = &check.manifest.meshes;
    let name = |record: &MeshRecord| format!("meshes/{}.stl", record.material);
    for file in
        check.manifest.files.iter().filter(|file| file.path.starts_with("meshes/") && file.path.ends_with(".stl"))
    {
        if !records.iter().any(|record| name(record) == file.path) {
            let problem = "found a mesh that `meshes` does not name, expected none";
            result.findings.push(Finding::new(&file.path, problem));
        }
    }
    check.watch.stage("meshes", records.len() as u64);
    let outcomes: Vec<Option<Finding>> = parallel::map_all(records, |record| {
        check.watch.go_on()?;
        let path = name(record);
        let listed = check.manifest.files.iter().any(|file| file.path == path);
        let problem = if sound.contains(path.as_str()) {
            check.open(&path).and_then(|file| compare(record, file)).err()
        } else if !listed && check.wants("stl") {
            Some("not listed, expected the mesh that `meshes` names".to_owned())
        } else {
            None
        };
        check.watch.advance(1);
        Ok(problem.map(|problem| Finding::new(&path, problem)))
    })
    .into_iter()
    .collect::<Result<_, VerifyError>>()?;
    result.findings.extend(outcomes.into_iter().flatten());
    Ok(())
}

fn compare(record: &MeshRecord, file: File) -> Result<(), String> {
    let unreadable = |error: std::io::Error| format!("cannot be read: {error}");
    let bytes = file.metadata().map_err(unreadable)?.len();
    let mut file = BufReader::with_capacity(RECORD << 10, file);
    let mut header = [0; HEADER + 4];
    file.read_exact(&mut header).map_err(|_| format!("found {bytes} bytes, expected a binary STL file"))?;
    let count = u32::from_le_bytes([header[HEADER], header[HEADER + 1], header[HEADER + 2], header[HEADER + 3]]);
    let expected = (HEADER + 4) as u64 + u64::from(count) * RECORD as u64;
    if bytes != expected {
        return Err(format!("found {bytes} bytes, expected {expected} for its {count} triangles"));
    }
    if u64::from(count) != record.triangles {
        return Err(format!("found {count} triangles, expected {}", record.triangles));
    }
    let (mut edges, mut volume) = (0_u128, 0.0);
    let mut triangle = [0; RECORD];
    for index in 0..count {
        file.read_exact(&mut triangle).map_err(unreadable)?;
        let mut corners = [[0_f32; 3]; 3];
        let (numbers, _) = triangle[12..48].as_chunks::<4>();
        for (number, coordinate) in numbers.iter().zip(corners.as_flattened_mut()) {
            *coordinate = f32::from_le_bytes(*number) + 0.0; // −0 and 0 are one place
        }
        if !corners.as_flattened().iter().all(|coordinate| coordinate.is_finite()) {
            return Err(format!("triangle {index}: found {corners:?}, expected finite coordinates"));
        }
        for side in 0..3 {
            let (from, to) = (corners[side], corners[(side + 1) % 3]);
            edges = edges.wrapping_add(hash(from, to)).wrapping_sub(hash(to, from));
        }
        let [a, b, c] = corners.map(|corner| DVec3::from(corner.map(f64::from)));
        volume += a.dot(b.cross(c)) / 6.0;
    }
    if edges != 0 {
        return Err("found a surface with holes or flipped triangles, expected a closed one".to_owned());
    }
    if !((volume - record.volume_mm3).abs() <= VOLUME_TOLERANCE * record.volume_mm3.abs().max(1.0)) {
        return Err(format!("found a volume of {volume:.6} mm³, expected {:.6}", record.volume_mm3));
    }
    Ok(())
}

/// A hash of a directed edge: two rounds of splitmix64 (Steele, Lea and Flood 2014) per 64 bits, chained over the
/// coordinates.
fn hash(from: [f32; 3], to: [f32; 3]) -> u128 {
    let chain = |seed: u64| {
        from.iter().chain(&to).fold(seed, |state, coordinate| {
            let mut z = state.wrapping_add(0x9e37_79b9_7f4a_7c15) ^ u64::from(coordinate.to_bits());
            for _ in 0..2 {
                z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
                z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
                z ^= z >> 31;
            }
            z
        })
    };
    u128::from(chain(1)) << 64 | u128::from(chain(2))
}
