//! The output folder: what is somebody else's is never touched.

use std::fs;

use crate::support::Bench;

#[test]
fn a_folder_with_something_in_it_is_refused() {
    let bench = Bench::new();
    bench.write("out/thesis.tex", b"mine");
    bench.run(["slice", "job.toml", "-o", "out"]).refuses(2, &["out", "not empty", "--overwrite"]);
    bench.run(["slice", "job.toml", "-o", "out", "--overwrite"]).refuses(2, &["neither a manifest.json"]);
    bench.run(["slice", "job.toml", "-o", "out", "--resume"]).refuses(2, &["neither a manifest.json"]);
    bench.write("out/manifest.json", br#"{"files": [{"path": "../job.toml", "bytes": 1, "sha256": ""}]}"#);
    bench.run(["slice", "job.toml", "-o", "out", "--overwrite"]).refuses(2, &["../job.toml", "not inside the folder"]);
    assert_eq!(bench.files("out").len(), 2);
    fs::create_dir(bench.path("empty")).unwrap();
    bench.slice("empty");
}

#[test]
fn overwriting_replaces_what_the_manifest_lists() {
    let bench = Bench::new();
    bench.slice("out");
    bench.write("out/slices/mine.png", b"mine");
    bench.write("out/notes/mine.txt", b"mine");
    // A coarser job: fewer slices, and no masks.
    bench.job_with("0.2, 0.2, 0.2", "0.2, 0.2, 0.4");
    let job = fs::read_to_string(bench.path("job.toml")).unwrap().replace(", \"masks\"", "");
    bench.write("job.toml", job.as_bytes());
    bench.run(["slice", "job.toml", "-o", "out", "--overwrite"]).exits(0);
    let files = bench.files("out");
    assert_eq!(files["slices/mine.png"], b"mine");
    assert_eq!(files["notes/mine.txt"], b"mine");
    assert_eq!(files.keys().filter(|path| path.starts_with("slices/slice_")).count(), 10);
    assert_eq!(files.keys().filter(|path| path.starts_with("masks/")).count(), 0);
    let ran = bench.run(["verify", "out"]).exits(1);
    assert_eq!(ran.stdout.lines().count(), 2, "only the foreign files are odd: {}", ran.stdout);
}

#[test]
fn a_foreign_file_under_a_needed_name_is_not_replaced() {
    let bench = Bench::new();
    bench.job_with("0.2, 0.2, 0.2", "0.2, 0.2, 0.4");
    bench.slice("out");
    bench.write("out/slices/slice_12.png", b"mine");
    bench.write("job.toml", crate::support::JOB.as_bytes());
    let ran = bench.run(["slice", "job.toml", "-o", "out", "--overwrite"]);
    ran.refuses(2, &["slices/slice_12.png", "did not write"]);
    assert_eq!(bench.files("out")["slices/slice_12.png"], b"mine");
}

#[test]
fn an_earlier_job_survives_a_bad_one() {
    let bench = Bench::new();
    bench.slice("out");
    let before = bench.files("out");
    bench.job_with("white:0.5", "whit:0.5");
    bench.run(["slice", "job.toml", "-o", "out", "--overwrite"]).refuses(2, &["whit"]);
    bench.job_with("\"cube.stl\"", "\"job.toml\"");
    bench.run(["slice", "job.toml", "-o", "out", "--overwrite"]).exits(2);
    assert_eq!(bench.files("out"), before);
}

#[test]
fn a_file_is_no_folder() {
    let bench = Bench::new();
    bench.write("file", b"");
    bench.run(["slice", "job.toml", "-o", "file"]).refuses(2, &["file: found a file, expected a folder"]);
    bench.run(["slice", "job.toml", "-o", "file/out"]).refuses(2, &["file/out: found a file, expected a folder"]);
    assert_eq!(bench.files("")["file"], b"");
}

/// No user, not even root, creates folders in /proc.
#[cfg(target_os = "linux")]
#[test]
fn a_folder_that_cannot_be_written_is_3_before_the_slow_work() {
    let bench = Bench::new();
    let ran = bench.run(["slice", "job.toml", "-o", "/proc/lumislice"]);
    assert_eq!(ran.stderr.matches("os error").count(), 1, "a cause is told once: {}", ran.stderr);
    ran.refuses(3, &["/proc", "writing into the folder failed"]);
}
