//! Material files: what is good is read, what is not is named with its line; built-in sets are what their coefficients
//! say.

use std::sync::atomic::{AtomicU64, Ordering};

use crate::optics::{MaterialFile, MaterialSet, OpticsError, VolumeCoefficients, regenerate_builtin};
use crate::watch::{Interrupt, Thousandths, Unwatched, Watch};

const GOOD: &str = r#"channels = ["R", "G"]
provenance = "made up"
[[resin]]
name = "white"
rgba = [255, 255, 255]
density-g-per-cm3 = 1.2
scattering-per-mm = 8
absorption-per-mm = [0.2, 0.3]
g = 0.5
[[resin]]
name = "hole"
rgba = [1, 2, 3, 4]
density-g-per-cm3 = 1.1
scattering-per-mm = [0.5, 0.6]
absorption-per-mm = 0
thickness-mm = 0.5
print-as = "background"
"#;

/// Reads a text as the file `set.toml` of a folder of its own, with `p.csv` and `q.csv` beside it.
fn read(text: &str) -> Result<MaterialFile, OpticsError> {
    let folder = tempfile::tempdir().unwrap();
    let profile = |header: &str, scale: f64| {
        let row = |i: i32| format!("{},{}\n", 0.05 * f64::from(i), scale * (-f64::from(i) * 0.05).exp());
        (1..300).map(row).fold(format!("{header}\n"), |text, row| text + &row)
    };
    std::fs::write(folder.path().join("p.csv"), profile("r_mm,reflection_per_mm2", 0.05)).unwrap();
    std::fs::write(folder.path().join("q.csv"), profile("r_mm,transmission_per_mm2", 0.03)).unwrap();
    std::fs::write(folder.path().join("bright.csv"), profile("r_mm,reflection_per_mm2", 0.14)).unwrap();
    let path = folder.path().join("set.toml");
    std::fs::write(&path, text).unwrap();
    MaterialFile::read(&path)
}

/// The message, from the file's name on.
fn message(text: &str) -> String {
    let error = read(text).expect_err("refused").to_string();
    assert_eq!(error.lines().count(), 1, "{error}");
    error.rsplit('/').next().unwrap().to_string()
}

const MEASURED: &str = r#"[[resin]]
name = "wax"
rgba = [9, 9, 9]
density-g-per-cm3 = 1.1
reflection = "p.csv"
transmission = "q.csv"
thickness-mm = 2
"#;

#[test]
fn a_file_of_coefficients_is_read() {
    let file = read(GOOD).unwrap();
    let resins: Vec<_> = file.coefficients().collect();
    let of = |sigma_s, sigma_a, g| VolumeCoefficients { sigma_s, sigma_a, g, refractive_index: 1.0 };
    assert_eq!(resins[0].1, [of(8.0, 0.2, 0.5), of(8.0, 0.3, 0.5)]);
    assert_eq!(resins[1].1, [of(0.5, 0.0, 0.0), of(0.6, 0.0, 0.0)]);
    assert_eq!(resins[1].2, [0.5, 0.5]);
    assert!(resins[0].2[0] > resins[0].2[1], "more absorption, thinner slab: {:?}", resins[0].2);
}

#[test]
fn measured_profiles_become_kubelka_munk_parameters() {
    let set = read(MEASURED).unwrap().into_set(&Unwatched).unwrap();
    assert_eq!(set.channels, ["Y"]);
    let wax = &set.resins[0];
    let back = wax.channels[0].kubelka_munk.slab(2.0);
    assert!((back.reflection[0] - 0.05 * std::f64::consts::TAU).abs() < 1e-3, "{}", back.reflection[0]);
    assert!((back.transmission[0] - 0.03 * std::f64::consts::TAU).abs() < 1e-3);
    assert!(wax.volumes().is_none());
}

#[test]
fn slabs_of_several_thicknesses_are_read() {
    let slab = |lines: &str| format!("{MEASURED}[[resin.slab]]\n{lines}\n");
    let thin = "reflection = \"p.csv\"\ntransmission = \"q.csv\"\nthickness-mm = 1";
    assert!(read(&slab(thin)).is_ok());
    // The first of the tables is the slab that the others follow, if none stands in the resin itself.
    let only = slab(thin).replace("reflection = \"p.csv\"\ntransmission = \"q.csv\"\nthickness-mm = 2\n", "");
    let set = read(&only).unwrap().into_set(&Unwatched).unwrap();
    assert_eq!(set.resins[0].channels[0].slab_mm, 1.0);
    for (lines, fault) in [
        ("thickness-mm = 1", "resin wax: slab 1: reflection: found nothing, expected the slab's profiles"),
        (
            "reflection = \"p.csv\"\ntransmission = \"q.csv\"",
            "slab 1: thickness-mm: found nothing, expected the slab's thickness",
        ),
        (&thin.replace('1', "0"), "slab 1: thickness-mm: found 0, expected more than 0, at most 100"),
        (&thin.replace("thick", "thikc"), "key: found `thikcness-mm`"),
    ] {
        let found = message(&slab(lines));
        assert!(found.contains(fault), "{found}");
    }
}

