//! Sheets simulated by photons, with an instrument's noise, measured: the coefficients and what they predict come back.

use super::*;
use crate::measure::dice::Dice;
use crate::optics::{MonteCarlo, RingEdges};
use crate::watch::Unwatched;

const INDEX: f64 = 1.5;
const NOISE: f64 = 0.005;
/// Name, σs, σa, g, sheets in mm.
const RESINS: [(&str, f64, f64, f64, [f64; 3]); 3] = [
    ("white", 8.0, 0.17, 0.5, [0.3, 1.0, 3.0]),
    ("black", 2.5, 4.0, 0.5, [0.1, 0.25, 0.6]),
    ("support", 1.6, 0.025, 0.75, [0.5, 2.0, 5.6]),
];

const BARE: Instrument = Instrument {
    model: String::new(),
    light: Light::Normal,
    specular: true,
    relative_error: NOISE,
    absolute_error: 5e-4,
    calibration_error: 0.005,
};

fn volume(sigma_s: f64, sigma_a: f64, g: f64) -> VolumeCoefficients {
    VolumeCoefficients::new(sigma_s, sigma_a, g).unwrap().with_refractive_index(INDEX)
}

/// A sheet by photons: R with the glint, T, of light along the normal.
fn photons(volume: VolumeCoefficients, mm: f64, seed: u64) -> [f64; 2] {
    let job = MonteCarlo {
        stack: Stack::new([(volume, mm)]),
        light: Light::Normal,
        photons: 400_000,
        seed,
        rings: RingEdges::growing(),
    };
    let found = job.run().unwrap();
    [found.reflection.mean + found.glint.mean, found.transmission.mean]
}

fn folder_with(table: &str, resin: &str, g: f64) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let file = format!(
        "[resin]\nname = \"{resin}\"\nrgba = [255, 255, 255, 255]\ndensity-g-per-cm3 = 1.18\nrefractive-index = \
         {INDEX}\ng = {g}\n\
         [instrument]\nmodel = \"simulated\"\nlight = \"normal\"\nspecular = \"included\"\nrelative-error = {NOISE}\n\
         [samples]\nfile = \"t.csv\"\n"
    );
    std::fs::write(folder.path().join("fit.toml"), file).unwrap();
    std::fs::write(folder.path().join("t.csv"), table).unwrap();
    folder
}

fn fitted(table: &str, resin: &str, g: f64) -> Result<TotalsFit, MeasureError> {
    let folder = folder_with(table, resin, g);
    let totals = Totals::read(&folder.path().join("fit.toml"))?;
    Ok(fit_totals(&totals, &Unwatched)?.remove(0))
}

/// Three sheets of a resin as a table.
fn table((_, sigma_s, sigma_a, g, sheets): (&str, f64, f64, f64, [f64; 3]), dice: &mut Dice) -> String {
    let mut text = String::from("thickness_mm,reflectance,transmittance\n");
    for (seed, mm) in sheets.into_iter().enumerate() {
        let [r, t] = photons(volume(sigma_s, sigma_a, g), mm, seed as u64).map(|value| dice.noisy(value, NOISE));
        text += &format!("{mm},{r},{t}\n");
    }
    text
}

