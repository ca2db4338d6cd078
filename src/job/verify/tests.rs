//! A sound folder is found sound; every kind of damage is found, and no claim of a manifest is believed.

use std::{fs, path::Path};

use serde_json::{Value, json};
use sha2::{Digest, Sha256};
use tempfile::TempDir;

use super::{Verification, VerifyError, layers::gaps, verify};
use crate::{
    watch::{Interrupt, Unwatched},
    words::hex,
};

const WHITE: [u8; 4] = [240, 240, 235, 255];
/// 5 × 2 × 2 voxels of 0.1 × 0.2 × 0.5 mm; white in the first three columns of both layers, support in some others.
const DIMS: [u32; 3] = [5, 2, 2];

fn png(color: png::ColorType, depth: png::BitDepth, dims: [u32; 2], rows: &[u8]) -> Vec<u8> {
    let mut file = Vec::new();
    let mut encoder = png::Encoder::new(&mut file, dims[0], dims[1]);
    encoder.set_color(color);
    encoder.set_depth(depth);
    let resolution = png::PixelDimensions { xppu: 10_000, yppu: 5000, unit: png::Unit::Meter };
    encoder.set_pixel_dims(Some(resolution));
    encoder.write_header().unwrap().write_image_data(rows).unwrap();
    file
}

fn slice(pixel: impl Fn(u32, u32) -> [u8; 4]) -> Vec<u8> {
    let rows: Vec<u8> =
        (0..DIMS[1]).flat_map(|y| (0..DIMS[0]).map(move |x| (x, y))).flat_map(|(x, y)| pixel(x, y)).collect();
    png(png::ColorType::Rgba, png::BitDepth::Eight, [DIMS[0], DIMS[1]], &rows)
}

fn mask(bits: [u8; 2]) -> Vec<u8> {
    png(png::ColorType::Grayscale, png::BitDepth::One, [DIMS[0], DIMS[1]], &bits)
}

/// A tetrahedron of 1/6 mm³.
fn stl(triangles: &[[usize; 3]]) -> Vec<u8> {
    let corners = [[0.0_f32; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [-0.0, 0.0, 1.0]];
    let mut file = vec![b' '; 80];
    file.extend((triangles.len() as u32).to_le_bytes());
    for triangle in triangles {
        file.extend([0; 12]);
        file.extend(triangle.iter().flat_map(|&v| corners[v]).flat_map(f32::to_le_bytes));
        file.extend([0; 2]);
    }
    file
}

const TETRAHEDRON: [[usize; 3]; 4] = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]];

struct Folder {
    root: TempDir,
    manifest: Value,
}

impl Folder {
    fn sound() -> Self {
        let job = json!({ "output": { "formats": ["png", "masks", "stl"] }, "x": 0.1 });
        let digest = hex(&Sha256::digest(json!({ "job": job, "inputs": [], "objects": [] }).to_string().as_bytes()));
        let white = |x: u32, _: u32| if x < 3 { WHITE } else { [0; 4] };
        let record = |id, name, rgba, voxels: u64| {
            json!({ "id": id, "name": name, "rgba": rgba, "voxels": voxels,
            "volume_mm3": voxels as f64 * (0.1 * 0.2 * 0.5),
                    "mass_g": 0.0 })
        };
        let mut folder = Self {
            root: tempfile::tempdir().unwrap(),
            manifest: json!({
                "generator": "test", "version": 1, "name": "test", "job": job, "inputs": [], "objects": [],
                "lattice": { "origin_mm": [0.0, 0.0, 0.0], "pitch_mm": [0.1, 0.2, 0.5], "dims": DIMS },
                "slices": [0, 2],
                "material_set": { "name": "test", "provenance": "", "channels": ["Y"] },
                "materials": [record(1, "white", WHITE, 12), record(2, "support", [0; 4], 5)],
                "stackings": [], "meshes": [{ "material": "white", "triangles": 4, "volume_mm3": 1.0 / 6.0,
                "pitch_mm": 0.1 }],
                "files": [], "warnings": [],
            }),
        };
        for k in 0..2 {
            folder.list(&format!("slices/slice_{k}.png"), &slice(white));
            folder.list(&format!("masks/white/slice_{k}.png"), &mask([0b1110_0000; 2]));
        }
        folder.list("meshes/white.stl", &stl(&TETRAHEDRON));
        folder.list("stackings.json", json!({ "sha256": digest, "objects": [] }).to_string().as_bytes());
        folder.write("timings.json", b"{}");
        folder
    }

