//! Broken bytes: whatever a file holds, loading it neither panics nor takes more memory than its size warrants.

#[path = "../../common/counting.rs"]
mod counting;

use std::cell::Cell;
use std::path::Path;

use lumislice::mesh::{LoadOptions, close, load};
use proptest::prelude::*;
use proptest::sample::Index;

use super::writers;
use counting::Counting;

// Bytes that each thread holds, and the most it held.
thread_local! {
    static HELD: Cell<isize> = const { Cell::new(0) };
    static PEAK: Cell<isize> = const { Cell::new(0) };
}

fn count(change: isize) {
    let _ = HELD.try_with(|held| {
        held.set(held.get() + change);
        let _ = PEAK.try_with(|peak| peak.set(peak.get().max(held.get())));
    });
}

#[global_allocator]
static ALLOCATOR: Counting = Counting(count);

/// Most memory per byte of file: an STL's 50 bytes become 3 positions, a triangle and a hash table of 6 slots, a text
/// format's numbers grow more. A deflated part may be a thousand times its size, hence the wide constant.
const BYTES_PER_BYTE: isize = 100;
const CONSTANT: isize = 16 << 20;

fn survives(folder: &Path, name: &str, bytes: &[u8]) {
    let path = writers::put(folder, name, bytes);
    PEAK.set(HELD.get());
    let before = HELD.get();
    let result = load(&path, &LoadOptions::default());
    let peak = PEAK.get() - before;
    assert!(peak < CONSTANT + BYTES_PER_BYTE * bytes.len() as isize, "{peak} bytes for {} of {name}", bytes.len());
    match result {
        Ok(loaded) => {
            for t in &loaded.mesh.triangles {
                assert!(t.iter().all(|&i| (i as usize) < loaded.mesh.positions.len()));
            }
            assert!(loaded.mesh.positions.iter().all(|p| p.is_finite()));
            for parallel in [loaded.mesh.uvs.len(), loaded.mesh.material_of.len()] {
                assert!(parallel == 0 || parallel == loaded.mesh.triangles.len());
            }
            assert!(loaded.mesh.material_of.iter().all(|&m| usize::from(m) < loaded.mesh.materials.len()));
            assert!([0, loaded.mesh.triangles.len()].contains(&loaded.mesh.corner_colors.len()));
            let mut baked = loaded.mesh.clone();
            baked.bake_base_color(None);
            assert!(baked.corner_colors.is_empty());
            let _ = close(loaded.mesh);
        }
        Err(error) => assert!(!error.to_string().contains('\n'), "{error}"),
    }
}

const COLORED_PLY: &[u8] =
    b"ply\nformat ascii 1.0\ncomment TextureFile paint.png\nelement vertex 4\nproperty float x\n\
    property float y\nproperty float z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\nelement face 1\n\
    property list uchar int vertex_indices\nproperty list uchar float texcoord\nproperty int texnumber\n\
    element tristrips 1\nproperty list int int vertex_indices\nend_header\n0 0 0 1 2 3\n1 0 0 200 0 0\n1 1 0 0 9 9\n\
    .2 .1 0 7 7 7\n4 0 1 2 3 8 0 0 1 0 1 1 0 1 -1\n4 0 1 -1 2\n";

const GROUPED_3MF: &str = "<model xmlns:m='m'><resources><m:colorgroup id='5'><m:color color='#C82828'/><m:color \
    color='#2828C8'/>\
    </m:colorgroup><object id='1' pid='5' pindex='0'><mesh><vertices><vertex x='0' y='0' z='0'/><vertex x='1' y='0' \
    z='0'/>\
    <vertex x='0' y='1' z='0'/><vertex x='0' y='0' z='1'/></vertices><triangles><triangle v1='0' v2='2' v3='1'/>\
    <triangle v1='0' v2='1' v3='3' p1='0' p2='1' p3='1'/><triangle v1='0' v2='3' v3='2'/></triangles></mesh></object>\
    </resources><build><item objectid='1'/></build></model>";

const RANGES: &str = "<config><object id='1'><volume firstid='0' lastid='1'><metadata type='volume' key='volume_type' \
    value='ParameterModifier'/></volume></object></config>";

fn samples() -> Vec<(&'static str, Vec<u8>)> {
    let sample = writers::sample();
    let png = writers::png(&sample);
    vec![
        ("a.obj", writers::obj(&sample).into_bytes()),
        ("b.obj", b"v 0 0 0 1 0 0 # near\nv 1 0 0 0 1 0\nv 1 1 0 0 0 1\nv .2 .1 0 1 1 1\nf 1 2 \\\n3 4".to_vec()),
        ("d.ply", COLORED_PLY.to_vec()),
        (
            "b.3mf",
            writers::threemf_parts(&[
                ("_RELS/.rels", writers::rels("3d/3DModel.model").into_bytes()),
                ("3D/3dmodel.model", GROUPED_3MF.into()),
                ("Metadata/Slic3r_PE_model.config", RANGES.into()),
            ]),
        ),
        ("a.stl", writers::stl_binary(&sample)),
        ("b.stl", writers::stl_text(&sample).into_bytes()),
        ("a.ply", writers::ply(&sample, writers::Ply::Text)),
        ("b.ply", writers::ply(&sample, writers::Ply::Little)),
        ("c.ply", writers::ply(&sample, writers::Ply::Big)),
        ("a.glb", writers::glb(&sample)),
        ("a.3mf", writers::threemf_of(&writers::threemf_model(&sample), &png)),
    ]
}

