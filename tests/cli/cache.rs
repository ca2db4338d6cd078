//! Searches that were made before: found again, and never to be noticed but by the clock.

use std::{fs, path::PathBuf, process::Command};

use crate::support::{Bench, JOB, Ran};

/// A job that searches, after its gamut: by the quick model, for the cache knows no difference.
fn searching() -> Bench {
    let bench = Bench::new();
    let asks = "kind = \"texture\"\nalbedo-value = 0.7\nmean-free-path-mm = 0.5\ngamut-map = true";
    let job = JOB.replace("kind = \"stacking\"\nstack = \"white:0.5,support:0.6\"", asks);
    let job = job.replace("core = \"black\"", "core = \"black\"\nmodel = \"km\"");
    bench.write("job.toml", job.as_bytes());
    bench
}

fn answers(bench: &Bench) -> Vec<PathBuf> {
    let Ok(folder) = fs::read_dir(bench.path("cache")) else { return Vec::new() };
    folder.map(|entry| entry.unwrap().path()).collect()
}

#[test]
fn a_dry_run_leaves_its_search_to_the_run() {
    let bench = searching();
    let with = |args: &[&str]| -> Command {
        let mut command = bench.command(["slice", "job.toml"].iter().chain(args));
        command.env("LUMISLICE_CACHE", bench.path("cache"));
        command
    };
    let run = |args: &[&str]| Ran::from(with(args).output().unwrap()).exits(0);
    run(&["--no-cache", "-o", "anew"]);
    assert!(answers(&bench).is_empty());
    run(&["--dry-run"]);
    let kept = answers(&bench);
    let named =
        |kind: &str| kept.iter().filter(|path| path.file_name().unwrap().to_str().unwrap().starts_with(kind)).count();
    assert_eq!((named("gamut-"), named("stackings-"), kept.len()), (1, 1, 2), "{kept:?}");
    let written = kept.iter().map(|path| fs::metadata(path).unwrap().modified().unwrap()).collect::<Vec<_>>();
    run(&["-o", "known"]);
    assert_eq!(answers(&bench).len(), 2, "nothing was searched that was not known");
    assert!(kept.iter().zip(written).all(|(path, at)| fs::metadata(path).unwrap().modified().unwrap() == at));
    assert!(bench.files("anew") == bench.files("known"), "a cache changes no byte");
    // Damage is found out, and mended.
    let text = fs::read_to_string(&kept[0]).unwrap();
    fs::write(&kept[0], text.replacen('1', "2", 3)).unwrap();
    run(&["-o", "mended"]);
    assert!(bench.files("anew") == bench.files("mended"));
    assert_eq!(fs::read_to_string(&kept[0]).unwrap(), text);
    // What another asks is another question.
    let other = fs::read_to_string(bench.path("job.toml")).unwrap().replace("0.5", "0.4");
    bench.write("job.toml", other.as_bytes());
    run(&["--dry-run"]);
    assert_eq!(answers(&bench).len(), 3, "another target in the same gamut");
}
