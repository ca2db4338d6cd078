//! Colour is read, or said to be lost: every source of it that a format has.

mod gltf;
mod obj;
mod ply;
mod threemf;

use glam::{DVec3, Vec2};
use lumislice::mesh::{LoadOptions, Loaded, close, load};

use self::{obj::obj, ply::ply};
use super::{
    painted::{assert_shares, shares},
    writers::put,
};

const RED: [u8; 3] = [200, 40, 40];
const BLUE: [u8; 3] = [40, 40, 200];
const GREEN: [u8; 3] = [30, 150, 60];

/// A picture, texels row by row from the top.
fn png(width: u32, texels: &[[u8; 4]]) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, width, texels.len() as u32 / width);
    encoder.set_color(png::ColorType::Rgba);
    encoder.set_depth(png::BitDepth::Eight);
    let mut writer = encoder.write_header().unwrap();
    writer.write_image_data(&texels.concat()).unwrap();
    writer.finish().unwrap();
    bytes
}

fn opaque([r, g, b]: [u8; 3]) -> [u8; 4] {
    [r, g, b, 255]
}

/// Red on the left, blue on the right.
fn halves() -> Vec<u8> {
    png(4, &[RED, RED, BLUE, BLUE].map(opaque).repeat(4))
}

/// Reads the first of the files, which lie in one folder.
fn read(files: &[(&str, Vec<u8>)]) -> Loaded {
    let folder = tempfile::tempdir().unwrap();
    let paths: Vec<_> = files.iter().map(|(name, bytes)| put(folder.path(), name, bytes)).collect();
    load(&paths[0], &LoadOptions::default()).unwrap_or_else(|error| panic!("{error}"))
}

fn lost(loaded: &Loaded) -> &str {
    loaded.lost_color.as_deref().unwrap_or("")
}

fn said(loaded: &Loaded, part: &str) -> bool {
    loaded.warnings.iter().any(|warning| warning.contains(part))
}

const FACES: [[usize; 4]; 6] = [[1, 4, 3, 2], [5, 6, 7, 8], [1, 2, 6, 5], [2, 3, 7, 6], [3, 4, 8, 7], [4, 1, 5, 8]];
const POINTS: [[u8; 3]; 8] = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]];

#[test]
fn concave_polygons_have_their_area_and_their_texture() {
    // An arrowhead of area 2 × 1 / 2 … drawn from a corner that does not see all of it, in each format with polygons.
    let rim = [[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [3.0, 1.0]];
    let area: f64 = 4.0;
    let prism = |z: f32| rim.map(|[x, y]| format!("{x} {y} {z}"));
    let points: Vec<String> = [prism(0.0), prism(1.0)].concat();
    let faces =
        [vec![3, 2, 1, 0], vec![4, 5, 6, 7], vec![0, 1, 5, 4], vec![1, 2, 6, 5], vec![2, 3, 7, 6], vec![3, 0, 4, 7]];
    let mut obj: String = points.iter().map(|p| format!("v {p}\nvt {}\n", p.rsplit_once(' ').unwrap().0)).collect();
    let mut ply = format!(
        "ply\nformat ascii 1.0\nelement vertex 8\nproperty float x\nproperty float y\nproperty float z\nproperty \
            float s\n\
         property float t\nelement face 6\nproperty list uchar int vertex_indices\nend_header\n{}",
        points.iter().map(|p| format!("{p} {}\n", p.rsplit_once(' ').unwrap().0)).collect::<String>()
    );
    for face in &faces {
        obj += &format!("f {}\n", face.iter().map(|p| format!("{0}/{0}", p + 1)).collect::<Vec<_>>().join(" "));
        ply += &format!("{} {}\n", face.len(), face.iter().map(ToString::to_string).collect::<Vec<_>>().join(" "));
    }
    for (name, text) in [("a.obj", obj), ("a.ply", ply)] {
        let loaded = read(&[(name, text.into_bytes())]);
        for (triangle, uvs) in loaded.mesh.triangles.iter().zip(&loaded.mesh.uvs) {
            for (&v, uv) in triangle.iter().zip(uvs) {
                let p = loaded.mesh.positions[v as usize];
                assert_eq!(*uv, Vec2::new(p.x as f32, 1.0 - p.y as f32));
            }
        }
        let health = close(loaded.mesh).unwrap().health;
        let sides: f64 = (0..4)
            .map(|i| {
                DVec3::from([rim[i][0], rim[i][1], 0.0].map(f64::from))
                    .distance(DVec3::from([rim[(i + 1) % 4][0], rim[(i + 1) % 4][1], 0.0].map(f64::from)))
            })
            .sum();
        assert!((health.area_mm2 - 2.0 * area - sides).abs() < 1e-9, "{name}: {}", health.area_mm2);
        assert!((health.volume_mm3 - area).abs() < 1e-9 && health.flipped_triangles == 0, "{name}");
    }
}

/// One value a little beyond 1 is rounding, or light; it turns no fractions into bytes.
#[test]
fn values_beyond_1_do_not_make_bytes_of_fractions() {
    let named = "property float red\nproperty float green\nproperty float blue\n";
    for beyond in ["1.000001", "1.5", "3", "10"] {
        // Seven corners red, one red beyond its full value.
        let behind =
            |i: usize| if i == 6 { format!("{beyond} 0.156863 0.156863") } else { "1 0.156863 0.156863".into() };
        let expected = [([255, 40, 40], 1.0)];
        assert_shares(&read(&[("a.obj", obj("", behind, None)), ("a.mtl", Vec::new())]), &expected);
        let none = ("", &(|_| String::new()) as &dyn Fn(usize) -> String);
        assert_shares(&read(&[("a.ply", ply("", (named, &behind), none))]), &expected);
    }
    for bytes in ["200 40 40", "200.5 40.25 40", "200 1 0"] {
        let loaded = read(&[("a.obj", obj("", |_| bytes.to_owned(), None)), ("a.mtl", Vec::new())]);
        let (red, share) = shares(&loaded).into_iter().next().unwrap();
        assert!((200..202).contains(&red[0]) && red[1] < 41 && share > 0.99, "{red:?}");
    }
}
