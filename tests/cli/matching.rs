//! `match`: the stack a prediction came from is found again, and limits are kept.

use serde_json::Value;

use crate::support::{Bench, Ran, keys, run};

fn find(more: &[&str]) -> Ran {
    run(["match", "--materials", "synthetic"].iter().chain(more))
}

/// (resin, mm) from the observer down.
fn stack(json: &Value) -> Vec<(String, f64)> {
    let layer =
        |layer: &Value| (layer["material"].as_str().unwrap().to_owned(), layer["thickness_mm"].as_f64().unwrap());
    json["stack"].as_array().unwrap().iter().map(layer).collect()
}

#[test]
fn a_predicted_stack_is_found_again() {
    let bench = Bench::new();
    // Whole units of 5/64 mm.
    let layers = "white:0.46875,support:1.25,black:0.3125";
    bench.run(["predict", "--materials", "synthetic", "--model", "km", "--stack", layers, "--csv", "p.csv"]).exits(0);
    let json = bench.run([
        "match",
        "--materials",
        "synthetic",
        "--target",
        "p.csv",
        "--json",
        "--model",
        "km",
        "--objective",
        "l2",
    ]);
    let json = json.exits(0).json();
    assert_eq!(keys(&json), ["stack", "objective", "bound", "proven", "nodes", "look"]);
    assert!(json["look"]["delta_e_2000"].as_f64().unwrap() < 0.1, "{json}");
    let edge = &json["look"]["edge_mm"][0];
    assert!((edge[1].as_f64().unwrap() / edge[0].as_f64().unwrap() - 1.0).abs() < 0.01, "{json}");
    assert_eq!(keys(&json["objective"]), ["km", "transport", "monte_carlo"]);
    assert!(json["objective"]["transport"].as_f64().unwrap() > 0.0, "what transport says of it");
    assert_eq!(json["objective"]["monte_carlo"], Value::Null);
    assert_eq!(json["proven"], true);
    assert!(json["nodes"].as_u64().unwrap() > 0);
    // Six digits and 20 mm of profile are what is lost on the way.
    let objective = json["objective"]["km"].as_f64().unwrap();
    assert!(objective < 1e-4 && json["bound"].as_f64().unwrap() <= objective, "{objective}");
    let found = stack(&json);
    assert_eq!(found[0], ("white".to_owned(), 0.46875), "{found:?}");
    assert_eq!(found[1], ("support".to_owned(), 1.25), "{found:?}");
}

/// The target is made by photons, and photons judge the answer: no model marks its own work.
#[test]
fn refined_layers_do_what_was_promised() {
    let bench = Bench::new();
    let photons = ["--photons", "1000000"];
    let stack = ["--stack", "white:0.3,support:1.0", "--core", "black", "--csv", "p.csv"];
    let make = ["predict", "--materials", "synthetic", "--model", "monte-carlo"];
    bench.run(make.iter().chain(&stack).chain(&photons)).exits(0);
    let find =
        ["match", "--materials", "synthetic", "--target", "p.csv", "--core", "black", "--objective", "l2", "--json"];
    let refined = bench.run(find.iter().chain(&["--model", "transport"]).chain(&photons)).exits(0).json();
    let score = |json: &Value, judge: &str| json[judge].as_f64().unwrap();
    let promised = score(&refined["objective"], "transport");
    // Two Monte Carlo runs of a million photons differ by about 4e-5 where nothing else differs.
    assert!(promised < 1e-4 && score(&refined["objective"], "monte_carlo") < promised + 1e-4, "{refined}");
    assert!(score(&refined["unrefined"]["objective"], "transport") > 5.0 * promised, "{refined}");
    assert_eq!(keys(&refined), ["stack", "objective", "bound", "proven", "nodes", "look", "unrefined"]);
    let steps = bench.run(find.iter().chain(&["--model", "transport", "--layer-step-mm", "0.05"])).exits(0).json();
    for (_, mm) in self::stack(&steps) {
        assert!((mm / 0.05 - (mm / 0.05).round()).abs() < 1e-9 && mm > 0.04, "{steps}");
    }
}

