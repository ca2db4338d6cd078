//! `gamut`, `--plot`, and `gamut-map` in jobs.

use std::fs;

use crate::support::{Bench, keys};

/// Small enough to be quick.
const SMALL: [&str; 10] =
    ["gamut", "--materials", "synthetic", "--core", "black", "--layer-step-mm", "0.2", "--model", "km", "--json"];

#[test]
fn the_gamut_is_data_and_a_plot() {
    let bench = Bench::new();
    let json = bench.run(SMALL.iter().chain(&["-o", "g.svg", "--csv", "g.csv"])).exits(0).json();
    assert_eq!(keys(&json), ["model", "channels", "targets"]);
    let channel = &json["channels"][0];
    assert_eq!(keys(channel), ["channel", "albedo", "boundary", "points"]);
    // Black alone, and white as thick as may be, on black: docs/accuracy.md.
    let [dark, bright] = [0, 1].map(|i| channel["albedo"][i].as_f64().unwrap());
    assert!((dark - 0.0545).abs() < 2e-3 && (bright - 0.6276).abs() < 2e-3, "{dark} to {bright}");
    let csv = fs::read_to_string(bench.path("g.csv")).unwrap();
    let mut lines = csv.lines();
    assert_eq!(lines.next(), Some("channel,place,albedo,half_energy_radius_mm,stack"));
    assert_eq!(lines.count(), channel["points"].as_array().unwrap().len());
    // Every stack reads back.
    let point = &channel["points"][3];
    let stack: Vec<_> = point["stack"].as_array().unwrap().iter().collect();
    let stack: Vec<_> =
        stack.iter().map(|l| format!("{}:{}", l["material"].as_str().unwrap(), l["thickness_mm"])).collect();
    let again = ["predict", "--materials", "synthetic", "--core", "black", "--model", "km", "--json", "--stack"];
    let again = bench.run(again.iter().chain(&[stack.join(",").as_str()])).exits(0).json();
    assert!((again["reflection"][0].as_f64().unwrap() - point["albedo"].as_f64().unwrap()).abs() < 1e-9);
    let svg = fs::read_to_string(bench.path("g.svg")).unwrap();
    assert!(
        svg.contains("aria-label=\"albedo\"")
            && svg.contains("half-energy radius [mm]")
            && svg.contains("mostly white")
    );
}

#[test]
fn a_target_outside_is_a_no() {
    let bench = Bench::new();
    // White of some tenths over black lies here; steps of 0.2 mm leave gaps as wide.
    let fine: Vec<&str> = SMALL.iter().map(|&arg| if arg == "0.2" { "0.05" } else { arg }).collect();
    let targets = |albedo: &str| bench.run(fine.iter().chain(&["--albedo", albedo, "--mean-free-path-mm", "0.25"]));
    let inside = targets("0.3,0.5").exits(0).json();
    assert_eq!(inside["targets"].as_array().unwrap().len(), 2);
    assert_eq!(inside["targets"][0]["gamut_map"]["albedo_factor"], 1.0);
    let outside = targets("0.3,0.9").exits(1).json();
    assert_eq!((&outside["targets"][0]["inside"], &outside["targets"][1]["inside"]), (&true.into(), &false.into()));
    assert!(outside["targets"][1]["gamut_map"]["albedo_factor"].as_f64().unwrap() < 0.75);
}

#[test]
fn bad_input_is_one_line() {
    let bench = Bench::new();
    let gamut = |more: &[&str]| bench.run(["gamut", "--materials", "synthetic"].iter().chain(more));
    gamut(&["-o", "g.pdf"]).refuses(2, &["g.pdf", ".pdf", ".svg or .png"]);
    gamut(&["-o", "none/g.png"]).refuses(3, &["none/g.png"]);
    gamut(&["--core", "blak"]).refuses(2, &["blak", "black"]);
    gamut(&["--min-depth", "wite:1"]).refuses(2, &["wite", "white"]);
    gamut(&["--albedo", "1.5", "--mean-free-path-mm", "1"]).refuses(2, &["--albedo", "1.5", "0 to 1"]);
    gamut(&["--albedo", "0.5", "--mean-free-path-mm", "1,2"]).refuses(2, &["found 2 values", "expected 1"]);
    gamut(&["--target", "none.csv"]).refuses(2, &["none.csv"]);
    gamut(&["--max-thickness-mm", "-1"]).refuses(2, &["max-thickness-mm", "-1"]);
}

#[test]
fn profiles_are_plotted() {
    let bench = Bench::new();
    bench.run(["predict", "--materials", "synthetic", "--stack", "white:0.5", "--plot", "p.png"]).exits(0);
    bench.run(["material", "show", "inks-rgb", "--plot", "m.svg"]).exits(0);
    let matched = ["match", "--materials", "synthetic", "--core", "black", "--albedo", "0.4", "--mean-free-path-mm"];
    bench.run(matched.iter().chain(&["0.5", "--photons", "20000", "--plot", "f.svg"])).exits(0);
    let picture = image::open(bench.path("p.png")).unwrap();
    assert!(picture.width() > 1000);
    let svg = |name: &str| fs::read_to_string(bench.path(name)).unwrap();
    for word in ["target", "Kubelka–Munk", "transport", "Monte Carlo"] {
        assert!(svg("f.svg").contains(&format!("aria-label=\"{word}\"")), "{word}");
    }
    assert!(svg("m.svg").contains("cyan"));
    let refused = bench.run(["predict", "--materials", "synthetic", "--stack", "white:0.5", "--plot", "p.jpg"]);
    refused.refuses(2, &["p.jpg", ".jpg"]);
}

