//! `look`: printed albedos from the job and from its slices, and what is refused.

use std::collections::BTreeMap;

use glam::DVec3;

use crate::{
    shapes,
    support::{Bench, keys, stl},
};

#[test]
fn the_job_and_its_slices_look_the_same() {
    let bench = Bench::new();
    bench.slice("out");
    let numbers = ["--spots", "8", "--photons", "20000", "--at", "2,2,4", "--json"];
    let field = bench.run(["look", "job.toml"].iter().chain(&numbers)).exits(0).json();
    let slices = bench.run(["look", "out", "--job", "job.toml"].iter().chain(&numbers)).exits(0).json();
    assert_eq!(field, slices);
    let spots = field["spots"].as_array().unwrap();
    assert_eq!(spots.len(), 9);
    assert_eq!(
        keys(&spots[8]),
        ["object", "position_mm", "normal", "asked", "predicted", "sky", "printed", "standard_error", "edge"]
    );
    assert_eq!(field["edge_mm"].as_array().unwrap().len(), 11);
    assert_eq!(spots[8]["normal"], serde_json::json!([0.0, 0.0, 1.0]));
    for spot in spots {
        let [printed, predicted] = ["printed", "predicted"].map(|name| spot[name][0].as_f64().unwrap());
        assert!(
            spot["asked"].is_null() && spot["edge"]["asked"].is_null(),
            "a stacking is given, nothing is asked for"
        );
        // From the shadow into the light, as on a sheet: next to nothing, some half on the edge, nearly all.
        let edge: Vec<f64> =
            spot["edge"]["printed"][0].as_array().unwrap().iter().map(|at| at.as_f64().unwrap() / printed).collect();
        assert!(edge.is_sorted() && edge[0] < 0.2 && edge[10] > 0.8, "{edge:?}");
        assert!((0.3..0.7).contains(&edge[5]), "{edge:?}");
        // Light comes through the sides too, and a flat slab has none.
        assert!(printed > 0.9 * predicted && printed < 0.95, "{spot}");
        assert!(spot["standard_error"][0].as_f64().unwrap() < 0.005);
    }
    assert!(field["against_asked"].is_null());
    assert_eq!(field["against_predicted"].as_array().unwrap().len(), 1);
}

/// Each face of a cube has a sixth of the spots, within three standard deviations: 50 ± 6.5.
#[test]
fn spots_lie_evenly_over_the_surface() {
    let numbers = ["--spots", "300", "--photons", "2", "--json"];
    let found = Bench::new().run(["look", "job.toml"].iter().chain(&numbers)).exits(0).json();
    let mut faces = BTreeMap::new();
    for spot in found["spots"].as_array().unwrap() {
        let normal = [0, 1, 2].map(|axis| spot["normal"][axis].as_f64().unwrap() as i32);
        *faces.entry(normal).or_insert(0) += 1;
    }
    assert!(faces.len() == 6 && faces.values().all(|count| (31..=69).contains(count)), "{faces:?}");
}

/// A narrow well in a block: what shows at its foot has come through the block.
#[test]
fn spots_that_hardly_see_the_sky_count_in_no_mean() {
    let bench = Bench::new();
    let block = |low: [f64; 3], high: [f64; 3]| shapes::box_triangles(DVec3::from(low), DVec3::from(high));
    let sides = [
        block([0.0, 0.0, 0.0], [4.0, 4.0, 1.0]),
        block([0.0, 0.0, 0.0], [1.6, 4.0, 6.0]),
        block([2.4, 0.0, 0.0], [4.0, 4.0, 6.0]),
        block([0.0, 0.0, 0.0], [4.0, 1.6, 6.0]),
        block([0.0, 2.4, 0.0], [4.0, 4.0, 6.0]),
    ];
    let triangles: Vec<_> = sides.concat().iter().map(|t| t.map(|p| p.as_vec3().to_array())).collect();
    bench.write("cube.stl", &stl(&triangles));
    let numbers = ["look", "job.toml", "--spots", "120", "--photons", "200"];
    let look = bench.run(numbers.iter().chain(&["--json"])).exits(0).json();
    let spots = look["spots"].as_array().unwrap();
    let sky = |spot: usize| spots[spot]["sky"].as_f64().unwrap();
    let unlit = (0..spots.len()).filter(|&spot| sky(spot) < 0.3).count();
    assert!((4..40).contains(&unlit), "{unlit}");
    let worst: Vec<usize> = look["worst"].as_array().unwrap().iter().map(|at| at.as_u64().unwrap() as usize).collect();
    assert!(worst.len() == 5 && worst.iter().all(|&at| sky(at) >= 0.3), "{worst:?}");
    // The mean over those that count.
    let apart = |spot: &serde_json::Value| {
        let [v, predicted, printed] =
            [&spot["sky"], &spot["predicted"][0], &spot["printed"][0]].map(|value| value.as_f64().unwrap());
        printed - v * predicted / (1.0 - (1.0 - v) * predicted)
    };
    let lit = || (0..spots.len()).filter(|&spot| sky(spot) >= 0.3);
    let bias = lit().map(|spot| apart(&spots[spot])).sum::<f64>() / lit().count() as f64;
    assert!((look["against_predicted"][0]["bias"].as_f64().unwrap() - bias).abs() < 1e-9, "{bias}");
    let said = bench.run(numbers).exits(0).stdout;
    assert!(said.contains(&format!("not counted: {unlit} that hardly see the sky")), "{said}");
}