    fn write(&self, path: &str, content: &[u8]) {
        let path = self.root.path().join(path);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, content).unwrap();
    }

    /// Writes a file and lists it, or lists its new content.
    fn list(&mut self, path: &str, content: &[u8]) {
        self.write(path, content);
        let entry = json!({ "path": path, "bytes": content.len(), "sha256": hex(&Sha256::digest(content)) });
        let files = self.manifest["files"].as_array_mut().unwrap();
        match files.iter_mut().find(|file| file["path"] == path) {
            Some(file) => *file = entry,
            None => files.push(entry),
        }
    }

    fn verify(&self) -> Verification {
        self.write("manifest.json", self.manifest.to_string().as_bytes());
        verify(self.root.path(), &Unwatched).unwrap()
    }

    /// Everything that is found, one line each.
    fn findings(&self) -> Vec<String> {
        self.verify().findings.iter().map(ToString::to_string).collect()
    }

    #[track_caller]
    fn finds(&self, expected: &[&str]) {
        let found = self.findings();
        assert_eq!(found.len(), expected.len(), "{found:#?}");
        for (found, expected) in found.iter().zip(expected) {
            assert!(found.starts_with(expected) && !found.contains('\n'), "found {found}\nexpected {expected}");
        }
    }
}

#[test]
fn a_sound_folder_has_no_findings() {
    let folder = Folder::sound();
    folder.finds(&[]);
    let result = folder.verify();
    assert_eq!((result.files, result.slices, result.voxels), (6, 2, 12));
}

#[test]
fn damaged_missing_and_extra_files_are_found() {
    let folder = Folder::sound();
    let path = folder.root.path().join("stackings.json");
    let mut bytes = fs::read(&path).unwrap();
    bytes[20] ^= 1;
    fs::write(&path, bytes).unwrap();
    fs::remove_file(folder.root.path().join("masks/white/slice_1.png")).unwrap();
    folder.write("slices/old/notes.txt", b"");
    folder.write("slices/slice_2.png.part", b"");
    let found = folder.findings();
    assert_eq!(found[0], "masks/white/slice_1.png: missing");
    assert!(found[1].starts_with("stackings.json: found SHA-256 "), "{}", found[1]);
    assert!(found[2].starts_with("slices/old/notes.txt: found a file that the manifest does not list"), "{}", found[2]);
    assert!(found[3].starts_with("slices/slice_2.png.part: "), "{}", found[3]);
}

#[test]
fn slices_that_are_no_slices_are_found() {
    let rows = vec![0; 40];
    let rgb = png(png::ColorType::Rgb, png::BitDepth::Eight, [5, 2], &rows[..30]);
    let small = png(png::ColorType::Rgba, png::BitDepth::Eight, [2, 5], &rows);
    let cases: [(Vec<u8>, &str); 4] = [
        (rgb, "slices/slice_1.png: found Rgb of 8 bits a sample, expected Rgba of 8"),
        (small, "slices/slice_1.png: found 2 × 5 pixels, expected 5 × 2"),
        (b"not an image".to_vec(), "slices/slice_1.png: cannot be decoded"),
        (slice(|_, _| WHITE)[..60].to_vec(), "slices/slice_1.png: cannot be decoded"),
    ];
    for (content, expected) in cases {
        let mut folder = Folder::sound();
        folder.list("slices/slice_1.png", &content);
        folder.finds(&[expected]);
    }
    let mut folder = Folder::sound();
    folder.manifest["lattice"]["pitch_mm"] = json!([0.2, 0.1, 0.5]);
    let found = folder.findings();
    assert!(found[0].contains("found 10000 × 5000 pixels per m, expected 5000 × 10000"), "{found:?}");
}

