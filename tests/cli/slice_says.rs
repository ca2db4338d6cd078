//! What `slice` says where: data to stdout, words to stderr.

use std::{ffi::OsStr, fs, sync::OnceLock};

use crate::support::{Bench, cube, keys, stl};

#[test]
fn a_job_is_done_and_told() {
    let bench = Bench::new();
    let ran = bench.run(["slice", "job.toml"]).exits(0);
    assert!(ran.stdout.starts_with("job: 20 of 20 slices of 20 × 20 voxels in job-out\n"), "{}", ran.stdout);
    let note = ran.stderr.lines().next().unwrap();
    assert!(note.starts_with("note: materials `synthetic`: ") && note.contains("not a measurement"), "{note}");
    assert!(!ran.stderr.contains("warning: materials"), "{}", ran.stderr);
    assert!(!ran.stderr.contains(['\r', '\u{1b}']), "no bars in a pipe");
    let manifest = bench.manifest("job-out");
    let notes = manifest["material_set"]["notes"].as_array().unwrap();
    assert!(notes.iter().any(|note| note.as_str().unwrap().contains("extrapolated")));
    for file in manifest["files"].as_array().unwrap() {
        assert!(bench.path("job-out").join(file["path"].as_str().unwrap()).is_file());
    }
    // Support prints as a hole, and no one else's voxels are lost.
    let voxels = |index: usize| manifest["materials"][index]["voxels"].as_u64().unwrap();
    assert_eq!(voxels(0) + voxels(1) + voxels(2), 8000);
}

#[test]
fn json_is_one_document() {
    let bench = Bench::new();
    let json = bench.run(["slice", "job.toml", "-o", "out", "--json"]).exits(0).json();
    let expected =
        ["output", "lattice", "slices", "material_set", "materials", "warnings", "rounds", "verdict", "files"];
    assert_eq!(keys(&json), expected);
    assert_eq!(json["output"], "out");
    assert_eq!(json["lattice"]["dims"], serde_json::json!([20, 20, 20]));
    let json = bench.run(["slice", "job.toml", "--dry-run", "--json"]).exits(0).json();
    assert_eq!((json["voxels"].as_u64(), json["misfits"].as_array().unwrap().len()), (Some(8000), 0));
}

#[test]
fn a_dry_run_tells_and_writes_nothing() {
    let bench = Bench::new();
    let before = bench.files("");
    let ran = bench.run(["slice", "job.toml", "-o", "out", "--dry-run"]).exits(0);
    for word in ["4.00 × 4.00 × 4.00 mm", "20 × 20 × 20", "memory: about", " g"] {
        assert!(ran.stdout.contains(word), "{word}: {}", ran.stdout);
    }
    bench.job_with("pitch-mm = [0.2, 0.2, 0.2]", "pitch-mm = [0.2, 0.2, 0.2]\ntray-mm = [5, 3, 5]");
    let ran = bench.run(["slice", "job.toml", "--dry-run"]).exits(1);
    assert!(ran.stdout.contains("does not fit: cube.stl reaches 4.000 mm in y"), "{}", ran.stdout);
    bench.run(["slice", "job.toml"]).refuses(2, &["job.toml:4", "reaches 4.000 mm in y"]);
    bench.write("job.toml", &before["job.toml"]);
    assert_eq!(bench.files(""), before);
}

#[test]
fn a_dry_run_of_a_part_says_which() {
    let bench = Bench::new();
    let whole = bench.run(["slice", "job.toml", "--dry-run"]).exits(0);
    let part = bench.run(["slice", "job.toml", "--dry-run", "--slices", "3..7", "--overwrite"]).exits(0);
    let told = "slices: 3..7 of 20; what follows is for all of them\n";
    assert!(part.stdout.contains(told), "{}", part.stdout);
    let but_time = |text: &str| text.lines().filter(|line| !line.starts_with("time:")).collect::<Vec<_>>().join("\n");
    assert_eq!(but_time(&part.stdout.replace(told, "")), but_time(&whole.stdout));
    let json = bench.run(["slice", "job.toml", "--dry-run", "--slices", "3..7", "--json"]).exits(0).json();
    assert_eq!(json["slices"], serde_json::json!([3, 7]));
    bench.run(["slice", "job.toml", "--dry-run", "--slices", "3..70"]).refuses(2, &["--slices"]);
    bench.run(["slice", "job.toml", "--dry-run", "--resume"]).exits(2);
}