/// A spot ends at an edge, whichever face comes first in the file: beside an edge of a cube of one resin both faces
/// show the same.
#[test]
fn beside_an_edge_both_faces_show_the_same() {
    let bench = Bench::new();
    bench.job_with("white:0.5,support:0.6", "white:2");
    let ends = [[0.0, 0.0], [0.0, 4.0], [4.0, 0.0], [4.0, 4.0]];
    let edges: Vec<_> = (0..3).flat_map(|axis| ends.map(|end| (axis, end))).collect();
    let mut words = ["look", "job.toml", "--spots", "1", "--photons", "40000", "--json"].map(str::to_owned).to_vec();
    for &(axis, end) in &edges {
        for face in [0, 1] {
            let mut at = [2.0; 3];
            for side in [0, 1] {
                let inward = if side == face { 0.0 } else { 0.1_f64.copysign(2.0 - end[side]) };
                at[(axis + 1 + side) % 3] = end[side] + inward;
            }
            words.extend(["--at".to_owned(), at.map(|x| x.to_string()).join(",")]);
        }
    }
    let found = bench.run(&words).exits(0).json();
    let spots = &found["spots"].as_array().unwrap()[1..];
    for (spots, edge) in spots.chunks(2).zip(&edges) {
        let [a, b] = [0, 1].map(|face| spots[face]["printed"][0].as_f64().unwrap());
        assert!((a / b - 1.0).abs() < 0.01, "{a} and {b} beside the edge at {edge:?}: {spots:?}");
    }
}

/// Without its job a folder shows the same light; what cannot be known then is said, and what its look.json knows is
/// used.
#[test]
fn a_folder_is_looked_at_without_its_job() {
    let bench = Bench::new();
    bench.slice("out");
    let numbers = ["--photons", "20000", "--at", "2,2,4.3", "--json"];
    let seen = |spots: &str| {
        let alone = bench.run(["look", "out", "--spots", spots].iter().chain(&numbers)).exits(0);
        serde_json::from_str::<serde_json::Value>(&alone.stdout).unwrap()
    };
    let alone = seen("6");
    let job = bench.run(["look", "job.toml", "--spots", "0"].iter().chain(&numbers)).exits(0).json();
    assert_eq!(alone["spots"].as_array().unwrap().len(), 7);
    assert!(alone["warnings"][0].as_str().unwrap().contains("not known"), "{}", alone["warnings"]);
    assert_eq!([&alone["against_asked"], &alone["worst"]], [&serde_json::json!(null), &serde_json::json!([])]);
    for spot in alone["spots"].as_array().unwrap() {
        assert!(spot["asked"].is_null() && spot["predicted"] == serde_json::json!([]), "{spot}");
    }
    // The middle of the top, by the mesh and by the voxels.
    let of = |spot: &serde_json::Value, name: &str| spot[name][0].as_f64().unwrap();
    let (by_voxels, by_mesh) = (&alone["spots"][6], &job["spots"][0]);
    assert!((0..2).all(|axis| by_voxels["normal"][axis].as_f64().unwrap().abs() < 0.05), "{by_voxels}");
    let sigma = of(by_voxels, "standard_error").hypot(of(by_mesh, "standard_error"));
    let apart = of(by_voxels, "printed") - of(by_mesh, "printed");
    assert!(apart.abs() < 4.0 * sigma + 0.005, "{by_voxels} and {by_mesh}");

    // With what an earlier look has written down.
    bench.run(["look", "job.toml", "--spots", "3", "--photons", "500", "--size", "16", "-o", "seen"]).exits(0);
    std::fs::copy(bench.path("seen/look.json"), bench.path("out/look.json")).unwrap();
    let earlier: serde_json::Value =
        serde_json::from_str(&std::fs::read_to_string(bench.path("seen/look.json")).unwrap()).unwrap();
    let again = seen("3");
    assert!(again["warnings"][0].as_str().unwrap().contains("3 spots of look.json"), "{}", again["warnings"]);
    for (spot, earlier) in again["spots"].as_array().unwrap().iter().zip(earlier["spots"].as_array().unwrap()) {
        for name in ["position_mm", "predicted", "sky"] {
            assert_eq!(spot[name], earlier[name]);
        }
    }
    let text =
        bench.run(["look", "out", "--materials", "synthetic", "--spots", "2", "--photons", "100"]).exits(0).stdout;
    assert!(text.contains("2 spots under even light"), "{text}");
    // Pictures, of the print alone.
    bench
        .run(["look", "out", "--spots", "1", "--photons", "2", "--size", "16", "--samples", "1", "-o", "alone"])
        .exits(0);
    assert!(bench.path("alone/soft.png").is_file());
}

