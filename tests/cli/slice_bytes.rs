//! The same input gives the same bytes: again, in parts, on any number of threads.

use std::collections::BTreeMap;

use crate::support::{Bench, JOB, sphere, stl};

/// A job with every stage in it: clusters, a search, slices, masks, meshes, pictures.
fn full_job(bench: &Bench) {
    bench.write("ball.stl", &stl(&sphere(2.5, 12)));
    let job = JOB
        .replace("cube.stl", "ball.stl")
        .replace("kind = \"stacking\"\nstack = \"white:0.5,support:0.6\"", "kind = \"texture\"\nalbedo-value = 0.4")
        .replace("core = \"black\"", "core = \"black\"\nunits = 32\ndepth = 3\nmax-thickness-mm = 2")
        .replace("[\"png\", \"masks\"]", "[\"png\", \"masks\", \"stl\", \"3mf\", \"preview\"]\nmesh-pitch-mm = 0.25");
    bench.write("job.toml", job.as_bytes());
}

#[test]
fn threads_and_repetition_change_nothing() {
    let bench = Bench::new();
    full_job(&bench);
    let mut runs: Vec<BTreeMap<String, Vec<u8>>> = Vec::new();
    for (out, threads) in [("a", "1"), ("b", "2")] {
        let mut command = bench.command(["slice", "job.toml", "-o", out]);
        let output = command.env("RAYON_NUM_THREADS", threads).output().unwrap();
        crate::support::Ran::from(output).exits(0);
        runs.push(bench.files(out));
    }
    assert!(runs[0].contains_key("manifest.json") && runs[0].keys().any(|path| path.ends_with(".3mf")));
    {
        let other = &runs[1];
        assert_eq!(runs[0].keys().collect::<Vec<_>>(), other.keys().collect::<Vec<_>>());
        let odd: Vec<_> =
            runs[0].iter().filter(|(path, bytes)| other[*path] != **bytes).map(|(path, _)| path).collect();
        assert!(odd.is_empty(), "{odd:?}");
    }
    let manifest = String::from_utf8(runs[0]["manifest.json"].clone()).unwrap();
    assert!(!manifest.contains(bench.path("").to_str().unwrap()), "no absolute paths");
    bench.run(["verify", "a"]).exits(0);
}

#[test]
fn parts_are_parts_of_the_whole() {
    let bench = Bench::new();
    bench.slice("whole");
    let whole = bench.files("whole");
    for range in ["0..7", "7..20", "12..13"] {
        bench.run(["slice", "job.toml", "-o", range, "--slices", range]).exits(0);
        let part = bench.files(range);
        let (a, b) = range.split_once("..").unwrap();
        let slices = b.parse::<usize>().unwrap() - a.parse::<usize>().unwrap();
        assert_eq!(part.keys().filter(|path| path.starts_with("slices/")).count(), slices);
        assert!(part.contains_key(&format!("slices/slice_{a}.png")), "names keep their number");
        for (path, bytes) in part.iter().filter(|(path, _)| *path != "manifest.json") {
            assert!(whole[path] == *bytes, "{path} of {range}");
        }
        bench.run(["verify", range]).exits(0);
    }
    bench.run(["slice", "job.toml", "-o", "x", "--slices", "7..21"]).refuses(2, &["7..21", "0..20"]);
    assert!(!bench.path("x").exists());
    for range in ["0..7", "12..13"] {
        bench.run(["preview", range]).exits(0);
        let drawn = bench.files(range);
        assert!(drawn.contains_key("preview/cutaway.png") && drawn.contains_key("report.html"), "{:?}", drawn.keys());
        bench.run(["verify", range]).exits(0);
    }
}