#[test]
fn a_crowded_tray_is_told_in_one_line_with_what_would_fit() {
    let bench = Bench::new();
    let crowd = |tray: &str| {
        bench.job_with_all(&[
            ["mesh = \"cube.stl\"", "mesh = \"cube.stl\"\ncount = 30"],
            ["\n[[object]]", "arrange = true\ngap-mm = 3\n[[object]]"],
            ["pitch-mm = [0.2, 0.2, 0.2]", &format!("pitch-mm = [0.2, 0.2, 0.2]\ntray-mm = {tray}")],
        ]);
    };
    crowd("[30, 24, 5]");
    // Rows of 4 at 7 mm, and of 6 at 5 mm.
    let told = "12 of 30 objects arranged 3 mm apart fit the tray of custom, 30 × 24 mm: 18 fewer would, or gap-mm = 1";
    let ran = bench.run(["slice", "job.toml", "--dry-run"]).exits(1);
    assert_eq!(ran.stdout.lines().filter(|line| line.starts_with("does not fit")).count(), 1, "{}", ran.stdout);
    assert!(ran.stdout.contains(told), "{}", ran.stdout);
    bench.run(["slice", "job.toml"]).refuses(2, &["printer: found", told]);
    // Those that fit nowhere are named, once.
    crowd("[30, 3, 5]");
    let ran = bench.run(["slice", "job.toml", "--dry-run"]).exits(1);
    assert_eq!(ran.stdout.lines().filter(|line| line.starts_with("does not fit")).count(), 1, "{}", ran.stdout);
    assert!(ran.stdout.contains("cube.stl reaches 4.000 mm in y"), "{}", ran.stdout);
}

#[test]
fn keys_of_several_kinds_are_listed_once() {
    let bench = Bench::new();
    bench.job_with("stack =", "alpha = 1\nstack =");
    let ran = bench.run(["slice", "job.toml", "--dry-run"]).exits(2);
    assert_eq!(ran.stderr.matches("gamut-map").count(), 1, "{}", ran.stderr);
}

#[test]
fn layers_thinner_than_a_voxel_are_counted() {
    let bench = Bench::new();
    bench.job_with("0.2, 0.2, 0.2", "0.1, 0.2, 0.1");
    let thin = |stack: &str| {
        let job = fs::read_to_string(bench.path("job.toml")).unwrap();
        bench.write("job.toml", job.replace("white:0.5,support:0.6", stack).as_bytes());
        let words = bench.run(["slice", "job.toml", "-o", "out", "--dry-run"]).exits(0).stderr;
        words.lines().filter(|line| line.contains("thinner")).map(str::to_owned).collect::<Vec<_>>()
    };
    assert_eq!(thin("white:0.5,support:0.6"), Vec::<String>::new());
    let found = thin("white:0.15,support:0.6,white:0.19");
    let expected =
        "warning: layers thinner than a voxel, not resolved on faces that look along it: 2 along y (0.2000 mm) of 3";
    assert!(found.len() == 1 && found[0].starts_with(expected), "{found:?}");
}

#[test]
fn a_material_files_remarks_are_warnings() {
    let bench = Bench::new();
    bench.run(["material", "simulate", "synthetic", "--photons", "40000", "-o", "m"]).exits(0);
    bench.job_with("set = \"synthetic\"", "file = \"m/synthetic.toml\"");
    let words = bench.slice("out").stderr;
    assert!(words.contains("warning: materials: resin white, channel Y: "), "{words}");
    assert!(!words.contains("note: "), "{words}");
}

