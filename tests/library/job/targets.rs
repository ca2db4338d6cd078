//! What targets come to in albedo and mean free path, whatever words they are in.

use std::fs;

use lumislice::{
    appearance::{MeasuredMedium, NormalizedDiffusion},
    job::{Job, JobTarget, targets},
    optics::MaterialSet,
    watch::Unwatched,
};

/// A box of 4 mm without texture coordinates.
const BOX: &str = "v 0 0 0\nv 4 0 0\nv 4 4 0\nv 0 4 0\nv 0 0 4\nv 4 0 4\nv 4 4 4\nv 0 4 4\n\
    f 5 6 7 8\nf 1 4 3 2\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n";

fn picture(path: &std::path::Path, width: u32, texels: &[[u8; 3]]) {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, width, texels.len() as u32 / width);
    encoder.set_color(png::ColorType::Rgb);
    encoder.write_header().unwrap().write_image_data(texels.as_flattened()).unwrap();
    fs::write(path, bytes).unwrap();
}

/// What a job on the box asks for.
fn asked(set: &str, target: &str) -> Vec<JobTarget> {
    try_asked(set, target).unwrap_or_else(|error| panic!("{error}"))
}

fn try_asked(set: &str, target: &str) -> Result<Vec<JobTarget>, String> {
    let dir = tempfile::tempdir().unwrap();
    fs::write(dir.path().join("box.obj"), BOX).unwrap();
    picture(&dir.path().join("halves.png"), 2, &[[255, 0, 0], [0, 0, 255]]);
    picture(&dir.path().join("paths.png"), 1, &[[255, 128, 0]]);
    let job = format!(
        "object = [{{ mesh = \"box.obj\" }}]\nprinter.pitch-mm = [0.2, 0.2, 0.2]\nmaterials.set = \"{set}\"\n[target]\n\
         {target}\n"
    );
    let job = Job::from_toml(&job, "job.toml", dir.path()).map_err(|error| error.to_string())?;
    targets(job, &Unwatched).map_err(|error| error.to_string())
}

/// Checks the spectra of one target against a model of each channel, to the codes that textures are kept in.
#[track_caller]
fn is(found: &JobTarget, set: &str, albedo: &[f64], path_mm: &[f64]) {
    let grid = MaterialSet::builtin(set).unwrap().grid;
    for ((spectrum, albedo), path) in found.target.channels.iter().zip(albedo).zip(path_mm) {
        let expected = NormalizedDiffusion::new(*albedo, *path).unwrap().spectrum(&grid);
        for (found, expected) in spectrum.iter().zip(expected) {
            assert!((found - expected).abs() < 1e-3, "{found} in place of {expected}");
        }
    }
    assert_eq!(found.target.channels.len(), albedo.len());
}

#[test]
fn a_preset_is_what_was_measured() {
    let marble = MeasuredMedium::named("marble").unwrap();
    let (albedo, path) = (marble.albedo(), marble.mean_free_path_mm());
    let found = asked("inks-rgb-7", "preset = \"marble\"");
    assert_eq!(found.len(), 1);
    is(&found[0], "inks-rgb-7", &albedo, &path);
    // In one channel it is luminance, its width that of the light that comes back.
    let weights = [0.2126, 0.7152, 0.0722];
    let luminance: f64 = weights.iter().zip(albedo).map(|(w, a)| w * a).sum();
    let width: f64 = weights.iter().zip(albedo).zip(path).map(|((w, a), l)| w * a * l).sum::<f64>() / luminance;
    is(&asked("synthetic", "preset = \"marble\"")[0], "synthetic", &[luminance], &[width]);
    // Its width alone, under a colour of one's own.
    let tinted = asked("inks-rgb-7", "preset = \"marble\"\nalbedo-colour = [0.5, 0.25, 0.125]");
    is(&tinted[0], "inks-rgb-7", &[0.5, 0.25, 0.125], &path);
    let error = try_asked("synthetic", "preset = \"wax\"").unwrap_err();
    assert!(error.starts_with("job.toml:5:10: target.preset: found the unknown measured material \"wax\""), "{error}");
}

