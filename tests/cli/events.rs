//! `--progress json`: stderr is one JSON object a line, whatever happens, as docs/events.schema.json has them.

use serde_json::Value;

use crate::{
    json_schema::breaches,
    slice_rounds,
    support::{Bench, JOB, Ran, keys, run},
};

const SCHEMA: &str = include_str!("../../docs/events.schema.json");

/// Every line of stderr, after checking that it is an event, that the first one is `started` and the last one `finished`,
/// and that every stage begins and ends.
#[track_caller]
pub fn events(ran: &Ran) -> Vec<Value> {
    let schema: Value = serde_json::from_str(SCHEMA).unwrap();
    let read = |line: &str| serde_json::from_str::<Value>(line).unwrap_or_else(|error| panic!("{error}: {line}"));
    let found: Vec<Value> = ran.stderr.lines().map(read).collect();
    for event in &found {
        let name = event["event"].as_str().unwrap_or_else(|| panic!("{event}"));
        let own = &schema["definitions"][name];
        assert!(own.is_object(), "{event} is not in the schema");
        assert_eq!(breaches(&schema, own, event), Vec::<String>::new());
        let unknown = keys(event).into_iter().find(|key| own["properties"].get(key).is_none());
        assert_eq!(unknown, None, "{event}");
        assert_eq!(breaches(&schema, &schema, event), Vec::<String>::new());
    }
    let names: Vec<&str> = found.iter().map(|event| event["event"].as_str().unwrap()).collect();
    assert_eq!((names.first(), names.last()), (Some(&"started"), Some(&"finished")), "{}", ran.stderr);
    let mut open = None;
    for event in &found {
        match event["event"].as_str().unwrap() {
            "stage" => assert_eq!(open.replace(event["stage"].clone()), None, "{event}"),
            "stage-ended" => assert_eq!(open.take(), Some(event["stage"].clone()), "{event}"),
            "progress" => assert_eq!(open, Some(event["stage"].clone()), "{event}"),
            _ => {}
        }
    }
    let last = found.last().unwrap();
    assert_eq!((open, last["exit_code"].as_i64()), (None, ran.code.map(i64::from)));
    let times = found.iter().map(|event| event["elapsed_s"].as_f64().unwrap());
    assert!(times.is_sorted(), "{}", ran.stderr);
    found
}

pub fn named<'a>(events: &'a [Value], name: &str) -> Vec<&'a Value> {
    events.iter().filter(|event| event["event"] == name).collect()
}

#[test]
fn a_job_is_told_from_its_beginning_to_its_result() {
    let bench = Bench::new();
    let ran = bench.run(["slice", "job.toml", "-o", "out", "--progress", "json"]).exits(0);
    let told = events(&ran);
    assert_eq!((told[0]["version"].as_u64(), told[0]["command"].as_str()), (Some(1), Some("slice")));
    let stages: Vec<_> = named(&told, "stage").iter().map(|stage| stage["name"].as_str().unwrap().to_owned()).collect();
    assert!(
        ["meshes", "materials", "slices"].iter().all(|name| stages.iter().any(|stage| stage == name)),
        "{stages:?}"
    );
    assert_eq!(named(&told, "stage").len(), named(&told, "stage-ended").len());
    let result = &told.last().unwrap()["result"];
    assert_eq!((result["output"].as_str(), told.last().unwrap()["outcome"].as_str()), (Some("out"), Some("done")));
    let files: Vec<_> = result["files"].as_array().unwrap().iter().map(|file| file.as_str().unwrap()).collect();
    assert!(["slices/", "masks/white/", "stackings.json"].iter().all(|file| files.contains(file)), "{files:?}");
    assert!(files.iter().all(|file| bench.path("out").join(file).exists()), "{files:?}");
    // Words on stdout stay what they are.
    assert!(ran.stdout.contains("slices of 20 × 20 voxels in out"), "{}", ran.stdout);
}

#[test]
fn the_result_is_the_document() {
    let bench = Bench::new();
    let ran = bench.run(["slice", "job.toml", "--dry-run", "--json", "--progress=json"]).exits(0);
    let mut told = events(&ran);
    let (mut result, mut document) = (told.pop().unwrap()["result"].take(), ran.json());
    // How long it will take is measured anew.
    for value in [&mut result, &mut document] {
        assert!(value["warnings"].is_array() && value["seconds"].take().is_object());
    }
    assert_eq!(result, document);
    let warned: Vec<_> = named(&told, "warning").into_iter().map(|warning| warning["text"].clone()).collect();
    assert_eq!(document["warnings"].as_array().unwrap(), &warned);
}

#[test]
fn print_warnings_have_their_kind_and_cure() {
    let bench = Bench::new();
    bench.write("job.toml", JOB.replace("white:0.5,support:0.6", "support:0.6,white:0.5").as_bytes());
    let ran = bench.run(["slice", "job.toml", "--dry-run", "--progress", "json"]).exits(0);
    let told = events(&ran);
    let bare = named(&told, "warning").into_iter().find(|warning| warning["kind"] == "bare-support");
    let bare = bare.unwrap_or_else(|| panic!("{}", ran.stderr));
    assert_eq!(bare["object"], "cube.stl");
    assert!(bare["cure"].as_str().unwrap().contains("min-depth-mm"), "{bare}");
    assert!(bare["text"].as_str().unwrap().ends_with(bare["cure"].as_str().unwrap()), "{bare}");
}

