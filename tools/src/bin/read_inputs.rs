//! What the readers make of files, and what that costs: a JSON line for each path of stdin.
//!
//! A mesh is read, baked and closed, and its line tells volume, area, warnings and the colours it shows by share of
//! area; jobs (`.toml`), measured datasets (`.npz`) and profiles (`.csv`) are read alone, `.materials` and `.capture`
//! as the TOML they are. `peak` is the most memory in bytes that was held, all threads together; a panic has its line
//! too. `scripts/damaged-inputs` feeds it damaged files.

#![allow(clippy::print_stdout)] // it prints lines

#[path = "../../../tests/common/counting.rs"]
mod counting;

use std::{
    collections::BTreeMap,
    io::BufRead,
    panic,
    path::Path,
    sync::atomic::{AtomicIsize, Ordering::Relaxed},
    time::Instant,
};

use lumislice::{
    appearance::bssrdf::Dataset,
    colour::{linear_to_byte, srgb_to_linear},
    glam::{DVec3, Vec2},
    job::Job,
    measure::Capture,
    mesh::{LoadOptions, TriangleMesh, close, load},
    optics::{MaterialFile, ProfileFile},
};
use serde_json::{Value, json};

use counting::Counting;

// Bytes that are held, and the most there were.
static HELD: AtomicIsize = AtomicIsize::new(0);
static PEAK: AtomicIsize = AtomicIsize::new(0);

fn count(change: isize) {
    let held = HELD.fetch_add(change, Relaxed) + change;
    PEAK.fetch_max(held, Relaxed);
}

#[global_allocator]
static ALLOCATOR: Counting = Counting(count);

fn main() {
    panic::set_hook(Box::new(|_| ()));
    for line in std::io::stdin().lock().lines() {
        let Ok(path) = line else { break };
        let before = HELD.load(Relaxed);
        PEAK.store(before, Relaxed);
        let begun = Instant::now();
        let read = panic::catch_unwind(|| read(Path::new(&path)));
        let mut said = match read {
            Ok(Ok(said)) => said,
            Ok(Err(error)) => json!({ "error": error }),
            Err(cause) => json!({ "panic": message(cause.as_ref()) }),
        };
        said["path"] = path.into();
        said["seconds"] = begun.elapsed().as_secs_f64().into();
        said["peak"] = (PEAK.load(Relaxed) - before).into();
        println!("{said}");
    }
}

fn message(cause: &(dyn std::any::Any + Send)) -> String {
    let text = cause.downcast_ref::<String>().map(String::as_str);
    text.or_else(|| cause.downcast_ref::<&str>().copied()).unwrap_or("no message").to_owned()
}

fn read(path: &Path) -> Result<Value, String> {
    fn done<T, E: ToString>(read: Result<T, E>) -> Result<Value, String> {
        read.map(|_| json!({})).map_err(|error| error.to_string())
    }
    match path.extension().and_then(|extension| extension.to_str()) {
        Some("toml") => done(Job::load(path)),
        Some("npz") => done(Dataset::open(path, false)),
        Some("csv") => done(ProfileFile::read(path)),
        Some("materials") => done(MaterialFile::read(path)),
        Some("capture") => done(Capture::read(path)),
        _ => mesh(path),
    }
}

fn mesh(path: &Path) -> Result<Value, String> {
    let loaded = load(path, &LoadOptions::default()).map_err(|error| error.to_string())?;
    let mut baked = loaded.mesh.clone();
    baked.bake_base_color(None);
    let colours = colours(&baked);
    let solid = close(loaded.mesh);
    let mut said = json!({ "warnings": loaded.warnings, "lost": loaded.lost_color, "colours": colours });
    match solid {
        Err(error) => said["open"] = error.to_string().into(),
        Ok(solid) => {
            said["volume"] = solid.health.volume_mm3.into();
            said["area"] = solid.health.area_mm2.into();
            said["health"] = solid.health.warnings().into();
            let (low, high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
            let (low, high) =
                solid.mesh.positions.iter().fold((low, high), |(low, high), &p| (low.min(p), high.max(p)));
            said["bounds"] = json!([low.to_array(), high.to_array()]);
        }
    }
    Ok(said)
}

/// Points of a triangle by their weights: the middles of the 16 triangles that its sides' quarters make.
fn points() -> impl Iterator<Item = [f32; 3]> {
    let of = |rows: i32, thirds: i32| (0..rows).flat_map(move |i| (0..rows - i).map(move |j| (i, j, thirds)));
    of(4, 1).chain(of(3, 2)).map(|(i, j, thirds)| {
        let [a, b] = [i, j].map(|at| (at as f32 + thirds as f32 / 3.0) / 4.0);
        [a, b, 1.0 - a - b]
    })
}

/// Share of the area by colour (`#rrggbb`) of a baked mesh, the 12 largest; empty without base colour.
fn colours(mesh: &TriangleMesh) -> Vec<(String, f64)> {
    if mesh.materials.is_empty() {
        return Vec::new();
    }
    let area = |t: &[u32; 3]| {
        let [a, b, c] = t.map(|v| mesh.positions[v as usize]);
        0.5 * (b - a).cross(c - a).length()
    };
    let total: f64 = mesh.triangles.iter().map(area).sum();
    let mut shares: BTreeMap<String, f64> = BTreeMap::new();
    for (t, triangle) in mesh.triangles.iter().enumerate() {
        for weights in points() {
            let [r, g, b] = colour_at(mesh, t, weights).map(|value| linear_to_byte(value.into()));
            *shares.entry(format!("#{r:02x}{g:02x}{b:02x}")).or_default() += area(triangle) / total / 16.0;
        }
    }
    let mut shares: Vec<_> = shares.into_iter().collect();
    shares.sort_by(|a, b| b.1.total_cmp(&a.1));
    shares.truncate(12);
    shares
}

fn colour_at(mesh: &TriangleMesh, t: usize, weights: [f32; 3]) -> [f32; 3] {
    let material = &mesh.materials[usize::from(mesh.material_of.get(t).copied().unwrap_or(0))];
    let [r, g, b, _] = material.base_color;
    let (Some(texture), Some(uvs)) = (&material.base_color_texture, mesh.uvs.get(t)) else { return [r, g, b] };
    let uv: Vec2 = uvs.iter().zip(weights).map(|(uv, weight)| *uv * weight).sum();
    let texel = |at: f32, size: u32| ((at.rem_euclid(1.0) * size as f32) as u32).min(size - 1) as usize;
    let [tr, tg, tb, _] =
        texture.texels[texel(uv.x, texture.width) + texture.width as usize * texel(uv.y, texture.height)];
    let [tr, tg, tb] = [tr, tg, tb].map(|byte| srgb_to_linear(f32::from(byte) / 255.0));
    [tr * r, tg * g, tb * b]
}