#[test]
fn profiles_that_no_coefficients_fit_leave_the_resin_to_kubelka_munk() {
    let mut file = read(MEASURED).unwrap();
    let refused = file.fit(None, &Unwatched).unwrap();
    assert!(refused.len() == 1 && refused[0].starts_with("resin wax, channel Y: no coefficients fit"), "{refused:?}");
    let set = file.into_set(&Unwatched).unwrap();
    assert!(set.resins[0].volumes().is_none() && set.warnings.contains(&refused[0]));
    let mut file = read(MEASURED).unwrap();
    let stop = Interrupt::new();
    stop.request();
    assert!(matches!(file.fit(None, &stop), Err(OpticsError::Stopped(_))));
    assert!(file.fit(Some(&["white"]), &stop).unwrap().is_empty());
}

/// Counts the steps that are done.
#[derive(Default)]
struct Counted(AtomicU64);

impl Watch for Counted {
    fn advance(&self, steps: u64) {
        self.0.fetch_add(steps, Ordering::Relaxed);
    }
}

#[test]
fn coefficients_are_simulated_and_can_be_cancelled() {
    let measured = "reflection = \"p.csv\"\ntransmission = \"q.csv\"\nthickness-mm = 2";
    let simulated = "scattering-per-mm = 8\nabsorption-per-mm = 90\nprint-as = \"background\"";
    let thin = MEASURED.replace(measured, simulated); // few events a photon, hence quick
    let counted = Counted::default();
    let set = read(&thin).unwrap().into_set(&counted).unwrap();
    assert_eq!(counted.0.into_inner(), Thousandths::STEPS);
    assert!(set.resins[0].print_as_background);
    let stop = Interrupt::new();
    stop.request();
    assert!(matches!(read(GOOD).unwrap().into_set(&stop), Err(OpticsError::Stopped(_))));
}

#[test]
fn what_is_wrong_is_named_with_its_line() {
    let swap = |from: &str, to: &str| GOOD.replacen(from, to, 1);
    let cases = [
        (swap("g = 0.5", "g = 1.5"), "set.toml:9: resin white: g: found 1.5, expected a mean cosine"),
        (swap("g = 0.5", "gg = 0.5"), "set.toml:9: resin white: key: found `gg`"),
        (
            swap("[0.2, 0.3]", "[0.2, 0.3, 0.4]"),
            "set.toml:8: resin white: absorption-per-mm: found 3 numbers, expected one",
        ),
        (swap("[0.2, 0.3]", "[0.2, -0.3]"), "set.toml:8: resin white: absorption-per-mm: found -0.3"),
        (
            swap("[0.2, 0.3]", "\"much\""),
            "set.toml:8: resin white: absorption-per-mm: found a string, expected a number",
        ),
        (
            swap("scattering-per-mm = 8", "scattering-per-mm = nan"),
            "set.toml:7: resin white: scattering-per-mm: found NaN",
        ),
        (swap("scattering-per-mm = 8\n", ""), "scattering-per-mm: found nothing"),
        (swap("scattering-per-mm = 8", "scatering-per-mm = 8"), "did you mean `scattering-per-mm`?"),
        (
            swap("\"hole\"", "\"White\""),
            "set.toml:11: resin White: name: found White, expected a name no other resin has",
        ),
        (swap("\"hole\"", "\"a:b\""), "set.toml:11: resin a:b: name: found a:b, expected letters, digits, spaces"),
        (swap("\"hole\"", "\"a.\""), "set.toml:11: resin a.: name: found a., expected letters, digits, spaces"),
        (
            swap("\"hole\"", "\"Con.2\""),
            "set.toml:11: resin Con.2: name: found Con.2, expected a name that Windows does not keep for a device",
        ),
        (swap("\"hole\"", &format!("\"{}\"", "a".repeat(201))), "expected at most 200 bytes"),
        (swap("[1, 2, 3, 4]", "[255, 255, 255]"), "set.toml:12: resin hole: rgba: found [255, 255, 255, 255]"),
        (swap("[1, 2, 3, 4]", "[1, 2, 300]"), "set.toml:12: resin hole: rgba: found [1, 2, 300]"),
        (swap("[255, 255, 255]", "[255, 255, 255, 254]"), "rgba: found [255, 255, 255, 254], expected alpha 255"),
        (swap("[1, 2, 3, 4]", "[0, 0, 0, 0]"), "slices use this one for background"),
        (swap("1.1", "1100"), "set.toml:13: resin hole: density-g-per-cm3: found 1100, expected 0.1 to 25"),
        (swap("= 0.5\nprint", "= -1\nprint"), "set.toml:16: resin hole: thickness-mm: found -1"),
        (swap("\"background\"", "\"nothing\""), "set.toml:17: resin hole: print-as: found nothing"),
        (
            swap("provenance", "provenence"),
            "set.toml:2: key: found `provenence`, expected a known key (did you mean `provenance`?)",
        ),
        (swap("[\"R\", \"G\"]", "[]"), "set.toml:1: channels: found 0 channels"),
        (swap("[\"R\", \"G\"]", "[\"R\", 3]"), "set.toml:1: channels: found an integer"),
        ("channels = [\"R\"]\n".into(), "resin: found nothing, expected at least one [[resin]] table"),
        ("resin = 3\n".into(), "set.toml:1: resin: found an integer"),
        ("[[resin]\n".into(), "set.toml:1: syntax:"),
        (MEASURED.replace("thickness-mm = 2\n", ""), "thickness-mm: found nothing"),
        (MEASURED.replace("transmission = \"q.csv\"\n", ""), "p.csv: header: found no transmission_per_mm2 column"),
        (MEASURED.replace("q.csv", "none.csv"), "none.csv: "),
    ];
    for (text, expected) in cases {
        let message = message(&text);
        assert!(message.contains(expected), "{message:?} lacks {expected:?}");
    }
}

