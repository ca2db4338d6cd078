//! `material measure`: what is refused, and how.

use std::fs;

use crate::support::Bench;

/// A capture of nothing yet: headers are read before anything slow.
const CAPTURE: &str = r#"
[resin]
name = "white"
rgba = [240, 240, 235]
density-g-per-cm3 = 1.18
thickness-mm = 3.0
date = "2010-05-01"
[camera]
mm-per-pixel = 0.044
black-level = 512
saturation-level = 16000
[reflection]
frames = ["r-*.png"]
exposures-s = ["1/15", 1.0]
[reflection.albedo]
picture = "card.png"
card = [4, 4, 10, 10]
sample = [20, 4, 10, 10]
card-albedo = 0.18
[transmission]
frames = ["t.png"]
exposures-s = [1.0]
[transmission.albedo]
value = 0.01
"#;

fn png(width: u32, height: u32, value: u16) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, width, height);
    encoder.set_color(png::ColorType::Grayscale);
    encoder.set_depth(png::BitDepth::Sixteen);
    let data: Vec<u8> = (0..width * height).flat_map(|_| value.to_be_bytes()).collect();
    encoder.write_header().unwrap().write_image_data(&data).unwrap();
    bytes
}

fn bench() -> Bench {
    let bench = Bench::new();
    for name in ["r-0.png", "r-1.png", "t.png", "card.png"] {
        fs::write(bench.path(name), png(64, 64, 600)).unwrap();
    }
    bench
}

/// Measures the capture with one text replaced by another.
#[track_caller]
fn refused(bench: &Bench, from: &str, to: &str, parts: &[&str]) {
    assert!(CAPTURE.contains(from), "{from}");
    fs::write(bench.path("capture.toml"), CAPTURE.replacen(from, to, 1)).unwrap();
    bench.run(["material", "measure", "capture.toml", "-o", "m.toml"]).refuses(2, parts);
    assert!(!bench.path("m.toml").exists());
}

#[test]
fn keys_and_values_are_checked() {
    let bench = bench();
    refused(&bench, "card-albedo", "card-albdeo", &["capture.toml:19", "did you mean `card-albedo`?"]);
    refused(&bench, "thickness-mm = 3.0", "thickness-mm = -3", &["capture.toml:6", "thickness-mm", "-3"]);
    refused(&bench, "date = \"2010-05-01\"\n", "", &["date", "found nothing"]);
    refused(&bench, "[\"1/15\", 1.0]", "[\"1/15\"]", &["exposures-s", "found 1 times, expected 2: one per picture"]);
    refused(&bench, "\"1/15\"", "\"1/0\"", &["exposures-s", "\"1/0\""]);
    refused(&bench, "exposures-s = [\"1/15\", 1.0]\n", "", &["r-0.png", "no exposure time", "EXIF"]);
    refused(&bench, "card = [4, 4, 10, 10]", "card = [60, 4, 10, 10]", &["card", "columns 60 to 70", "64 × 64"]);
    refused(&bench, "value = 0.01", "value = 1.5", &["value", "1.5"]);
    refused(
        &bench,
        "saturation-level = 16000",
        "saturation-level = 500",
        &["saturation-level", "more than the black level"],
    );
}

#[test]
fn pictures_are_checked() {
    let bench = bench();
    refused(&bench, "r-*.png", "x-*.png", &["capture.toml:13", "nothing that fits \"x-*.png\""]);
    fs::write(bench.path("r-1.png"), png(64, 32, 600)).unwrap();
    refused(&bench, "[resin]", "[resin]", &["r-1.png", "64 × 32", "64 × 64 as"]);
    fs::write(bench.path("r-1.png"), b"\xff\xd8\xff\xe0 jpeg").unwrap();
    refused(&bench, "[resin]", "[resin]", &["r-1.png", "a JPEG", "8 bits"]);
    fs::write(bench.path("r-1.png"), &png(64, 64, 600)[..60]).unwrap();
    refused(&bench, "[resin]", "[resin]", &["r-1.png", "a damaged PNG"]);
    fs::write(bench.path("r-1.png"), b"").unwrap();
    refused(&bench, "[resin]", "[resin]", &["r-1.png", "an empty file"]);
}

#[test]
fn pictures_without_a_measurement_are_refused() {
    let bench = bench();
    for name in ["r-0.png", "r-1.png"] {
        fs::write(bench.path(name), png(64, 64, 512)).unwrap();
    }
    refused(&bench, "[resin]", "[resin]", &["reflection: light", "none in any exposure"]);
    for name in ["r-0.png", "r-1.png"] {
        fs::write(bench.path(name), png(64, 64, 16_383)).unwrap();
    }
    refused(&bench, "[resin]", "[resin]", &["reflection: saturated", "4096 pixels", "a shorter exposure"]);
}

/// A grey EXR of one value.
fn exr(side: usize, value: f32) -> Vec<u8> {
    use exr::prelude::*;
    let channel = AnyChannel::new("Y", FlatSamples::F32(vec![value; side * side]));
    let channels = AnyChannels::sort(vec![channel].into());
    let layer = Layer::new((side, side), LayerAttributes::default(), Encoding::FAST_LOSSLESS, channels);
    let mut bytes = std::io::Cursor::new(Vec::new());
    Image::from_layer(layer).write().to_buffered(&mut bytes).unwrap();
    bytes.into_inner()
}

