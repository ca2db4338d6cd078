//! `material`: the sets there are, and new ones by simulation.

use std::fs;

use crate::support::{Bench, run};

#[test]
fn built_in_sets_are_listed_with_their_provenance() {
    let text = run(["material", "list"]).exits(0).stdout;
    assert_eq!(text.matches("not a measurement").count(), 3, "{text}");
    let sets = run(["material", "list", "--json"]).exits(0).json();
    let resins: Vec<_> = sets[0]["resins"].as_array().unwrap().iter().map(|name| name.as_str().unwrap()).collect();
    assert_eq!((sets[0]["name"].as_str(), resins.as_slice()), (Some("synthetic"), &["white", "black", "support"][..]));
    assert_eq!(sets[1]["channels"].as_array().unwrap().len(), 3);
}

#[test]
fn a_set_is_shown_with_coefficients_and_slabs() {
    let json = run(["material", "show", "synthetic", "--json"]).exits(0).json();
    let white = &json["resins"][0];
    assert_eq!(white["coefficients"][0]["scattering_per_mm"].as_f64(), Some(8.0));
    assert!((white["half_space_reflection"][0].as_f64().unwrap() - 0.628).abs() < 2e-3);
    assert!(json["remarks"].as_array().unwrap().iter().any(|remark| remark.as_str().unwrap().contains("extrapolated")));
    let text = run(["material", "show", "synthetic"]).exits(0).stdout;
    assert!(text.contains("half-space") && text.contains("background") && text.contains("remark: "), "{text}");
    run(["material", "show", "synthetik"]).refuses(2, &["did you mean `synthetic`?"]);
}

#[test]
fn simulated_profiles_are_a_set_of_their_own() {
    let bench = Bench::new();
    let simulate =
        |out: &str| bench.run(["material", "simulate", "synthetic", "--photons", "60000", "-o", out]).exits(0);
    let ran = simulate("a");
    assert!(ran.stdout.trim_end().ends_with("a/synthetic.toml"), "{}", ran.stdout);
    simulate("b");
    assert_eq!(bench.files("a"), bench.files("b"));
    let names: Vec<_> = bench.files("a").into_keys().collect();
    let expected = ["synthetic-black-y.csv", "synthetic-support-y.csv", "synthetic-white-y.csv", "synthetic.toml"];
    assert_eq!(names, expected);
    let ran = bench.run(["predict", "--materials", "a/synthetic.toml", "--stack", "white:5", "--json"]).exits(0);
    assert!((ran.json()["reflection"][0].as_f64().unwrap() - 0.628).abs() < 0.01);

    let before = bench.files("a");
    let again = ["material", "simulate", "synthetic", "--photons", "5000", "-o", "a"];
    bench.run(again).refuses(2, &["synthetic-white-y.csv", "--overwrite"]);
    assert_eq!(bench.files("a"), before);
    bench.run(again.iter().chain(&["--overwrite", "--resin", "white", "--thickness-mm", "0.5"])).exits(0);
    let changed = bench.files("a");
    assert_eq!(changed["synthetic-black-y.csv"], before["synthetic-black-y.csv"]);
    let toml = fs::read_to_string(bench.path("a/synthetic.toml")).unwrap();
    assert!(toml.contains("thickness-mm = [0.5]") && !toml.contains("black"), "{toml}");
}

#[test]
fn what_cannot_be_simulated_is_refused_before_anything_is_written() {
    let bench = Bench::new();
    bench.write("file", b"");
    let simulate = |more: &[&str]| bench.run(["material", "simulate", "synthetic"].iter().chain(more));
    simulate(&["--resin", "wite", "-o", "x"]).refuses(2, &["did you mean `white`?"]);
    simulate(&["-o", "file"]).refuses(2, &["file: found a file, expected a folder"]);
    simulate(&["--photons", "1", "-o", "x"]).exits(2);
    simulate(&["--thickness-mm", "0", "-o", "x"]).exits(2);
    assert!(!bench.path("x").exists());
    simulate(&["-o", "file/x"]).refuses(3, &["writing failed"]);
}

#[test]
fn colours_that_printers_mix_up_are_refused() {
    let bench = Bench::new();
    let set = |white: &str, black: &str| {
        let resin = |name: &str, rgba: &str| {
            format!(
                "[[resin]]\nname = \"{name}\"\nrgba = {rgba}\ndensity-g-per-cm3 = 1\nscattering-per-mm = \
                    1\nabsorption-per-mm = 1\n"
            )
        };
        bench.write("m.toml", (resin("white", white) + &resin("black", black)).as_bytes());
        bench.job_with("set = \"synthetic\"", "file = \"m.toml\"");
        bench.run(["slice", "job.toml", "-o", "out"])
    };
    set("[9, 9, 9]", "[9, 9, 9, 255]").refuses(2, &["m.toml:9", "rgba", "a colour other than that of white"]);
    set("[9, 9, 9, 254]", "[0, 0, 0]").refuses(2, &["m.toml:3", "[9, 9, 9, 254]", "alpha 255"]);
    set("[9, 9, 9]", "[8, 8, 8, 0]").refuses(2, &["m.toml:9", "alpha 255"]);
    assert!(!bench.path("out").exists());
}