/// By default the surface is dithered; what bounds prove is told of pure resins only.
#[test]
fn mixtures_meet_what_is_asked() {
    let target = ["--albedo", "0.4", "--mean-free-path-mm", "0.5", "--core", "black", "--json"];
    let mixed = find(&target).exits(0).json();
    assert_eq!(keys(&mixed), ["stack", "objective", "bound", "proven", "nodes", "look"]);
    assert_eq!([&mixed["bound"], &mixed["proven"], &mixed["nodes"]], [&Value::Null; 3]);
    let layers = stack(&mixed);
    assert!(layers[0].0.contains("% white + ") && layers[0].0.contains("% black") && layers[0].1 > 0.19, "{mixed}");
    assert!(layers.iter().all(|layer| layer.1 > 0.0), "{mixed}");
    let albedo = mixed["look"]["albedo"][0][1].as_f64().unwrap();
    assert!((albedo / 0.4 - 1.0).abs() < 0.005, "{mixed}");
    let pure = find(&[&target[..], &["--no-mixtures"]].concat()).exits(0).json();
    assert!(stack(&pure).iter().all(|layer| !layer.0.contains('%')) && pure["proven"] == true, "{pure}");
    // A mixture reads back.
    let words = find(&target[..target.len() - 1]).exits(0);
    assert!(words.stdout.contains("% white + ") && words.stdout.contains("fitted by transport"), "{}", words.stdout);
}

/// A profile that falls as e^{−r}: no slab has it.
pub fn no_resins_profile() -> String {
    let row = |i: i32| {
        let (r, fall) = (0.05 * f64::from(i), (-0.05 * f64::from(i)).exp());
        format!("{r},{},{}\n", 0.05 * fall, 0.03 * fall)
    };
    "r_mm,reflection_per_mm2,transmission_per_mm2\n".to_owned() + &(1..300).map(row).collect::<String>()
}

#[test]
fn what_cannot_be_refined_is_refused() {
    let target = ["--albedo", "0.4", "--mean-free-path-mm", "0.5"];
    find(&[&target[..], &["--min-layer-mm", "0.1", "--model", "km"]].concat())
        .refuses(2, &["--min-layer-mm", "--model transport"]);
    let bench = Bench::new();
    bench.write("p.csv", no_resins_profile().as_bytes());
    bench.write(
        "m.toml",
        b"[[resin]]\nname = \"glass\"\nrgba = [1, 2, 3]\ndensity-g-per-cm3 = 1\nreflection = \"p.csv\"\nthickness-mm \
            = 1",
    );
    let by_profile = ["match", "--materials", "m.toml", "--model", "transport"];
    let ran = bench.run(by_profile.iter().chain(&target)).exits(0);
    assert!(ran.stderr.contains("glass") && ran.stderr.contains("by Kubelka-Munk instead"), "{}", ran.stderr);
    let judged = by_profile.iter().chain(&target).chain(&["--photons", "1000"]);
    bench.run(judged).refuses(2, &["m.toml", "glass", "no coefficients"]);
    // Neither one step nor none keeps 0.2 mm.
    let steps = ["--model", "transport", "--layer-step-mm", "3", "--max-thickness-mm", "2"];
    let ran = find(&[&target[..], &steps].concat()).exits(1);
    assert!(ran.stderr.contains("whole steps of 3 mm"), "{}", ran.stderr);
}

#[test]
fn more_light_than_fell_is_refused() {
    let bench = Bench::new();
    let bright = no_resins_profile().lines().skip(1).fold("r_mm,reflection_per_mm2\n".to_owned(), |text, line| {
        let mut columns = line.split(',').map(|column| column.parse::<f64>().unwrap());
        let (r, value) = (columns.next().unwrap(), columns.next().unwrap());
        text + &format!("{r},{}\n", 100.0 * value)
    });
    bench.write("bright.csv", bright.as_bytes());
    let target = ["match", "--materials", "synthetic", "--target", "bright.csv"];
    bench.run(target).refuses(2, &["bright.csv:1: reflection_per_mm2: found an albedo of 31", "expected at most 1"]);
}

