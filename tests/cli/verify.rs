//! `verify` and `preview` on a real folder. Every kind of damage is held in the library's tests.

use std::fs;

use serde_json::json;

use crate::support::{Bench, keys, run};

fn sliced() -> Bench {
    let bench = Bench::new();
    bench.slice("out");
    bench
}

#[test]
fn a_fresh_folder_is_sound() {
    let bench = sliced();
    let ran = bench.run(["verify", "out"]).exits(0);
    assert_eq!(ran.stdout, "");
    assert!(ran.stderr.contains("20 slices: sound"), "{}", ran.stderr);
    let json = bench.run(["verify", "out", "--json"]).exits(0).json();
    assert_eq!(keys(&json), ["ok", "files", "bytes", "slices", "voxels", "findings"]);
    assert_eq!((json["ok"].as_bool(), json["slices"].as_u64()), (Some(true), Some(20)));
}

#[test]
fn a_flipped_byte_a_lost_slice_and_a_stray_file_are_found() {
    let bench = sliced();
    let path = bench.path("out/slices/slice_3.png");
    let mut bytes = fs::read(&path).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 0x10;
    fs::write(&path, bytes).unwrap();
    let ran = bench.run(["verify", "out"]).exits(1);
    assert!(
        ran.stdout.lines().all(|line| line.starts_with("slices/slice_3.png: ") || line.contains("differs")),
        "{}",
        ran.stdout
    );
    assert!(ran.stdout.contains("SHA-256"));

    let bench = sliced();
    fs::remove_file(bench.path("out/slices/slice_7.png")).unwrap();
    bench.write("out/slices/slice_20.png", b"");
    let ran = bench.run(["verify", "out"]).exits(1);
    let lines: Vec<_> = ran.stdout.lines().collect();
    assert_eq!(lines.len(), 2, "{}", ran.stdout);
    assert_eq!(lines[0], "slices/slice_7.png: missing");
    assert!(lines[1].starts_with("slices/slice_20.png: found a file that the manifest does not list"));
    let json = bench.run(["verify", "out", "--json"]).exits(1).json();
    assert_eq!(json["findings"][0]["path"], "slices/slice_7.png");
}

#[test]
fn an_edited_manifest_is_found() {
    let bench = sliced();
    let manifest = bench.manifest("out");
    let edits = [
        ("/materials/0/voxels", json!(7)),
        ("/lattice/dims", json!([20, 20, 4_000_000_000_u32])),
        ("/slices", json!([0, 4_000_000_000_u32])),
        ("/job/object/0/mesh", json!("other.stl")),
        ("/stackings/0/core", json!("white")),
        ("/files/0/path", json!("../job.toml")),
        ("/files/0/sha256", json!(12)),
        ("/lattice", json!([])),
    ];
    for (key, value) in edits {
        let mut edited = manifest.clone();
        *edited.pointer_mut(key).expect(key) = value;
        bench.write("out/manifest.json", edited.to_string().as_bytes());
        let ran = bench.run(["verify", "out"]).exits(1);
        assert!(!ran.stdout.is_empty() && !ran.stderr.contains("panicked"), "{key}");
    }
    bench.write("out/manifest.json", b"{");
    bench.run(["verify", "out"]).exits(1);
    bench.run(["preview", "out"]).refuses(2, &["manifest.json"]);
}

#[test]
fn without_a_manifest_there_is_nothing_to_verify() {
    let bench = Bench::new();
    fs::create_dir(bench.path("empty")).unwrap();
    bench.run(["verify", "empty"]).refuses(2, &["empty: found no manifest.json"]);
    bench.write("factored/manifest.json", br#"{ "generator": "lumislice", "version": 1, "files": [] }"#);
    bench.run(["verify", "factored"]).refuses(2, &["factored/manifest.json", "without slices", "factor"]);
    bench.run(["verify", "none"]).refuses(2, &["none: found nothing"]);
    bench.run(["verify", "cube.stl"]).refuses(2, &["expected the folder"]);
    run(["verify"]).exits(2);
}

#[test]
fn pictures_are_drawn_again_and_listed() {
    let bench = sliced();
    assert!(!bench.path("out/preview").exists());
    let ran = bench.run(["preview", "out"]).exits(0);
    assert!(ran.stdout.lines().any(|line| line.ends_with("report.html")), "{}", ran.stdout);
    let first = bench.files("out");
    assert!(ran.stdout.lines().all(|line| bench.path(line).is_file()));
    bench.run(["verify", "out"]).exits(0);
    bench.run(["preview", "out"]).exits(0);
    assert_eq!(bench.files("out"), first);
    // Slicing over it clears them away again.
    bench.run(["slice", "job.toml", "-o", "out", "--overwrite"]).exits(0);
    assert!(!bench.path("out/report.html").exists());
    bench.write("out/report.html", b"mine");
    bench.run(["preview", "out"]).refuses(2, &["report.html", "did not write"]);
    assert_eq!(bench.files("out")["report.html"], b"mine");
}

/// Whoever changes a slice and its entry in the manifest deceives the manifest, but not the job.
#[test]
fn a_consistent_tamper_is_found_by_making_again() {
    use sha2::Digest;
    let bench = sliced();
    for remake in [&[][..], &["--deep"]] {
        bench.run([&["verify", "out", "--job", "job.toml"], remake].concat()).exits(0);
    }
    // Slice 9 in place of slice 10: the cube's are alike in size and, inside, in their voxels.
    let [lower, upper] = [9, 0].map(|k| fs::read(bench.path(format!("out/slices/slice_{k}.png"))).unwrap());
    assert_ne!(lower, upper);
    let mut manifest = bench.manifest("out");
    let mut counts = std::collections::BTreeMap::new();
    for (k, content) in [(9, &upper), (0, &lower)] {
        let path = format!("slices/slice_{k}.png");
        bench.write(format!("out/{path}"), content);
        let files = manifest["files"].as_array_mut().unwrap();
        let entry = files.iter_mut().find(|file| file["path"] == path.as_str()).unwrap();
        entry["bytes"] = json!(content.len());
        entry["sha256"] = json!(sha2::Sha256::digest(content).iter().map(|b| format!("{b:02x}")).collect::<String>());
        counts.insert(path, content.len());
    }
    bench.write("out/manifest.json", manifest.to_string().as_bytes());
    for remake in [&[][..], &["--deep"]] {
        let ran = bench.run([&["verify", "out", "--job", "job.toml"], remake].concat()).exits(1);
        assert!(counts.keys().all(|path| ran.stdout.contains(path.as_str())), "{}", ran.stdout);
        assert!(ran.stdout.contains("which the job makes"), "{}", ran.stdout);
    }
    // Another job than the folder's.
    bench.job_with("white:0.5", "white:0.7");
    let ran = sliced_as(&bench).exits(1);
    assert!(ran.stdout.contains("stackings.json: found SHA-256") && ran.stdout.contains("manifest.json: job"));
    assert!(bench.run(["verify", "out", "--deep"]).exits(2).stderr.contains("--job"));
}

fn sliced_as(bench: &Bench) -> crate::support::Ran {
    bench.run(["verify", "out", "--job", "job.toml"])
}