/// Sheets of a known resin, as `predict` sees them, become its coefficients again, and a file that `show` reads.
#[test]
fn sheets_become_a_material_file() {
    let bench = Bench::new();
    let mut table = String::from("thickness_mm,reflectance,transmittance\n");
    for mm in ["0.3", "1", "3"] {
        let stack = format!("white:{mm}");
        let seen = bench
            .run([
                "predict",
                "--materials",
                "synthetic",
                "--stack",
                &stack,
                "--model",
                "transport",
                "--light",
                "diffuse",
                "--json",
            ])
            .exits(0)
            .json();
        table += &format!("{mm},{},{}\n", seen["reflection"][0], seen["transmission"][0]);
    }
    bench.write("sheets.csv", table.as_bytes());
    let file = "[resin]\nname = \"white\"\nrgba = [255, 255, 255]\ndensity-g-per-cm3 = 1.18\nrefractive-index = 1\n\
                [instrument]\nlight = \"diffuse\"\nspecular = \"included\"\n[samples]\nfile = \"sheets.csv\"\n";
    bench.write("sheets.toml", file.as_bytes());
    let fit = ["material", "fit", "sheets.toml", "-o", "white.toml"];
    let found = bench.run(fit.into_iter().chain(["--json"])).exits(0).json();
    let channel = &found["channels"][0];
    let (scattering, absorption) =
        (channel["reduced_scattering_per_mm"].as_f64().unwrap(), channel["absorption_per_mm"].as_f64().unwrap());
    assert!((scattering / 4.0 - 1.0).abs() < 0.01 && (absorption / 0.17 - 1.0).abs() < 0.01, "{found}");
    bench.run(fit).refuses(2, &["white.toml", "--overwrite"]);
    let ran = bench.run(fit.into_iter().chain(["--overwrite"])).exits(0);
    assert!(ran.stdout.trim_end().ends_with("white.toml"), "{}", ran.stdout);
    let shown = bench.run(["material", "show", "white.toml", "--json"]).exits(0).json();
    assert_eq!(shown["resins"][0]["coefficients"][0]["g"].as_f64(), Some(0.5));
    bench.write("sheets.toml", file.replace("refractive-index = 1\n", "").as_bytes());
    bench.run(fit.into_iter().chain(["--overwrite"])).refuses(2, &["sheets.toml", "refractive-index"]);
}

#[test]
fn a_coupon_is_written_and_its_slices_with_it() {
    let bench = Bench::new();
    let coupon = ["material", "coupon", "--materials", "synthetic", "-o", "coupon"];
    let ran = bench.run(coupon).exits(0);
    // Support is what holes are filled with: no field shows it.
    assert!(ran.stderr.contains("resin support is what the printer fills holes with"), "{}", ran.stderr);
    assert!(ran.stdout.contains("32 fields of 8 mm: white, black"), "{}", ran.stdout);
    let text = fs::read_to_string(bench.path("coupon/coupon.json")).unwrap();
    let written: serde_json::Value = serde_json::from_str(&text).unwrap();
    assert_eq!(written["fields"].as_array().unwrap().len(), 32);
    let manifest = fs::read_to_string(bench.path("coupon/print/manifest.json")).unwrap();
    let manifest: serde_json::Value = serde_json::from_str(&manifest).unwrap();
    let [x, y, z] = [0, 1, 2].map(|axis| manifest["lattice"]["dims"][axis].as_f64().unwrap());
    let pitch = [25.4 / 600.0, 25.4 / 300.0, 0.027];
    for (axis, (voxels, pitch)) in [x, y, z].into_iter().zip(pitch).enumerate() {
        let size = written["size_mm"][axis].as_f64().unwrap();
        assert!((voxels * pitch - size).abs() < 1.01 * pitch, "{axis}: {voxels} voxels for {size} mm");
    }
    bench.run(coupon).refuses(2, &["coupon", "--overwrite"]);
    bench.run(coupon.into_iter().chain(["--overwrite", "--no-slices"])).exits(0);
    let near = ["material", "coupon", "--materials", "synthetic", "--spacing-mm", "5", "-o", "near"];
    bench.run(near).refuses(2, &["spacing: found 5 mm, expected 8 to 40 mm"]);
    bench.run(["material", "fit", "--coupon", "coupon/coupon.json", "-o", "fitted.toml"]).exits(2);
    bench.run(["material", "fit", "-o", "fitted.toml"]).exits(2);
    bench.write("photo.png", b"no picture");
    let fit = ["material", "fit", "--coupon", "coupon/coupon.json", "--photo", "photo.png", "--card", "photo.png"];
    bench.run(fit.into_iter().chain(["--card-albedo", "0.9", "-o", "fitted.toml"])).refuses(2, &["photo.png: found"]);
    assert!(!bench.path("fitted.toml").exists());
}