#[test]
fn an_albedo_and_a_mean_free_path_are_a_target() {
    let args = ["--albedo", "0.5", "--mean-free-path-mm", "0.3", "--core", "black"];
    let ran = find(&args).exits(0);
    assert!(
        ["from the observer down", "0.5000", "rms", "proven"].iter().all(|word| ran.stdout.contains(word)),
        "{}",
        ran.stdout
    );
    assert!(ran.stderr.starts_with("note: ") && ran.stderr.contains("not a measurement"));
    let colours =
        ["match", "--materials", "inks-rgb", "--albedo", "0.5,0.4,0.3", "--mean-free-path-mm", "0.5", "--depth", "3"];
    assert!(run(colours).exits(0).stdout.contains("0.3000"));
}

#[test]
fn a_colour_is_a_target() {
    let shared = ["--mean-free-path-mm", "0.5", "--depth", "3", "--core", "black", "--model", "km", "--json"];
    let albedo = |set: &str, more: &[&str]| {
        let json = run(["match", "--materials", set].iter().chain(more).chain(&shared)).exits(0).json();
        (stack(&json), json["objective"]["km"].as_f64().unwrap())
    };
    // 0x80 is 0.21586 in linear light.
    let srgb = albedo("inks-rgb-7", &["--srgb", "#ff8000"]);
    assert_eq!(srgb, albedo("inks-rgb-7", &["--srgb", "FF8000"]));
    let linear = albedo("inks-rgb-7", &["--albedo", "1,0.21586,0"]);
    assert!(srgb.0 == linear.0 && (srgb.1 / linear.1 - 1.0).abs() < 1e-3, "{srgb:?} {linear:?}");
    assert!(srgb.0.iter().any(|layer| layer.0 == "yellow"), "{srgb:?}");
    // One channel sees the luminance.
    let grey = 0.2126 + 0.7152 * 0.21586;
    let (srgb, linear) =
        (albedo("synthetic", &["--srgb", "#ff8000"]), albedo("synthetic", &["--albedo", &grey.to_string()]));
    assert!(srgb.0 == linear.0 && (srgb.1 / linear.1 - 1.0).abs() < 1e-3, "{srgb:?} {linear:?}");
    for colour in ["#ff80", "orange", "+12345"] {
        assert_eq!(find(&["--srgb", colour, "--mean-free-path-mm", "1"]).exits(2).stdout, "");
    }
    find(&["--srgb", "#ff8000"]).exits(2);
    find(&["--srgb", "#ff8000", "--albedo", "0.5", "--mean-free-path-mm", "1"]).exits(2);
}

/// Out of gamut objectives part ways; each proves its own optimum.
#[test]
fn objectives_choose_different_layers() {
    let target =
        ["--materials", "inks-rgb-7", "--albedo", "0.5,0.1,0.02", "--mean-free-path-mm", "0.4", "--core", "black"];
    let [natural, l2, spatial, relative] = ["natural", "l2", "spatial", "relative"].map(|objective| {
        let search = ["--depth", "4", "--json", "--model", "km", "--objective", objective];
        let json = run(["match"].iter().chain(&target).chain(&search)).exits(0).json();
        assert_eq!(json["proven"], true);
        stack(&json)
    });
    assert!(l2 != spatial && l2 != relative && spatial != relative, "{l2:?} {spatial:?} {relative:?}");
    let unset = ["--depth", "4", "--json", "--model", "km"];
    let unset = run(["match"].iter().chain(&target).chain(&unset)).exits(0).json();
    assert!(stack(&unset) == natural && natural != l2, "{natural:?} {l2:?}");
    find(&["--albedo", "0.5", "--mean-free-path-mm", "1", "--objective", "l1"]).exits(2);
}