#[test]
fn profiles_that_make_light_are_refused() {
    let file = read(&MEASURED.replace("p.csv", "bright.csv")).unwrap();
    let error = file.into_set(&Unwatched).unwrap_err().to_string();
    assert!(error.contains("set.toml:1: resin wax, channel Y: reflection + transmission at 0.00 rad/mm"), "{error}");
}

#[test]
fn an_unknown_set_is_answered_with_the_nearest() {
    let message = MaterialSet::builtin("sintetic").unwrap_err().to_string();
    assert_eq!(
        message,
        "unknown material set `sintetic`, did you mean `synthetic`?; built in are: synthetic, inks-rgb, inks-rgb-7, \
         vero-j850-provisional"
    );
}

#[test]
fn built_in_sets_are_complete_and_honest() {
    for name in MaterialSet::builtin_names() {
        let set = MaterialSet::builtin(name).unwrap();
        let honest = ["not a measurement", "no measurement"].iter().any(|words| set.provenance.contains(words));
        assert!(honest, "{}", set.provenance);
        for resin in &set.resins {
            assert_eq!(resin.channels.len(), set.channels.len());
            assert_eq!(resin.volumes().unwrap().len(), set.channels.len());
            assert_eq!(resin.channels[0].kubelka_munk.len(), set.grid.len());
        }
        println!("{name}: {:#?}", set.warnings);
    }
    let synthetic = MaterialSet::builtin("synthetic").unwrap();
    let names: Vec<_> = synthetic.resins.iter().map(|resin| resin.name.as_str()).collect();
    assert_eq!(names, ["white", "black", "support"]);
    assert!(synthetic.resins[2].print_as_background);
    let [five, seven] = ["inks-rgb", "inks-rgb-7"].map(|name| MaterialSet::builtin(name).unwrap());
    assert_eq!(seven.resins[..5], five.resins);
    assert!(seven.provenance.contains("invented") && seven.resins[5..].iter().all(|r| r.notes.contains("invented")));
}

#[test]
fn stored_profiles_are_what_a_fresh_simulation_gives() {
    let mut stored = std::collections::BTreeMap::new();
    for name in MaterialSet::builtin_names() {
        let plans = MaterialFile::builtin(name).unwrap().slab_plans(None);
        let channels = MaterialSet::builtin(name).unwrap().resins.into_iter().flat_map(|resin| resin.channels);
        let profiles = channels.map(|channel| (channel.reflection, channel.transmission));
        stored.extend(plans.into_iter().map(|plan| plan.file).zip(profiles));
    }
    let mut seen = 0;
    regenerate_builtin(20_000, &Unwatched, |name, fresh| {
        seen += 1;
        let (r, t) = &stored[name];
        // The fresh error is some 30 times the stored one.
        for (stored, fresh) in [(r.energy(), fresh.result.reflection), (t.energy(), fresh.result.transmission)] {
            let z = (fresh.mean - stored) / fresh.standard_error;
            assert!(z.abs() < 4.5, "{name}: stored {stored}, fresh {} +- {}", fresh.mean, fresh.standard_error);
        }
        Ok(())
    })
    .unwrap();
    assert_eq!(seen, 42, "18 in each of three sets, and two resins of a fourth that shares the rest with one of them");
}