#[cfg(unix)]
#[test]
fn paths_need_not_be_utf_8() {
    use std::os::unix::ffi::OsStrExt;
    let bench = Bench::new();
    let name = |bytes: &'static [u8]| OsStr::from_bytes(bytes);
    let (job, out) = (name(b"j\xffb.toml"), name(b"o\xfft"));
    fs::rename(bench.path("job.toml"), bench.path(job)).unwrap();
    bench.run([name(b"slice"), job, name(b"-o"), out]).exits(0);
    bench.run([name(b"verify"), out]).exits(0);
    bench.run([name(b"slice"), job, name(b"-o"), out, name(b"--overwrite"), name(b"--json")]).exits(0).json();
    bench.run([name(b"slice"), name(b"n\xffne.toml")]).refuses(2, &["n\u{fffd}ne.toml"]);
    fs::remove_dir_all(bench.path(out)).unwrap();
    let folder = name(b"f\xfflder");
    fs::create_dir(bench.path(folder)).unwrap();
    fs::write(bench.path(folder).join("cube.stl"), stl(&cube(2.0))).unwrap();
    fs::rename(bench.path(job), bench.path(folder).join("job.toml")).unwrap();
    bench.run([name(b"slice"), name(b"f\xfflder/job.toml")]).exits(0);
    assert!(bench.path("job-out/manifest.json").is_file());
}

#[test]
fn every_file_that_was_read_is_an_input() {
    let bench = Bench::new();
    let square = "v 0 0 0\nv 4 0 0\nv 0 4 0\nv 0 0 4\n";
    let obj = format!("mtllib look.mtl\nusemtl skin\n{square}f 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n");
    bench.write("models/corner.obj", obj.as_bytes());
    bench.write("models/look.mtl", b"newmtl skin\nKd 0.5 0.5 0.5\n");
    bench.job_with("cube.stl", "models/corner.obj");
    bench.slice("out");
    let inputs = bench.manifest("out")["inputs"].clone();
    let paths: Vec<_> = inputs.as_array().unwrap().iter().map(|input| input["path"].as_str().unwrap()).collect();
    assert_eq!(paths, ["models/corner.obj", "models/look.mtl"]);
}

#[test]
fn profiles_that_a_material_file_names_are_inputs() {
    let bench = Bench::new();
    bench.write("measured/resins.toml", b"");
    let predict = ["predict", "--materials", "synthetic", "--model", "km", "--csv"];
    for (resin, mm) in [("white", 3.0), ("support", 3.0), ("black", 0.5)] {
        let (csv, stack) = (format!("measured/{resin}.csv"), format!("{resin}:{mm}"));
        bench.run(predict.iter().chain(&[&*csv, "--stack", &stack])).exits(0);
    }
    let resin = |name: &str, red: u8, mm: f64| {
        format!(
            "[[resin]]\nname = \"{name}\"\nrgba = [{red}, 9, 9]\ndensity-g-per-cm3 = 1.1\n\
             reflection = \"{name}.csv\"\nthickness-mm = {mm}\n"
        )
    };
    let resins = resin("white", 1, 3.0) + &resin("support", 2, 3.0) + &resin("black", 3, 0.5);
    bench.write("measured/resins.toml", resins.as_bytes());
    bench.job_with("set = \"synthetic\"", "file = \"measured/resins.toml\"");
    bench.slice("out");
    let inputs = bench.manifest("out")["inputs"].clone();
    let paths: Vec<_> = inputs.as_array().unwrap().iter().map(|input| input["path"].as_str().unwrap()).collect();
    let measured = ["measured/black.csv", "measured/resins.toml", "measured/support.csv", "measured/white.csv"];
    assert_eq!(paths, ["cube.stl"].into_iter().chain(measured).collect::<Vec<_>>());
}

/// The page of a job of pictures alone: drawn once for all who ask.
fn drawn() -> &'static str {
    static PAGE: OnceLock<String> = OnceLock::new();
    PAGE.get_or_init(|| {
        let bench = Bench::new();
        bench.job_with("formats = [\"png\", \"masks\"]", "formats = [\"preview\"]");
        bench.slice("out");
        fs::read_to_string(bench.path("out/report.html")).unwrap()
    })
}

