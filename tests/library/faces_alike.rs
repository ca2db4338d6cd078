//! Do all faces of a cube look alike? The same stacking meets voxels from six sides; photons judge the middles.

use std::fs;

use glam::{DVec3, Vec3Swizzles};
use lumislice::{
    job::{Job, Prepared},
    look::{Scene, Site, Spot, Volume},
    optics::{MaterialSet, Mixture},
    watch::Unwatched,
};

use crate::common::box_triangles;

const EDGE_MM: f64 = 12.0;

/// The cube as an OBJ file.
fn cube() -> String {
    let corners = box_triangles(DVec3::ZERO, DVec3::splat(EDGE_MM));
    let vertices = corners.iter().flatten().map(|p| format!("v {} {} {}\n", p.x, p.y, p.z));
    let faces = (0..corners.len()).map(|n| format!("f {} {} {}\n", 3 * n + 1, 3 * n + 2, 3 * n + 3));
    vertices.chain(faces).collect()
}

/// Printed albedo in the middle of each face, and one standard deviation.
fn faces(printer: &str, stack: &str, dither: bool, walks: u64) -> Vec<[f64; 2]> {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("cube.obj"), cube()).unwrap();
    let text = format!(
        "[[object]]\nmesh = \"cube.obj\"\n[printer]\npreset = \"{printer}\"\n[materials]\nset = \"synthetic\"\n\
         [target]\nkind = \"stacking\"\nstack = \"{stack}\"\n[field]\ndither = {dither}\n[output]\nformats = \
         [\"png\"]\n"
    );
    let job = Job::from_toml(&text, folder.path().join("job.toml"), folder.path()).unwrap();
    let prepared = Prepared::new(job, &Unwatched).unwrap();
    let mut volume = Volume::new(prepared.lattice).unwrap();
    let done: Result<(), std::convert::Infallible> =
        prepared.slicer().for_each_slab(0..prepared.lattice.dims[2], |slab| {
            volume.add(slab);
            Ok(())
        });
    let Ok(()) = done;
    let set = MaterialSet::builtin("synthetic").unwrap();
    let mut coefficients = vec![set.mixed_volumes(&Mixture::from(set.resin("black").unwrap().0)).unwrap()[0]];
    coefficients.extend(set.ids().map(|resin| set.mixed_volumes(&resin.into()).unwrap()[0]));
    let scene = Scene::new(volume, &[coefficients]).unwrap();
    let middle = DVec3::splat(EDGE_MM / 2.0);
    let spots: Vec<Spot> = [DVec3::X, DVec3::Y, DVec3::Z]
        .into_iter()
        .flat_map(|axis| [-axis, axis])
        .map(|normal| {
            let across = [normal.zxy().abs(), normal.yzx().abs()];
            let steps = || (0..9).map(|n| f64::from(n) * 0.25 - 1.0);
            let site = |a: f64, b: f64| Site {
                point: middle + normal * (EDGE_MM / 2.0) + across[0] * a + across[1] * b,
                normal,
            };
            Spot::of(steps().flat_map(|a| steps().map(move |b| (a, b))).map(|(a, b)| site(a, b)).collect())
        })
        .collect();
    let found = scene.printed_albedo(&spots, walks, 5, &Unwatched).unwrap();
    found.iter().map(|spot| spot[0].as_ref().map(|seen| [seen.mean, seen.standard_error]).unwrap()).collect()
}

/// The greatest deviation from the mean of all faces, as a share of it.
fn spread(what: &str, faces: &[[f64; 2]]) -> f64 {
    let mean = faces.iter().map(|face| face[0]).sum::<f64>() / faces.len() as f64;
    let worst = faces.iter().map(|face| (face[0] / mean - 1.0).abs()).fold(0.0, f64::max);
    let each: Vec<_> = faces.iter().map(|face| format!("{:.4}", face[0])).collect();
    println!(
        "{what}: {} (± {:.4}), worst {:.2}% from the mean",
        each.join(" "),
        faces.iter().map(|face| face[1]).fold(0.0, f64::max),
        100.0 * worst
    );
    worst
}

#[test]
#[ignore = "a proof of some minutes: photons on twelve cubes"]
fn faces_of_a_cube_look_alike_where_boundaries_are_dithered() {
    for printer in ["j750-27um", "connex500-30um"] {
        for stack in [
            "90% white + 10% black:0.25,support:0.5,white:0.3",
            "97% white + 3% black:0.3,support:0.1,white:1.0",
            "white:0.3,black:0.03,white:1.0",
        ] {
            let [steps, dithered] = [false, true].map(|dither| {
                let found = faces(printer, stack, dither, 100_000);
                spread(&format!("{printer}, {stack}, {}", if dither { "dithered" } else { "whole voxels" }), &found)
            });
            assert!(dithered < 0.02, "{printer} {stack}: {dithered}, whole voxels {steps}");
        }
    }
}