#[test]
fn damaged_and_empty_exr_files_are_refused() {
    let bench = bench();
    let whole = exr(64, 600.0);
    let lacking = exr(64, f32::NAN);
    let endless = exr(64, f32::INFINITY);
    for (bytes, words) in [
        (&whole[..0], "an empty file"),
        (&whole[..6], "an EXR that cannot be read"),
        (&whole[..whole.len() / 2], "an EXR that cannot be read"),
        (&whole[..whole.len() - 9], "an EXR that cannot be read"),
        (&lacking[..], "4096 of 4096 pixels that are infinite or not a number"),
        (&endless[..], "4096 of 4096 pixels that are infinite or not a number"),
    ] {
        fs::write(bench.path("r-1.png"), bytes).unwrap();
        refused(&bench, "[resin]", "[resin]", &["r-1.png", words]);
    }
}

/// A header is whole, what it promises is not there.
#[test]
fn truncated_pictures_are_refused() {
    let bench = bench();
    let noise: Vec<u16> = (0..64 * 64).map(|i: u32| (600 + i.wrapping_mul(2_654_435_761) % 5000) as u16).collect();
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, 64, 64);
    encoder.set_depth(png::BitDepth::Sixteen);
    let data: Vec<u8> = noise.iter().flat_map(|value| value.to_be_bytes()).collect();
    encoder.write_header().unwrap().write_image_data(&data).unwrap();
    fs::write(bench.path("r-1.png"), &bytes[..bytes.len() * 2 / 3]).unwrap();
    refused(&bench, "[resin]", "[resin]", &["r-1.png", "a damaged PNG"]);
    let mut bytes = std::io::Cursor::new(Vec::new());
    let mut encoder = tiff::encoder::TiffEncoder::new(&mut bytes).unwrap();
    encoder.write_image::<tiff::encoder::colortype::Gray16>(64, 64, &noise).unwrap();
    // The directory comes last, so that a cut file has none.
    let bytes = bytes.into_inner();
    fs::write(bench.path("r-1.png"), &bytes[..bytes.len() / 2]).unwrap();
    refused(&bench, "[resin]", "[resin]", &["r-1.png", "a damaged TIFF"]);
}

/// A material needs both profiles: what one of them leaves open no model can guess.
#[test]
fn one_profile_alone_is_no_material() {
    let bench = bench();
    let transmission = &CAPTURE[CAPTURE.find("[transmission]").unwrap()..];
    refused(&bench, transmission, "", &["transmission", "found nothing", "both profiles"]);
    let start = CAPTURE.find("[reflection]").unwrap();
    let reflection = &CAPTURE[start..CAPTURE.find("[transmission]").unwrap()];
    refused(&bench, reflection, "", &["reflection", "found nothing", "both profiles"]);
}

/// A measurement that fails leaves what an earlier one wrote as it was, `--overwrite` or not.
#[test]
fn a_failure_leaves_earlier_files_alone() {
    let bench = bench();
    fs::write(bench.path("capture.toml"), CAPTURE).unwrap();
    let names = ["m.toml", "m-reflection.csv", "m-transmission.csv", "m-report.html"];
    names.iter().for_each(|name| fs::write(bench.path(name), "mine").unwrap());
    let before = fs::read_dir(bench.path(".")).unwrap().count();
    for bytes in [b"\xff\xd8\xff\xe0 jpeg".to_vec(), exr(64, f32::NAN), png(64, 64, 16_383)] {
        fs::write(bench.path("r-0.png"), bytes).unwrap();
        bench.run(["material", "measure", "capture.toml", "-o", "m.toml", "--overwrite"]).refuses(2, &["r"]);
        names.iter().for_each(|name| assert_eq!(fs::read_to_string(bench.path(name)).unwrap(), "mine"));
        assert_eq!(fs::read_dir(bench.path(".")).unwrap().count(), before);
    }
}

/// A patch outside of its picture, or a picture that is not there.
#[test]
fn a_card_that_cannot_be_seen_is_refused() {
    let bench = bench();
    refused(&bench, "sample = [20, 4, 10, 10]", "sample = [20, 60, 10, 10]", &["sample", "rows 60 to 70", "64 × 64"]);
    refused(&bench, "\"card.png\"", "\"crad.png\"", &["crad.png"]);
}

#[test]
fn nothing_is_replaced_unasked() {
    let bench = bench();
    fs::write(bench.path("capture.toml"), CAPTURE).unwrap();
    fs::write(bench.path("m-reflection.csv"), "mine").unwrap();
    let ran = bench.run(["material", "measure", "capture.toml", "-o", "m.toml"]);
    ran.refuses(2, &["m-reflection.csv", "--overwrite"]);
    bench.run(["material", "measure", "capture.toml", "-o", "m.csv"]).refuses(2, &["m.csv", "without .toml"]);
}