/// The page and the terminal say the same, and first what a designer asks: does it look as asked, where not and why,
/// is it ready for the printer.
#[test]
fn a_report_opens_with_a_verdict() {
    let bench = Bench::new();
    let formats = "formats = [\"png\", \"masks\"]";
    bench.job_with(formats, "formats = [\"png\", \"preview\"]");
    let verdict_of = |page: &str| -> Vec<String> {
        let section = page.split("<section class=\"verdict\">").nth(1).unwrap().split("</section>").next().unwrap();
        assert!(page.find("class=\"verdict\"").unwrap() < page.find("<figure").unwrap());
        let bare =
            section.replace("<p class=\"lead\">", "\n").replace("<li>", "\n").replace("</p>", "").replace("</li>", "");
        let bare = bare.replace("<ul>", "").replace("</ul>", "").replace("&#39;", "'");
        bare.lines().map(str::trim).filter(|line| !line.is_empty()).map(str::to_owned).collect()
    };
    let verdict = |out: &str| verdict_of(&fs::read_to_string(bench.path(out).join("report.html")).unwrap());
    let says = |verdict: &[String], parts: &[&str]| {
        let all = verdict.join("\n");
        parts.iter().for_each(|part| assert!(all.contains(part), "{part} in\n{all}"));
    };
    // Layers that are given ask for no look.
    let ran = bench.slice("given");
    let given = verdict("given");
    says(&given, &["No look was asked for", "Ready for the printer: 20 slices for GrabCAD Voxel Print (slices/)"]);
    says(&given, &["built-in resins `synthetic`", "It is most unlike a flat slab of its layers "]);
    assert!(given.iter().all(|words| !words.contains("should be")), "{given:?}");
    let one_line = |text: &str| text.split_whitespace().collect::<Vec<_>>().join(" ");
    given.iter().for_each(|words| assert!(one_line(&ran.stdout).contains(&one_line(words)), "{words}\n{}", ran.stdout));
    assert!(ran.stdout.lines().all(|line| line.chars().count() <= 80), "{}", ran.stdout);
    // A part of the slices is no job, and is not looked at.
    bench.run(["slice", "job.toml", "-o", "part", "--slices", "3..9"]).exits(0);
    let part = verdict("part");
    assert!(part[0].contains("not all of its slices"), "{part:?}");
    says(&part, &["Not ready for the printer: 6 of 20 slices"]);
    // Nor are pictures alone.
    says(&verdict_of(drawn()), &["Not for the printer yet"]);
    // Brighter than white can be.
    let target = "kind = \"stacking\"\nstack = \"white:0.5,support:0.6\"";
    let bright = "kind = \"texture\"\nalbedo-value = 0.95\nmean-free-path-mm = 0.5";
    bench.job_with(target, bright);
    let job = fs::read_to_string(bench.path("job.toml")).unwrap();
    let job = job.replace(formats, "formats = [\"png\", \"preview\"]") + "[appearance]\nrounds = 0\n";
    bench.write("job.toml", job.as_bytes());
    bench.slice("bright");
    let bright = verdict("bright");
    says(&bright, &["The print looks ", "places looked at, half are within ", "95% within "]);
    says(&bright, &["these resins come no nearer", "Out of reach: 100% of the surface", "warning"]);
    // Darker than black is: 0.055 of the synthetic one, which as a share of so little tells nothing.
    let job = job.replace("albedo-value = 0.95", "albedo-value = 0.01");
    bench.write("job.toml", job.as_bytes());
    bench.slice("dark");
    let dark = verdict("dark");
    says(&dark, &["an albedo of 0.", " in place of 0.010. Why: these resins come no nearer", "Out of reach: 100%"]);
    assert!(!dark[0].contains("000%"), "{dark:?}");
}

/// Paper and looks lie on dark pages without glare.
#[test]
fn pages_have_a_dark_theme_for_their_pictures() {
    let page = drawn();
    let dark = page.split("prefers-color-scheme: dark").nth(1).unwrap().split("@media").next().unwrap();
    for rule in [".panels { background: #", ".drawn img", ".film #frame", "filter: brightness("] {
        assert!(dark.contains(rule), "{rule}: {dark}");
    }
    // Every picture is one or the other.
    assert!(
        !page.contains("<figure>") && page.contains("<figure class=\"panels") && page.contains("<figure class=\"drawn")
    );
}