/// The requirement: 3 thicknesses, 0.5% noise, σs (1 − g) within 2%, σa within 5%; 20 stacks within 1%.
#[test]
fn coefficients_come_back_and_predict_stacks() {
    let mut dice = Dice(7);
    let mut pairs = Vec::new();
    for resin in RESINS {
        let (name, sigma_s, sigma_a, g, _) = resin;
        let fit = fitted(&table(resin, &mut dice), name, g).unwrap();
        let [(reduced, error), (absorption, its)] = fit.coefficients_with_errors();
        let off = [reduced / (sigma_s * (1.0 - g)) - 1.0, absorption / sigma_a - 1.0];
        println!("{name}: {off:.4?}, ± {:.4} and {:.4}, misfit {:.2}", error / reduced, its / absorption, fit.misfit);
        assert!(off[0].abs() < 0.02 && off[1].abs() < 0.05, "{name}: {off:?}");
        assert!(off[0].abs() < 3.0 * error / reduced && off[1].abs() < 3.0 * its / absorption, "{name}: {fit:?}");
        assert!(fit.misfit < 2.0, "{name}: {}", fit.misfit);
        pairs.push((volume(sigma_s, sigma_a, g), fit.coefficients));
    }
    let albedo = |layers: &[(VolumeCoefficients, f64)]| {
        let stack = Stack::new(layers.to_vec());
        let model = Transport { stack: &stack, light: Light::Diffuse, options: OPTIONS };
        model.spectra(&FrequencyGrid::of(vec![0.0])).reflection[0]
    };
    let (mut worst, mut dark): (f64, f64) = (0.0, 0.0);
    for _ in 0..20 {
        let layers: Vec<(usize, f64)> =
            (0..3).map(|_| (((dice.roll() + 1.0) * 1.4999) as usize, 0.1 + 1.5 * (dice.roll() + 1.0))).collect();
        let of = |which: fn(&(VolumeCoefficients, VolumeCoefficients)) -> VolumeCoefficients| {
            albedo(&layers.iter().map(|(resin, mm)| (which(&pairs[*resin]), *mm)).collect::<Vec<_>>())
        };
        let (truth, found) = (of(|pair| pair.0), of(|pair| pair.1));
        // Black reflects 0.03 beside 0.04 of glint: half a percent of that sum is more than a percent of it.
        worst = worst.max((found - truth).abs() / truth.max(0.1));
        dark = dark.max((found / truth - 1.0).abs());
    }
    println!("20 stacks: albedo within {:.2}%, and {:.2}% of albedos below 0.1", 100.0 * worst, 100.0 * dark);
    assert!(worst < 0.01 && dark < 0.025, "{worst} {dark}");
}

/// A backing under a film of air: by transport of the sheet alone and a mirror-free surface below, against photons that
/// are sent round by hand; and one thick sheet over black and white tells what two bare ones do.
#[test]
fn backings_tell_absorption() {
    let (_, sigma_s, sigma_a, g, _) = RESINS[2];
    let truth = volume(sigma_s, sigma_a, g);
    let instrument = BARE;
    let [bare, through] = seen(truth, 2.0, None, &instrument);
    let [white, same] = seen(truth, 2.0, Some(0.9), &instrument);
    let diffuse = Instrument { light: Light::Diffuse, ..instrument.clone() };
    let [below, back] = seen(truth, 2.0, None, &diffuse);
    // Round by round.
    let (mut sum, mut light) = (bare, through);
    for _ in 0..200 {
        light *= 0.9;
        sum += light * back;
        light *= below;
    }
    assert!((sum - white).abs() < 1e-9 && through == same, "{sum} {white}");
    assert_eq!(seen(truth, 2.0, Some(0.0), &instrument), [bare, through]);
    let mut text = String::from("thickness_mm,backing,reflectance\n");
    for mm in [0.5, 2.0, 5.6] {
        for rho in [0.03, 0.9] {
            text += &format!("{mm},{rho},{}\n", seen(truth, mm, Some(rho), &instrument)[0]);
        }
    }
    let fit = fitted(&text, "support", g).unwrap();
    let [(reduced, _), (absorption, _)] = fit.coefficients_with_errors();
    assert!(
        (reduced / (sigma_s * (1.0 - g)) - 1.0).abs() < 1e-3 && (absorption / sigma_a - 1.0).abs() < 1e-3,
        "{fit:?}"
    );
}

/// Spectra of a resin alike at all wavelengths are the same three channels; as wavelengths they stay apart.
#[test]
fn spectra_become_channels() {
    let truth = volume(8.0, 0.17, 0.5);
    let instrument = BARE;
    let mut text = String::from("sample,thickness_mm,wavelength_nm,reflectance,transmittance\n");
    for (name, mm) in [("thin", 0.5), ("thick", 2.0)] {
        let [r, t] = seen(truth, mm, None, &instrument);
        (0..36).for_each(|i| text += &format!("{name},{mm},{},{r},{t}\n", 380 + 10 * i));
    }
    let folder = folder_with(&text, "white", 0.5);
    let totals = Totals::read(&folder.path().join("fit.toml")).unwrap();
    assert_eq!((totals.channels.len(), totals.sheets.len()), (3, 2));
    for fit in fit_totals(&totals, &Unwatched).unwrap() {
        assert!((fit.coefficients.sigma_a / 0.17 - 1.0).abs() < 1e-3, "{fit:?}");
    }
    let path = folder.path().join("fit.toml");
    let file = std::fs::read_to_string(&path).unwrap() + "channels = \"wavelengths\"\n";
    std::fs::write(&path, file).unwrap();
    let totals = Totals::read(&path).unwrap();
    assert_eq!((totals.channels.len(), totals.channels[0].as_str()), (36, "380nm"));
}

