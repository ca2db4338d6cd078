//! `--progress json` to who does not read on, and after Ctrl-C.
#![cfg(unix)]

use std::{
    io::{BufRead, BufReader, Read, Write},
    process::{Command, Stdio},
    time::{Duration, Instant},
};

use crate::{
    events::{events, named},
    interrupt,
    support::{Bench, Ran},
};

/// Who does not want to read is no reason to end.
#[test]
fn a_closed_pipe_changes_nothing() {
    let bench = Bench::new();
    let slice = |out: &str| ["slice", "job.toml", "-o", out, "--progress", "json"].map(str::to_owned);
    let mut child = interrupt::spawn(bench.command(slice("closed")));
    drop(child.stderr.take());
    let ran = Ran::from(child.wait_with_output().unwrap()).exits(0);
    let heard = bench.run(slice("heard")).exits(0);
    assert_eq!(ran.stdout.replace("closed", "heard"), heard.stdout);
    assert!(bench.files("closed") == bench.files("heard"));
}

/// Reads events until one is `name`.
fn read_until(name: &str, stderr: &mut impl BufRead) -> String {
    let mut read = String::new();
    while !read.lines().last().is_some_and(|line| line.contains(&format!("\"event\":\"{name}\""))) {
        assert!(stderr.read_line(&mut read).unwrap() > 0, "{read}");
    }
    read
}

#[test]
fn ctrl_c_ends_with_events() {
    let bench = interrupt::slow();
    let mut child = interrupt::spawn(bench.command(["slice", "job.toml", "-o", "out", "--progress", "json"]));
    let mut stderr = BufReader::new(child.stderr.take().unwrap());
    let mut read = read_until("progress", &mut stderr);
    let (mut ran, _) = interrupt::interrupt(child);
    stderr.read_to_string(&mut read).unwrap();
    ran.stderr = read;
    let told = events(&ran.exits(130));
    assert_eq!(told.last().unwrap()["outcome"], "interrupted");
    assert_eq!(named(&told, "error")[0]["kind"], "interrupt");
    assert!(named(&told, "progress").iter().any(|event| event["steps"].is_u64() && event["done"].is_u64()));
}

/// A pipe that nobody empties holds up every event, but not the second Ctrl-C.
#[test]
fn a_full_pipe_does_not_outlive_ctrl_c() {
    let bench = interrupt::slow();
    let (stderr, mut pipe) = std::io::pipe().unwrap();
    let mut command = bench.command(["slice", "job.toml", "-o", "out", "--progress", "json"]);
    let mut child = command.stdout(Stdio::null()).stderr(pipe.try_clone().unwrap()).spawn().unwrap();
    drop(command);
    let mut stderr = BufReader::new(stderr);
    read_until("stage", &mut stderr);
    let filler = std::thread::spawn(move || while pipe.write_all(&[b'\n'; 4096]).is_ok() {});
    std::thread::sleep(Duration::from_millis(1500));
    let pid = child.id().to_string();
    let started = Instant::now();
    while child.try_wait().unwrap().is_none() {
        assert!(started.elapsed() < Duration::from_secs(10), "it goes on");
        let _ = Command::new("kill").args(["-INT", &pid]).status();
        std::thread::sleep(Duration::from_millis(200));
    }
    assert_eq!(child.wait().unwrap().code(), Some(130));
    drop(stderr);
    filler.join().unwrap();
}
