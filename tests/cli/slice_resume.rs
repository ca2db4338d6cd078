//! `--resume`: an interrupted job ends with the bytes of one that was not.

use std::fs;

use crate::support::Bench;

/// Makes `out`, a finished folder, what an interrupted run leaves after `slices` slices.
fn interrupt(bench: &Bench, slices: u32) {
    let manifest = bench.manifest("out");
    let stackings: serde_json::Value = serde_json::from_slice(&bench.files("out")["stackings.json"]).unwrap();
    let task = serde_json::json!({ "task": {
        "command": "slice", "generator": manifest["generator"], "sha256": stackings["sha256"],
        "slices": manifest["slices"], "replaces": [],
    }});
    let mut journal = format!("{task}\n");
    let later = |path: &str| {
        let number = path.rsplit_once('_').and_then(|(_, end)| end.strip_suffix(".png")?.parse::<u32>().ok());
        number.is_some_and(|k| k >= slices)
    };
    for file in manifest["files"].as_array().unwrap() {
        let path = file["path"].as_str().unwrap();
        if later(path) {
            fs::remove_file(bench.path("out").join(path)).unwrap();
        } else {
            journal += &format!("{}\n", serde_json::json!({ "file": file }));
        }
    }
    // Slabs of the cube: white, 0.5 mm deep, then support, then the core.
    for k in 0..slices {
        journal += &format!("{}\n", serde_json::json!({ "slice": { "slice": k, "counts": { "1": 400 } } }));
    }
    bench.write("out/journal.jsonl", journal.as_bytes());
    for path in ["out/manifest.json", "out/timings.json"] {
        fs::remove_file(bench.path(path)).unwrap();
    }
}

#[test]
fn what_is_whole_is_kept_and_the_rest_made_again() {
    let bench = Bench::new();
    bench.slice("whole");
    bench.slice("out");
    interrupt(&bench, 2); // the two lowest slices are all white
    bench.write("out/slices/slice_1.png", b"damaged");
    let kept = fs::metadata(bench.path("out/slices/slice_0.png")).unwrap().modified().unwrap();
    let ran = bench.run(["slice", "job.toml", "-o", "out", "--resume"]).exits(0);
    assert!(ran.stderr.contains("1 of 20 slices were there and whole"), "{}", ran.stderr);
    assert_eq!(fs::metadata(bench.path("out/slices/slice_0.png")).unwrap().modified().unwrap(), kept);
    assert_eq!(bench.files("out"), bench.files("whole"));
    assert!(bench.path("out/timings.json").is_file());
    bench.run(["verify", "out"]).exits(0);
}

#[test]
fn a_finished_job_is_left_as_it_is_and_an_empty_folder_begun() {
    let bench = Bench::new();
    bench.run(["slice", "job.toml", "-o", "out", "--resume"]).exits(0);
    let before = bench.files("out");
    let ran = bench.run(["slice", "job.toml", "-o", "out", "--resume"]).exits(0);
    assert!(ran.stderr.contains("20 of 20 slices"), "{}", ran.stderr);
    assert_eq!(bench.files("out"), before);
}

#[test]
fn another_job_does_not_go_on() {
    let bench = Bench::new();
    bench.slice("out");
    let part = ["slice", "job.toml", "-o", "out", "--resume", "--slices", "0..5"];
    bench.run(part).refuses(2, &["manifest.json", "slices 0..20", "0..5", "--overwrite"]);
    interrupt(&bench, 2);
    let before = bench.files("out");
    bench.run(part).refuses(2, &["journal.jsonl", "slices 0..20", "0..5", "--overwrite"]);
    bench.job_with("white:0.5", "white:0.6");
    bench.run(["slice", "job.toml", "-o", "out", "--resume"]).refuses(2, &["journal.jsonl", "digest"]);
    assert_eq!(bench.files("out"), before);
    // Overwriting clears away what the other one wrote.
    bench.run(["slice", "job.toml", "-o", "out", "--overwrite"]).exits(0);
    bench.run(["verify", "out"]).exits(0);
}

#[test]
fn a_foreign_file_is_not_replaced() {
    let bench = Bench::new();
    bench.slice("out");
    interrupt(&bench, 2);
    bench.write("out/slices/slice_12.png", b"mine");
    bench.run(["slice", "job.toml", "-o", "out", "--resume"]).refuses(2, &["slice_12.png", "did not write"]);
    assert_eq!(bench.files("out")["slices/slice_12.png"], b"mine");
}

#[test]
fn what_another_job_counted_is_not_this_ones() {
    let bench = Bench::new();
    bench.slice("out");
    interrupt(&bench, 2);
    // A journal with a count that no slice of the next job has, and a next job that writes no images.
    let journal = fs::read_to_string(bench.path("out/journal.jsonl")).unwrap().replace("\"1\":400", "\"1\":123");
    bench.write("out/journal.jsonl", journal.as_bytes());
    bench.job_with("\"png\", \"masks\"", "\"stl\"");
    bench.run(["slice", "job.toml", "-o", "out", "--overwrite"]).exits(0);
    bench.slice("fresh");
    assert_eq!(bench.manifest("out")["materials"], bench.manifest("fresh")["materials"]);
}