#[test]
fn what_is_no_table_is_refused() {
    let refused = |table: &str, words: &str| {
        let error = fitted(table, "white", 0.5).unwrap_err().to_string();
        assert!(error.contains(words) && !error.contains('\n'), "{error}");
    };
    let words = "t.csv:2: reflectance: found 63, expected a share of the light and not percent";
    refused("thickness_mm,reflectance\n1,63\n", words);
    refused("thickness_mm,reflectance\n300,0.6\n", "found 300, expected mm, 0.001 to 100");
    refused("thickness_mm;reflectance\n1;0,6\n", "found columns apart by semicolons, expected commas");
    refused("thickness_mm,reflectance\n1,0,6\n", "found 3 cells, expected 2 cells as the header; numbers have a point");
    refused("thickness_mm,reflectance,reflectance\n1,0.6,0.5\n", "found reflectance twice");
    let words = "t.csv:3: row: found two rows of sample a, expected one: over another backing it is another sample";
    refused("sample,thickness_mm,backing,reflectance\na,1,0.05,0.6\na,1,0.85,0.7\n", words);
    let words = "t.csv:3: reflectance + transmittance: found 1.200 of the light";
    refused("thickness_mm,backing,reflectance,transmittance\n1,0.9,0.6,0.4\n1,,0.6,0.6\n", words);
    refused("thickness_mm,reflectance,transmittance\n1,0.6,0.6\n", "expected at most 1");
    refused("thickness,reflectance\n1,0.6\n", "expected one of");
    refused("thickness_mm,wavelength_nm,reflectance\n1,500,0.6\n", "expected a column that names the sample");
    refused("sample,thickness_mm,wavelength_nm,reflectance\na,1,500,0.6\na,1,600,0.6\n", "expected 420 to 680 nm");
    let gap = (0..36).map(|i| 380 + 10 * i).filter(|nm| !(490..=610).contains(nm));
    let rows: String = gap.map(|nm| format!("a,1,{nm},0.6\n")).collect();
    let words = "found nothing between 480 and 620 nm, expected a value every 25 nm";
    refused(&format!("sample,thickness_mm,wavelength_nm,reflectance\n{rows}"), words);
    // One number for two coefficients.
    refused("thickness_mm,reflectance\n1,0.5\n", "expected an uncertainty below half of it");
    // Thick sheets that let more through than thin ones.
    refused("thickness_mm,reflectance,transmittance\n0.3,0.6,0.1\n3,0.3,0.4\n", "missed by");
}

/// Notes of a table of sheets without noise, of an instrument that sees the glint or does not.
fn notes_of(text: &str, specular: bool) -> (TotalsFit, Vec<String>) {
    let folder = folder_with(text, "resin", 0.5);
    let mut totals = Totals::read(&folder.path().join("fit.toml")).unwrap();
    totals.instrument.specular = specular;
    let fits = fit_totals(&totals, &Unwatched).unwrap();
    (fits[0].clone(), totals.notes(&fits))
}

/// By transmittance alone, white has a valley of little scattering beside its own.
#[test]
fn transmittance_alone_is_fitted() {
    for (sigma_s, sigma_a) in [(12.0, 0.01), (8.0, 0.17), (3.0, 0.05)] {
        let row = |mm: f64| format!("{mm},{}\n", seen(volume(sigma_s, sigma_a, 0.5), mm, None, &BARE)[1]);
        let text = format!("thickness_mm,transmittance\n{}", [0.3, 1.0, 3.0].map(row).concat());
        let (fit, notes) = notes_of(&text, true);
        let [(reduced, _), (absorption, _)] = fit.coefficients_with_errors();
        assert!((reduced / (0.5 * sigma_s) - 1.0).abs() < 1e-2, "{sigma_s} {sigma_a}: {fit:?}");
        assert!((absorption / sigma_a - 1.0).abs() < 0.05, "{sigma_s} {sigma_a}: {fit:?}");
        assert!(notes.is_empty(), "{notes:?}");
    }
}