#[test]
fn colours_and_counts_are_held_against_the_manifest() {
    let mut folder = Folder::sound();
    folder.list(
        "slices/slice_0.png",
        &slice(|x, y| {
            if (x, y) == (1, 1) {
                [1, 2, 3, 4]
            } else if x < 3 {
                WHITE
            } else {
                [0; 4]
            }
        }),
    );
    folder.finds(&[
        "slices: found 11 voxels of white, the manifest has 12",
        "masks/white/slice_0.png: differs from the slice in 1 voxels",
        "slices/slice_0.png: found 1 pixels of no resin's colour, the first [1, 2, 3, 4] at column 1 of row 1",
    ]);

    let mut folder = Folder::sound();
    folder.manifest["materials"][1]["voxels"] = json!(9);
    folder.finds(&[
        "manifest.json: materials[1].volume_mm3: found 0.05",
        "slices: found 8 voxels of background, the manifest has 9 of resins printed as such",
    ]);

    let mut folder = Folder::sound();
    folder.list("masks/white/slice_0.png", &mask([0b1100_0000, 0b1110_0111])); // padding bits do not count
    folder.finds(&["masks/white/slice_0.png: differs from the slice in 1 voxels"]);
}

#[test]
fn numbering_has_no_gaps() {
    let gaps = |numbers: &[u32]| gaps("slices", &numbers.iter().copied().collect(), 3..8).len();
    assert_eq!(gaps(&[3, 4, 5, 6, 7]), 0);
    assert_eq!(gaps(&[4, 6, 7]), 2);
    assert_eq!(gaps(&[]), 1);
    assert_eq!(gaps(&[2, 3, 4, 5, 6, 7, 8]), 2);

    let mut folder = Folder::sound();
    folder.manifest["files"].as_array_mut().unwrap().retain(|file| file["path"] != "slices/slice_0.png");
    folder.finds(&[
        "slices/slice_0.png: found a file that the manifest does not list",
        "slices: slice_0.png not listed, expected one for each of the slices 0..2",
    ]);
}

#[test]
fn meshes_are_closed_and_as_large_as_recorded() {
    let mut flipped = TETRAHEDRON;
    flipped[2] = [1, 3, 2];
    for triangles in [flipped, [TETRAHEDRON[0], TETRAHEDRON[1], TETRAHEDRON[2], TETRAHEDRON[2]]] {
        let mut folder = Folder::sound();
        folder.list("meshes/white.stl", &stl(&triangles));
        folder.finds(&["meshes/white.stl: found a surface with holes or flipped triangles"]);
    }
    let mut folder = Folder::sound();
    folder.list("meshes/white.stl", &stl(&TETRAHEDRON[..3]));
    folder.finds(&["meshes/white.stl: found 3 triangles, expected 4"]);
    let mut folder = Folder::sound();
    folder.manifest["meshes"][0]["volume_mm3"] = json!(0.2);
    folder.finds(&["meshes/white.stl: found a volume of 0.166667 mm³, expected 0.2"]);
    folder.list("meshes/white.stl", b"solid");
    folder.finds(&["meshes/white.stl: found 5 bytes, expected a binary STL file"]);
}

#[test]
fn stackings_are_those_of_the_manifest() {
    let mut folder = Folder::sound();
    folder.manifest["job"]["x"] = json!(0.100_000_000_000_000_02); // one unit in the last place
    folder.finds(&["stackings.json: found SHA-256"]);
    let mut folder = Folder::sound();
    folder.manifest["stackings"] = json!([{ "kind": "stacking", "sequence": [], "stackings": [], "core": "black" }]);
    folder.finds(&["stackings.json: found stackings that differ from those of the manifest"]);
}