/// Companions of the samples, so that damage reaches the material library and the image too.
fn folder_with_companions() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    writers::put(folder.path(), "paint job.mtl", writers::MTL);
    writers::put(folder.path(), "paint.png", writers::png(&writers::sample()));
    folder
}

fn flip(bytes: &mut [u8], flips: &[(Index, u8)]) {
    for (index, mask) in flips {
        let i = index.index(bytes.len());
        bytes[i] ^= mask;
    }
}

fn flips() -> impl Strategy<Value = Vec<(Index, u8)>> {
    prop::collection::vec((any::<Index>(), any::<u8>()), 1..8)
}

/// Few cases by default; `PROPTEST_CASES=5000` is the long run.
fn config() -> ProptestConfig {
    let cases = std::env::var("PROPTEST_CASES").ok().and_then(|n| n.parse().ok()).unwrap_or(40);
    ProptestConfig { cases, failure_persistence: None, ..ProptestConfig::default() }
}

proptest! {
    #![proptest_config(config())]

    #[test]
    fn truncated_and_flipped(cut in any::<Index>(), flips in flips()) {
        let folder = folder_with_companions();
        for (name, good) in samples() {
            survives(folder.path(), name, &good[..cut.index(good.len())]);
            let mut bytes = good.clone();
            flip(&mut bytes, &flips);
            survives(folder.path(), name, &bytes);
            // Headers are where the lies are told.
            let mut bytes = good;
            let head = bytes.len().min(400);
            flip(&mut bytes[..head], &flips);
            survives(folder.path(), name, &bytes);
        }
    }

    #[test]
    fn a_part_of_a_3mf_flipped(flips in flips()) {
        let folder = folder_with_companions();
        let sample = writers::sample();
        let mut model = writers::threemf_model(&sample).into_bytes();
        flip(&mut model, &flips);
        let mut png = writers::png(&sample);
        flip(&mut png, &flips);
        survives(folder.path(), "a.3mf", &writers::threemf_of(&String::from_utf8_lossy(&model), &png));
    }

    #[test]
    fn gltf_with_other_numbers(at in any::<Index>(), number in prop_oneof![
        Just("-1".to_owned()), Just("0".to_owned()), Just("1e99".to_owned()), Just("null".to_owned()),
        any::<u64>().prop_map(|n| n.to_string()), (0..300u32).prop_map(|n| n.to_string()),
    ]) {
        let folder = folder_with_companions();
        let good = writers::glb(&writers::sample());
        let json_length = u32::from_le_bytes(good[12..16].try_into().unwrap()) as usize;
        let json = std::str::from_utf8(&good[20..20 + json_length]).unwrap();
        // Replaces the first number after a random place.
        let start = at.index(json.len());
        let from = json[start..].find(|c: char| c.is_ascii_digit()).map_or(0, |i| start + i);
        let to = json[from..].find(|c: char| !c.is_ascii_digit()).map_or(json.len(), |i| from + i);
        let edited = format!("{}{number}{}", &json[..from], &json[to..]);
        if let Ok(value) = serde_json::from_str(&edited) {
            survives(folder.path(), "a.glb", &writers::glb_of(&value, &good[28 + json_length..]));
        }
    }

    #[test]
    fn text_with_words_replaced(at in any::<Index>(), word in "[-0-9a-z/.]{0,12}") {
        let folder = folder_with_companions();
        for (name, good) in samples().into_iter().filter(|(_, bytes)| std::str::from_utf8(bytes).is_ok()) {
            let text = String::from_utf8(good).unwrap();
            let start = at.index(text.len());
            let end = text[start..].find(char::is_whitespace).map_or(text.len(), |i| start + i);
            survives(folder.path(), name, format!("{}{word}{}", &text[..start], &text[end..]).as_bytes());
        }
        survives(folder.path(), "m.obj", b"mtllib m.mtl\nusemtl a\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3");
        writers::put(folder.path(), "m.mtl", format!("newmtl a\nKd {word} {word}\nmap_Kd -o {word}\nd {word}"));
        survives(folder.path(), "m.obj", b"mtllib m.mtl\nusemtl a\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3");
    }

    #[test]
    fn random_bytes(bytes in prop::collection::vec(any::<u8>(), 0..600), which in 0..8usize) {
        let folder = tempfile::tempdir().unwrap();
        let start: &[u8] = [&b""[..], b"solid ", b"ply\n", b"ply\nformat binary_little_endian \
            1.0\n", b"glTF\x02\0\0\0", b"PK\x03\x04", b"{", b"v "][which];
        let bytes = [start, &bytes].concat();
        for name in ["a.obj", "a.stl", "a.ply", "a.glb", "a.3mf", "a"] {
            survives(folder.path(), name, &bytes);
        }
    }
}

#[test]
fn headers_that_claim_billions_reserve_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let ply = b"ply\nformat binary_little_endian 1.0\nelement vertex 4294967295\nproperty float x\nproperty float y\n\
                property float z\nelement face 4294967295\nproperty list uint int \
                vertex_indices\nend_header\n1234567890";
    survives(folder.path(), "a.ply", ply);
    let mut stl = vec![b' '; 80];
    stl.extend([0xff; 104]);
    survives(folder.path(), "a.stl", &stl);
}