#[test]
fn errors_have_their_exit_code() {
    let bench = Bench::new();
    bench.write("bad.toml", JOB.replace("[printer]", "[prinder]").as_bytes());
    let cases: [(&[&str], &str, &str); 5] = [
        (&["slice", "bad.toml"], "input", "prinder"),
        (&["slice", "none.toml"], "input", "none.toml"),
        (&["slize"], "usage", "slize"),
        (&["slice", "job.toml", "--slices", "5..5"], "usage", "5..5"),
        (&[], "usage", "subcommand"),
    ];
    for (args, kind, text) in cases {
        let ran = bench.run(args.iter().chain(&["--progress", "json"])).exits(2);
        let told = events(&ran);
        let [error] = named(&told, "error")[..] else { panic!("{}", ran.stderr) };
        assert_eq!((error["kind"].as_str(), error["exit_code"].as_i64()), (Some(kind), Some(2)));
        assert!(error["text"].as_str().unwrap().contains(text), "{error}");
        assert_eq!((told.last().unwrap()["outcome"].as_str(), ran.stdout.as_str()), (Some("failed"), ""));
    }
}

#[test]
fn an_answer_of_no_has_its_reason() {
    let args = ["match", "--materials", "synthetic", "--albedo", "0.5", "--mean-free-path-mm", "1", "--core", "black"];
    let deep = ["--min-depth", "white:5", "--min-depth", "black:5", "--min-depth", "support:5", "--progress", "json"];
    let ran = run(args.into_iter().chain(deep)).exits(1);
    let told = events(&ran);
    let last = told.last().unwrap();
    assert_eq!(last["outcome"], "no");
    assert!(last["reason"].is_string() && last["result"]["reason"] == last["reason"], "{last}");
}

#[test]
fn help_begins_and_ends() {
    for args in [&["--help"][..], &["--version"], &["slice", "--help"]] {
        let plain = run(args).exits(0);
        let ran = run(args.iter().chain(&["--progress", "json"])).exits(0);
        let told = events(&ran);
        assert_eq!((told.len(), told[1]["outcome"].as_str(), ran.stdout), (2, Some("done"), plain.stdout));
    }
}

#[test]
fn rounds_are_told_as_they_are_written() {
    let bench = slice_rounds::bench();
    let ran = bench.run(["slice", "job.toml", "-o", "out", "--progress", "json"]).exits(0);
    let told = events(&ran);
    let mut numbered = bench.manifest("out")["rounds"].as_array().unwrap().clone();
    assert!(!numbered.is_empty());
    for (number, round) in (1..).zip(&mut numbered) {
        (round["round"], round["of"]) = (number.into(), 2.into());
    }
    let mut rounds: Vec<_> = named(&told, "round").into_iter().cloned().collect();
    for round in &mut rounds {
        round.as_object_mut().unwrap().retain(|key, _| !["event", "elapsed_s"].contains(&key.as_str()));
    }
    assert_eq!(rounds, numbered);
}

/// Commands without a slow step and without a document speak the same.
#[test]
fn every_command_speaks_it() {
    let bench = Bench::new();
    bench.run(["slice", "job.toml", "-o", "out"]).exits(0);
    let cases: [&[&str]; 7] = [
        &["verify", "out"],
        &["verify", "out", "--job", "job.toml"],
        &["convert", "out", "--to", "nrrd"],
        &["predict", "--materials", "synthetic", "--stack", "white:1", "--model", "km"],
        &["material", "list"],
        &["printers"],
        &["init", "cube.stl", "--look", "marble"],
    ];
    for args in cases {
        let ran = bench.run(args.iter().chain(&["--progress", "json"])).exits(0);
        let told = events(&ran);
        let command = told[0]["command"].as_str().unwrap();
        assert!(args.join(" ").starts_with(command), "{command}");
    }
}

#[test]
fn progress_is_told_as_asked() {
    let bench = Bench::new();
    let quiet = bench.run(["slice", "job.toml", "-o", "a", "--progress", "none"]).exits(0);
    assert!(quiet.stderr.lines().all(|line| line.starts_with("note: ") || line.starts_with("warning: ")));
    let plain = bench.run(["slice", "job.toml", "-o", "b", "--progress", "plain"]).exits(0);
    assert_eq!((plain.stderr.contains('\u{1b}'), plain.stdout.replace("b\n", "a\n")), (false, quiet.stdout));
    let wrong = bench.run(["slice", "job.toml", "--progress", "loud"]).exits(2);
    assert!(wrong.stderr.contains("plain") && wrong.stderr.starts_with("error: "), "{}", wrong.stderr);
}