/// Two labels, both brighter than white resin.
fn mapped_job(bench: &Bench, more: &str) -> serde_json::Value {
    let profile = |a: f64, b: f64| -> String {
        let row = |i: i32| {
            let r = 0.01 * f64::from(i);
            format!("{r},{}\n", a * b * (-b * r).exp() / (std::f64::consts::TAU * r))
        };
        "r_mm,reflection_per_mm2\n".to_owned() + &(1..1000).map(row).collect::<String>()
    };
    bench.write("a.csv", profile(0.9, 2.0).as_bytes());
    bench.job_with(
        "kind = \"stacking\"\nstack = \"white:0.5,support:0.6\"",
        &format!("kind = \"profile\"\nprofile = \"a.csv\"\n{more}"),
    );
    bench.run(["slice", "job.toml", "-o", "out", "--overwrite"]).exits(0);
    bench.manifest("out")
}

#[test]
fn a_job_says_where_its_glow_is_out_of_reach() {
    let bench = Bench::new();
    let told = |mean_free_path_mm: f64| {
        let target = format!("kind = \"texture\"\nalbedo-value = 0.3\nmean-free-path-mm = {mean_free_path_mm}");
        bench.job_with("kind = \"stacking\"\nstack = \"white:0.5,support:0.6\"", &target);
        bench.run(["slice", "job.toml", "-o", "out", "--dry-run"]).exits(0).stderr
    };
    for (mean_free_path_mm, how) in [(0.05, "wider"), (4.0, "narrower")] {
        let told = told(mean_free_path_mm);
        assert!(told.contains(&format!("100% of the surface glows {how} than asked")), "{told}");
    }
    assert!(!told(0.3).contains("glows"));
}

#[test]
fn a_job_brings_targets_into_the_gamut_and_says_so() {
    let bench = Bench::that_remembers();
    let plain = mapped_job(&bench, "");
    assert!(plain["stackings"][0]["stackings"][0].get("gamut_map").is_none());
    assert_eq!(plain["job"]["object"][0]["target"]["gamut-map"], false);
    let out_of_reach = "object 1: 100% of the surface comes out with another albedo than asked, at most ";
    assert!(plain["warnings"].as_array().unwrap().iter().any(|text| text.as_str().unwrap().starts_with(out_of_reach)));
    let mapped = mapped_job(&bench, "gamut-map = true");
    let entry = &mapped["stackings"][0]["stackings"][0];
    let map = &entry["gamut_map"];
    assert_eq!(map["reached"], false);
    assert!(map["albedo_factor"].as_f64().unwrap() < 0.75, "{map}");
    assert!(
        entry["search"]["objective"].as_f64() < plain["stackings"][0]["stackings"][0]["search"]["objective"].as_f64()
    );
    assert!((entry["target_albedo"][0].as_f64().unwrap() - 0.9).abs() < 0.02);
    let warnings = mapped["warnings"].as_array().unwrap();
    assert!(warnings.iter().any(|warning| warning.as_str().unwrap().contains("gamut-map: moved 1 of 1 targets")));
    let report = fs::read_to_string(bench.path("out").join("stackings.json")).unwrap();
    assert!(report.contains("objective_as_asked"));
    // What the job will do is shown beforehand, in the job's own gamut.
    let shown = bench.run(["gamut", "--job", "job.toml", "--json"]).exits(1).json();
    assert_eq!(shown["targets"][0]["target"], "cluster 0");
    for factor in ["albedo_factor", "width_factor"] {
        assert_eq!(shown["targets"][0]["gamut_map"][factor], map[factor], "{factor}");
    }
    // Options go before the job's keys.
    let thin = bench
        .run(["gamut", "--job", "job.toml", "--json", "--max-thickness-mm", "0.5", "--no-mixtures"])
        .exits(1)
        .json();
    assert!(thin["targets"][0]["gamut_map"]["albedo_factor"].as_f64() < map["albedo_factor"].as_f64());

    bench.job_with("kind = \"stacking\"", "gamut-map = true\nkind = \"stacking\"");
    bench.run(["slice", "job.toml", "-o", "out2"]).refuses(2, &["job.toml", "gamut-map", "stacking"]);
    bench.job_with(
        "kind = \"stacking\"\nstack = \"white:0.5,support:0.6\"",
        "kind = \"profile\"\nprofile = \"a.csv\"\ngamut-map = 1",
    );
    bench.run(["slice", "job.toml", "-o", "out2"]).refuses(2, &["job.toml:", "gamut-map", "found 1", "true or false"]);
}

/// Grains of black at the surface make a narrower glow than any layers of one resin each that a printer can lay.
#[test]
fn what_mixtures_reach_is_no_no() {
    let bench = Bench::that_remembers();
    let asked = |albedo: &'static str, mfp: &'static str, more: &[&str]| {
        let gamut = ["gamut", "--materials", "synthetic", "--core", "black", "--min-layer-mm", "0.0847"];
        bench.run(gamut.iter().chain(&["--albedo", albedo, "--mean-free-path-mm", mfp]).chain(more))
    };
    let narrow = |more: &[&str]| asked("0.12", "0.25", more);
    let pure = narrow(&["--no-mixtures", "--json"]).exits(1).json();
    assert_eq!(
        (&pure["targets"][0]["inside"], &pure["targets"][0]["reached"]),
        (&false.into(), &serde_json::Value::Null)
    );
    let mixed = narrow(&["--json"]).exits(0).json();
    assert_eq!((&mixed["targets"][0]["inside"], &mixed["targets"][0]["reached"]), (&false.into(), &true.into()));
    assert!(narrow(&[]).exits(0).stdout.contains("reached by mixtures"));
    // What nothing reaches stays outside.
    assert_eq!(asked("0.9", "0.5", &["--json"]).exits(1).json()["targets"][0]["reached"], false);
}
