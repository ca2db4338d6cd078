//! Ctrl-C: the program stops soon, and what lies there is whole.
#![cfg(unix)]

use std::{
    fs,
    process::{Child, Command, Stdio},
    time::{Duration, Instant},
};

use crate::support::{Bench, JOB, Ran, sphere, stl};

/// Sends Ctrl-C and waits.
pub fn interrupt(child: Child) -> (Ran, Duration) {
    let started = Instant::now();
    assert!(Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap().success());
    (Ran::from(child.wait_with_output().unwrap()), started.elapsed())
}

pub fn spawn(mut command: Command) -> Child {
    command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap()
}

/// Waits until something is there.
fn wait_for(what: impl Fn() -> bool) {
    let started = Instant::now();
    while !what() {
        assert!(started.elapsed() < Duration::from_secs(20), "it did not begin in time");
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// With a job of a billion voxels: seconds of work.
pub fn slow() -> Bench {
    let bench = Bench::new();
    bench.write("ball.stl", &stl(&sphere(10.0, 40)));
    let job = JOB.replace("cube.stl", "ball.stl").replace("0.2, 0.2, 0.2", "0.02, 0.02, 0.02");
    bench.write("job.toml", job.as_bytes());
    bench
}

#[test]
fn slicing_stops_and_leaves_whole_files() {
    let bench = slow();
    let child = spawn(bench.command(["slice", "job.toml", "-o", "out"]));
    wait_for(|| fs::read_dir(bench.path("out/slices")).is_ok_and(|entries| entries.count() > 3));
    let (ran, elapsed) = interrupt(child);
    ran.refuses(130, &["interrupted"]);
    assert!(elapsed < Duration::from_secs(3), "{elapsed:?}");
    let files = bench.files("out");
    assert!(!files.contains_key("manifest.json"), "a folder with a manifest is a finished job");
    assert!(files.keys().all(|path| !path.ends_with(".part")), "{:?}", files.keys());
    for (path, bytes) in files.iter().filter(|(path, _)| path.ends_with(".png")) {
        assert!(bytes.ends_with(b"IEND\xaeB`\x82"), "{path} is not whole");
    }
    bench.run(["verify", "out"]).exits(2);
}

#[test]
fn simulations_stop() {
    let bench = Bench::new();
    let args = ["material", "simulate", "synthetic", "--photons", "1000000000", "-o", "m"];
    let child = spawn(bench.command(args));
    wait_for(|| bench.path("m").is_dir());
    interrupt(child).0.refuses(130, &["cancelled"]);
    assert!(bench.files("m").is_empty());
}

#[test]
fn a_search_stops_where_it_stands() {
    let bench = Bench::new();
    let target = ["--albedo", "0.7,0.4,0.5", "--mean-free-path-mm", "0.5,2,1"];
    let space = ["match", "--materials", "inks-rgb", "--units", "4096", "--depth", "12"];
    let child = spawn(bench.command(space.iter().chain(&target)));
    std::thread::sleep(Duration::from_millis(800));
    let (ran, elapsed) = interrupt(child);
    ran.refuses(130, &["interrupted"]);
    assert!(elapsed < Duration::from_secs(1), "{elapsed:?}");
}