#[test]
fn support_keeps_its_depth_unless_told_otherwise() {
    // A target as bright and as wide as support alone: it would lie bare.
    let bench = Bench::new();
    bench
        .run(["predict", "--materials", "synthetic", "--model", "km", "--stack", "support:5", "--csv", "s.csv"])
        .exits(0);
    let find = |more: &[&str]| {
        let args =
            ["match", "--materials", "synthetic", "--target", "s.csv", "--depth", "4", "--model", "km", "--json"];
        stack(&bench.run(args.iter().chain(more)).exits(0).json())
    };
    let limited = find(&[]);
    let above: f64 = limited.iter().take_while(|layer| layer.0 != "support").map(|layer| layer.1).sum();
    assert!(above >= 0.2, "{limited:?}");
    assert_eq!(find(&["--min-depth", "support:0"])[0].0, "support");
    let deep = find(&["--min-depth", "support:0", "--min-depth", "white:1.0"]);
    let above: f64 = deep.iter().take_while(|layer| layer.0 != "white").map(|layer| layer.1).sum();
    assert!(above >= 1.0, "{deep:?}");
}

/// Asked without further ado, an albedo that some stack reaches is met; one that none reaches is told.
#[test]
fn by_default_the_albedo_is_met() {
    let wide = |albedo: &str| {
        let target = ["--albedo", albedo, "--mean-free-path-mm", "1.2", "--core", "black", "--json"];
        let ran = find(&target).exits(0);
        let found = ran.json()["look"]["albedo"][0][1].as_f64().unwrap();
        (found, ran.stderr)
    };
    for albedo in ["0.598", "0.2"] {
        let (found, words) = wide(albedo);
        assert!((found / albedo.parse::<f64>().unwrap() - 1.0).abs() < 0.01, "{found} for {albedo}");
        assert!(!words.contains("warning: "), "{words}");
    }
    let (found, words) = wide("0.9");
    assert!(found < 0.7 && words.contains("warning: albedo"), "{found}: {words}");
    assert!(words.contains("warning: a shadow's edge") && words.contains("less far inside than asked"), "{words}");
}

#[test]
fn an_infeasible_target_is_answered_no() {
    let target = ["--albedo", "0.5", "--mean-free-path-mm", "1", "--core", "black"];
    let limits = ["--min-depth", "white:5", "--min-depth", "black:5", "--min-depth", "support:5"];
    let ran = find(&[&target[..], &limits].concat()).exits(1);
    assert_eq!(ran.stdout, "");
    assert!(ran.stderr.contains("no: no stacking"), "{}", ran.stderr);
    let json = find(&[&target[..], &limits, &["--json"]].concat()).exits(1).json();
    assert_eq!(json["stack"], Value::Null);
}

#[test]
fn bad_targets_are_refused() {
    let with = |more: &[&str]| find(&[&["--albedo", "0.5", "--mean-free-path-mm", "1"], more].concat());
    find(&["--albedo", "1.5", "--mean-free-path-mm", "1"]).refuses(2, &["--albedo: found 1.5", "0 to 1"]);
    find(&["--albedo", "0.5", "--mean-free-path-mm", "0"]).refuses(2, &["--mean-free-path-mm: found 0", "0.0001"]);
    find(&["--albedo", "0.5", "--mean-free-path-mm", "-1"]).exits(2);
    find(&["--albedo", "0.5,0.4", "--mean-free-path-mm", "1"]).refuses(2, &["--albedo: found 2 values"]);
    find(&["--target", "none.csv"]).refuses(2, &["none.csv"]);
    with(&["--core", "blakc"]).refuses(2, &["did you mean `black`?"]);
    with(&["--min-depth", "suport:1"]).refuses(2, &["did you mean `support`?"]);
    with(&["--min-depth", "white:1", "--min-depth", "white:2"]).refuses(2, &["a second time"]);
    with(&["--units", "5000"]).refuses(2, &["units", "4096"]);
    with(&["--max-thickness-mm", "0"]).refuses(2, &["max-thickness-mm"]);
    for usage in [&["--depth", "13"][..], &["--target", "p.csv"], &["--min-depth", "white"], &["--units", "-1"]] {
        assert_eq!(with(usage).exits(2).stdout, "");
    }
    find(&["--albedo", "0.5"]).exits(2);
    find(&[]).exits(2);
}