#[test]
fn the_numbers_are_written_and_summed_up() {
    let bench = Bench::new();
    let ran =
        bench.run(["look", "job.toml", "--spots", "4", "--photons", "500", "--size", "64", "-o", "seen"]).exits(0);
    assert!(ran.stdout.contains("4 spots under even light") && ran.stdout.contains("worst spots"), "{}", ran.stdout);
    let written = std::fs::read_to_string(bench.path("seen/look.json")).unwrap();
    assert!(written.contains("\"standard_error\""), "{written}");
    bench.run(["look", "job.toml", "--spots", "4", "-o", "seen"]).refuses(2, &["seen", "--overwrite"]);
}

#[test]
fn what_cannot_be_looked_at_is_refused() {
    let bench = Bench::new();
    bench.slice("out");
    bench.run(["look", "job.toml", "--materials", "synthetic"]).refuses(2, &["--materials", "a job"]);
    bench.run(["look", "out", "--job", "job.toml", "--materials", "synthetic"]).exits(2);
    bench.run(["look", "job.toml", "--job", "job.toml"]).refuses(2, &["job.toml", "expected one with --job"]);
    bench.run(["look", "job.toml", "--at", "1,2"]).exits(2);
    bench.run(["look", "job.toml", "--photons", "1"]).exits(2);
    std::fs::remove_file(bench.path("out/slices/slice_3.png")).unwrap();
    bench.run(["look", "out", "--job", "job.toml"]).refuses(2, &["slice_3.png"]);
    std::fs::remove_file(bench.path("out/manifest.json")).unwrap();
    bench.run(["look", "out", "--job", "job.toml"]).refuses(2, &["no manifest.json"]);
}

/// Rounds of correction are slow: a look takes those that a run of the same job left, and says so.
#[test]
fn a_look_at_a_job_takes_the_rounds_of_its_finished_folder() {
    let bench = Bench::new();
    bench.job_with(
        "kind = \"stacking\"\nstack = \"white:0.5,support:0.6\"",
        "kind = \"texture\"\nalbedo-value = 0.3\nmean-free-path-mm = 0.5",
    );
    let job = std::fs::read_to_string(bench.path("job.toml")).unwrap();
    bench.write("job.toml", (job.replace(", \"masks\"", "") + "[appearance]\nrounds = 1\n").as_bytes());
    let look = |more: &[&str]| bench.run(["look", "job.toml", "--spots", "4", "--photons", "500"].iter().chain(more));
    let anew = look(&[]).exits(0);
    assert!(!anew.stderr.contains("rounds of correction"), "{}", anew.stderr);
    bench.slice("job-out");
    let taken = look(&[]).exits(0);
    assert!(taken.stderr.contains("note: rounds of correction as job-out/rounds.json has them"), "{}", taken.stderr);
    assert_eq!(taken.stdout, anew.stdout);
    // Elsewhere they are found where it is said; those of another job are not taken.
    std::fs::rename(bench.path("job-out"), bench.path("elsewhere")).unwrap();
    assert!(look(&["--rounds-from", "elsewhere"]).exits(0).stderr.contains("elsewhere/rounds.json"));
    let other = std::fs::read_to_string(bench.path("job.toml")).unwrap().replace("= 0.3", "= 0.32");
    bench.write("job.toml", other.as_bytes());
    assert!(!look(&["--rounds-from", "elsewhere"]).exits(0).stderr.contains("rounds.json"));
    bench
        .run(["look", "elsewhere", "--rounds-from", "elsewhere"])
        .refuses(2, &["--rounds-from: found a folder without its job", "--job"]);
}