#[test]
fn colours_and_widths_of_each_channel() {
    let colour = "kind = \"texture\"\nalbedo-colour = \"#c08040\"\nmean-free-path-mm = [1.0, 0.4, 0.2]";
    // 192, 128 and 64 of 255 by the sRGB curve.
    let linear = [0.527_115, 0.215_861, 0.051_269];
    is(&asked("inks-rgb-7", colour)[0], "inks-rgb-7", &linear, &[1.0, 0.4, 0.2]);
    let image = "kind = \"texture\"\nalbedo-value = 0.5\nmean-free-path = \"paths.png\"\nprojection = \"triplanar\"";
    // The image is linear: 255, 128 and 0 of 255.
    is(&asked("inks-rgb-7", image)[0], "inks-rgb-7", &[0.5; 3], &[1.0, 128.0 / 255.0, 0.0]);
}

/// s = 4.09712 + 4.20863 · 0.5 − √(9.59217 + 20.8404 + 4.42815) = 0.297138, so (1 − 0.4 s²)/(1 − 0.4) = 1.607806.
#[test]
fn subsurface_of_openpbr() {
    let target = "kind = \"texture\"\nsubsurface-colour = [0.5, 0.5, 0.5]\nsubsurface-radius-mm = 2\n\
        subsurface-scale = [1.0, 0.5, 0.25]\n";
    is(&asked("inks-rgb-7", target)[0], "inks-rgb-7", &[0.5; 3], &[2.0, 1.0, 0.5]);
    let forwards = format!("{target}subsurface-anisotropy = 0.4");
    let path = [2.0, 1.0, 0.5].map(|mm| mm * 1.607_806);
    is(&asked("inks-rgb-7", &forwards)[0], "inks-rgb-7", &[0.5; 3], &path);
    for (target, says) in [
        ("mean-free-path-mm = 1\nsubsurface-radius-mm = 1", "found together with `mean-free-path-mm`"),
        ("albedo-value = 1\nsubsurface-colour = \"#ffffff\"", "found together with `albedo-value`"),
        ("subsurface-scale = 2", "target.subsurface-scale: found a number that nothing uses"),
        ("albedo-colour = \"#12345\"", "expected a colour: \"#rrggbb\" in sRGB, or three linear numbers"),
        ("subsurface-radius-mm = 1000\nsubsurface-scale = 2", "found 2000 mm with its scale"),
        ("tile-mm = 3", "found a size that nothing uses, expected projection = \"triplanar\" beside it"),
        ("subsurface-radius-mm = 1\nsubsurface-anisotropy = 0.5", "without a colour of its own"),
    ] {
        let error = try_asked("synthetic", &format!("kind = \"texture\"\n{target}")).unwrap_err();
        assert!(error.contains(says), "{error}\nlacks: {says}");
    }
}

#[test]
fn images_are_projected_onto_what_has_no_coordinates() {
    let image = "kind = \"texture\"\nalbedo = \"halves.png\"\nmean-free-path-mm = 0.3";
    let error = try_asked("inks-rgb-7", image).unwrap_err();
    assert!(error.contains("without texture coordinates"), "{error}");
    // Two tiles across every side: each half covers half of it.
    let mut found = asked("inks-rgb-7", &format!("{image}\nprojection = \"triplanar\"\ntile-mm = 2"));
    found.sort_by(|a, b| a.target.channels[0][0].total_cmp(&b.target.channels[0][0]));
    assert_eq!(found.len(), 2);
    for (found, albedo) in found.iter().zip([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0]]) {
        assert!((found.share - 0.5).abs() < 0.1, "{}", found.share);
        is(found, "inks-rgb-7", &albedo, &[0.3; 3]);
    }
}
