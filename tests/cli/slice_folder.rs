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
    bench.write("out/manifest.json", &manifest_of("slice", "../job.toml", b""));
    bench.run(["slice", "job.toml", "-o", "out", "--overwrite"]).refuses(2, &["../job.toml", "not inside the folder"]);
    assert_eq!(bench.files("out").len(), 2);
    fs::create_dir(bench.path("empty")).unwrap();
    bench.slice("empty");
}

/// A manifest that lists one file.
fn manifest_of(command: &str, path: &str, content: &[u8]) -> Vec<u8> {
    use sha2::Digest;
    let sha256: String = sha2::Sha256::digest(content).iter().map(|byte| format!("{byte:02x}")).collect();
    let files = [serde_json::json!({ "path": path, "bytes": content.len(), "sha256": sha256 })];
    serde_json::json!({ "generator": "lumislice 0.1.0", "command": command, "files": files }).to_string().into()
}

#[test]
fn a_manifest_gives_no_leave_to_remove_what_the_command_does_not_write() {
    let bench = Bench::new();
    let overwrite = ["slice", "job.toml", "-o", "out", "--overwrite"];
    bench.write("out/thesis.tex", b"mine");
    bench.write("out/manifest.json", &manifest_of("slice", "thesis.tex", b"mine"));
    bench.run(overwrite).refuses(2, &["thesis.tex", "slice does not write"]);
    bench.write("out/slices/slice_0.png", b"changed by hand");
    bench.write("out/manifest.json", &manifest_of("slice", "slices/slice_0.png", b"as it was"));
    bench.run(overwrite).refuses(2, &["slices/slice_0.png", "changed since"]);
    bench.write("out/manifest.json", &manifest_of("factor", "slices/slice_0.png", b"changed by hand"));
    bench.run(overwrite).refuses(2, &["output of factor", "expected that of slice"]);
    bench.write("out/manifest.json", br#"{"generator": "another program 3", "command": "slice", "files": []}"#);
    bench.run(overwrite).refuses(2, &["another program 3"]);
    assert_eq!(bench.files("out")["slices/slice_0.png"], b"changed by hand");
    assert_eq!(bench.files("out")["thesis.tex"], b"mine");
}

#[test]
fn inputs_among_what_would_be_replaced_are_refused() {
    let bench = Bench::new();
    // The mesh is one that the earlier job wrote.
    bench.job_with("\"png\", \"masks\"", "\"stl\"");
    bench.slice("out");
    let before = bench.files("out");
    bench.job_with("cube.stl", "out/meshes/white.stl");
    let ran = bench.run(["slice", "job.toml", "-o", "out", "--overwrite"]);
    ran.refuses(2, &["out/meshes/white.stl", "an input of this run"]);
    assert_eq!(bench.files("out"), before);
    bench.slice("elsewhere");
}

/// Links below the folder lead nowhere: neither writes nor removals follow them.
#[cfg(unix)]
#[test]
fn links_below_the_folder_are_not_followed() {
    use std::os::unix::fs::symlink;
    let bench = Bench::new();
    bench.slice("out");
    bench.write("victim.txt", b"precious");
    // Names of unfinished files cannot be guessed, and were once.
    symlink(bench.path("victim.txt"), bench.path("out/slices/slice_3.png.part")).unwrap();
    bench.run(["slice", "job.toml", "-o", "out", "--overwrite"]).exits(0);
    // A file in the way that is a link.
    fs::remove_file(bench.path("out/slices/slice_4.png")).unwrap();
    symlink(bench.path("victim.txt"), bench.path("out/slices/slice_4.png")).unwrap();
    bench.run(["slice", "job.toml", "-o", "out", "--overwrite"]).refuses(2, &["slices/slice_4.png"]);
    assert_eq!(fs::read(bench.path("victim.txt")).unwrap(), b"precious");
    // A subfolder elsewhere, holding the very files.
    fs::remove_file(bench.path("out/slices/slice_4.png")).unwrap();
    fs::rename(bench.path("out/slices"), bench.path("elsewhere")).unwrap();
    symlink(bench.path("elsewhere"), bench.path("out/slices")).unwrap();
    let before = bench.files("elsewhere");
    let ran = bench.run(["slice", "job.toml", "-o", "out", "--overwrite"]);
    ran.refuses(2, &["out/slices: found a link, expected a folder"]);
    assert_eq!(bench.files("elsewhere"), before);
}

/// A process that is at work in a folder has it to itself.
#[cfg(unix)]
#[test]
fn a_folder_at_work_is_busy() {
    let bench = Bench::new();
    bench.slice("out");
    let held = fs::File::open(bench.path("out")).unwrap();
    held.lock().unwrap();
    let overwrite = ["slice", "job.toml", "-o", "out", "--overwrite"];
    bench.run(overwrite).refuses(2, &["out: found another run of lumislice at work there"]);
    bench.run(["preview", "out"]).refuses(2, &["another run"]);
    drop(held);
    bench.run(overwrite).exits(0);
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