/// Reflectances that are all 3% low are another resin's: nothing tells, so it is part of what is stated.
#[test]
fn a_standard_that_is_off_is_within_what_is_stated() {
    for (name, sigma_s, sigma_a, g, sheets) in RESINS {
        let row = |mm: f64| {
            let [r, t] = seen(volume(sigma_s, sigma_a, g), mm, None, &BARE);
            format!("{mm},{},{t}\n", 0.97 * r)
        };
        let text = format!("thickness_mm,reflectance,transmittance\n{}", sheets.map(row).concat());
        let folder = folder_with(&text, name, g);
        let mut totals = Totals::read(&folder.path().join("fit.toml")).unwrap();
        assert_eq!(totals.instrument.calibration_error, 0.005);
        totals.instrument.calibration_error = 0.03;
        let fit = fit_totals(&totals, &Unwatched).unwrap().remove(0);
        let [(reduced, error), (absorption, its)] = fit.coefficients_with_errors();
        let off = [reduced - sigma_s * (1.0 - g), absorption - sigma_a];
        println!("{name}: {off:.4?}, stated {error:.4} and {its:.4}");
        assert!(off[0].abs() < 1.5 * error && off[1].abs() < 1.5 * its, "{name}: {off:?}, {error} and {its}");
        assert!(off[1].abs() > 0.02 * sigma_a, "{name}: {off:?}: does a standard count at all?");
    }
}

/// Reflectance with the glint, stated without it, and the other way.
#[test]
fn a_glint_that_is_misstated_is_named() {
    for (sigma_s, sigma_a) in [(8.0, 0.17), (5.0, 0.3), (20.0, 0.02)] {
        for specular in [true, false] {
            let truly = Instrument { specular, ..BARE };
            let row = |mm: f64| {
                let [r, t] = seen(volume(sigma_s, sigma_a, 0.5), mm, None, &truly);
                format!("{mm},{r},{t}\n")
            };
            let text = format!("thickness_mm,reflectance,transmittance\n{}", [0.3, 1.0, 3.0].map(row).concat());
            assert_eq!(notes_of(&text, specular).1, Vec::<String>::new());
            let notes = notes_of(&text, !specular).1;
            let stated = if specular { "specular = \"included\"" } else { "specular = \"excluded\"" };
            assert!(notes.iter().any(|note| note.contains(stated)), "{sigma_s} {sigma_a} {specular}: {notes:?}");
        }
    }
}

#[test]
fn what_nothing_checks_is_said() {
    let [r, t] = seen(volume(8.0, 0.17, 0.5), 0.04, None, &BARE);
    // As a spreadsheet writes it.
    let notes =
        notes_of(&format!("\u{feff}\"Thickness_mm\",Reflectance,TRANSMITTANCE\r\n\"0.04\",{r},{t}\r\n"), true).1;
    assert!(notes[0].contains("nothing checks them") && notes[1].contains("are thicknesses in mm?"), "{notes:?}");
}

/// A measured sample: a phantom of PDMS, 2.65 mm without slides, in a dual-beam spectrometer (A. Bahl, King's College;
/// docs/phantom-with-no-slides.rxt and phantom_with_no_slides.txt of scottprahl/iad, MIT), and what inverse
/// adding–doubling 3-16-2 makes of it, which also takes off the light lost at the ports' edges of a beam of 10 mm.
#[test]
fn a_measured_phantom_is_what_inverse_adding_doubling_finds() {
    // nm, refractive index, reflectance, transmittance, σa and σs (1 − g) per mm.
    const ROWS: [[f64; 6]; 6] = [
        [1180.0, 1.41963, 0.25386, 0.14445, 0.1211, 1.0317],
        [900.0, 1.42210, 0.53089, 0.24458, 0.0240, 1.6744],
        [700.0, 1.42604, 0.61826, 0.20438, 0.0183, 2.4302],
        [600.0, 1.42970, 0.64189, 0.17381, 0.0195, 2.9135],
        [500.0, 1.43591, 0.66478, 0.15106, 0.0197, 3.4238],
        [420.0, 1.44470, 0.66685, 0.13376, 0.0220, 3.7511],
    ];
    for [nm, index, r, t, absorption, reduced] in ROWS {
        let folder = folder_with(&format!("thickness_mm,reflectance,transmittance\n2.65,{r},{t}\n"), "pdms", 0.9);
        let mut totals = Totals::read(&folder.path().join("fit.toml")).unwrap();
        totals.resin.refractive_index = index;
        let fit = fit_totals(&totals, &Unwatched).unwrap().remove(0);
        let [(scattering, _), (found, _)] = fit.coefficients_with_errors();
        let off = [scattering / reduced - 1.0, found / absorption - 1.0];
        println!("{nm} nm: {off:.4?}");
        assert!(off[0].abs() < 0.02 && off[1].abs() < 0.05, "{nm} nm: {off:?}");
    }
}