#[test]
fn hostile_manifests_are_survived() {
    let entry = |path: &str| json!({ "path": path, "bytes": 1, "sha256": "" });
    for path in ["../outside.txt", "/etc/hostname", "", "a\\..\\b", "."] {
        let mut folder = Folder::sound();
        folder.manifest["files"].as_array_mut().unwrap().push(entry(path));
        folder.finds(&[&format!("{path}: found a path that leaves the folder")]);
    }
    let mut folder = Folder::sound();
    folder.manifest["files"].as_array_mut().unwrap().push(entry("a\nb: \u{1b}[2J"));
    folder.finds(&["a\\nb: \\u{1b}[2J: missing"]);

    let huge = [
        ("/lattice/dims", json!([u32::MAX, u32::MAX, u32::MAX])),
        ("/slices", json!([0, u32::MAX])),
        ("/slices", json!([5, 1])),
        ("/lattice/pitch_mm", json!([0.0, -1.0, 1e300])),
        ("/materials/0/voxels", json!(u64::MAX)),
        ("/materials/0/name", json!("../..")),
        ("/meshes/0/material", json!("../../secret")),
        ("/meshes/0/triangles", json!(u64::MAX)),
        ("/files/0/bytes", json!(u64::MAX)),
    ];
    for (key, value) in huge {
        let mut folder = Folder::sound();
        *folder.manifest.pointer_mut(key).unwrap() = value;
        let found = folder.findings();
        assert!(!found.is_empty() && found.len() < 20, "{key}: {found:#?}");
    }
    let wrong_types =
        [("/lattice/dims", json!("5")), ("/files", json!({})), ("/version", json!("1")), ("/slices", json!([1.5, 2]))];
    for (key, value) in wrong_types {
        let mut folder = Folder::sound();
        *folder.manifest.pointer_mut(key).unwrap() = value;
        folder.finds(&["manifest.json: cannot be read: "]);
    }
    let mut folder = Folder::sound();
    let many: Vec<Value> = (0..70_000).map(|_| folder.manifest["materials"][0].clone()).collect();
    folder.manifest["materials"] = Value::Array(many);
    assert!(!folder.findings().is_empty());
}

#[test]
fn only_a_finished_folder_of_this_version_is_judged() {
    let check = |path: &Path| verify(path, &Unwatched);
    let empty = tempfile::tempdir().unwrap();
    assert!(matches!(check(empty.path()), Err(VerifyError::NoManifest { .. })));
    assert!(matches!(check(&empty.path().join("none")), Err(VerifyError::NoFolder { .. })));
    let folder = Folder::sound();
    let mut manifest = folder.manifest.clone();
    manifest["version"] = json!(2);
    manifest["files"] = json!("of another form");
    folder.write("manifest.json", manifest.to_string().as_bytes());
    assert!(matches!(check(folder.root.path()), Err(VerifyError::Version { found: 2, .. })));
    folder.write("manifest.json", b"{\"version\": 1");
    assert_eq!(check(folder.root.path()).unwrap().findings.len(), 1);
    let stop = Interrupt::new();
    stop.request();
    folder.write("manifest.json", folder.manifest.to_string().as_bytes());
    assert!(matches!(verify(folder.root.path(), &stop), Err(VerifyError::Stopped(_))));
}

#[cfg(unix)]
#[test]
fn links_are_not_followed() {
    use std::os::unix::fs::symlink;
    let outside = tempfile::tempdir().unwrap();
    let folder = Folder::sound();
    let slice = folder.root.path().join("slices/slice_0.png");
    fs::rename(&slice, outside.path().join("slice_0.png")).unwrap();
    symlink(outside.path().join("slice_0.png"), &slice).unwrap();
    folder.finds(&["slices/slice_0.png: found a symbolic link, expected a file"]);

    let folder = Folder::sound();
    fs::rename(folder.root.path().join("meshes"), outside.path().join("meshes")).unwrap();
    symlink(outside.path().join("meshes"), folder.root.path().join("meshes")).unwrap();
    folder.finds(&[
        "meshes/white.stl: found behind a symbolic link out of the folder",
        "meshes: found a file that the manifest does not list",
    ]);
}
