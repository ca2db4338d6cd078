//! Captures as laboratories have them: colours, exposure times in EXIF, a ruler, no dark series, raw files.

use std::ffi::OsString;
use std::fs::{self, File};
use std::io::BufReader;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use lumislice::measure::simulate::{Laboratory, Scene, write_capture};
use lumislice::measure::{Finding, Measurement, ResinFacts};

use super::{PINHOLE, Round, SQUARE, errors, hold, measured, show};

/// Small: 251 pixels a side.
const FARTHEST_MM: f64 = 5.5;

/// A 16-bit PNG: columns, values, samples a pixel.
fn read_png(path: &Path) -> (u32, Vec<u16>) {
    let mut reader = png::Decoder::new(BufReader::new(File::open(path).unwrap())).read_info().unwrap();
    let mut bytes = vec![0; reader.output_buffer_size().unwrap()];
    reader.next_frame(&mut bytes).unwrap();
    let values = bytes.chunks_exact(2).map(|pair| u16::from_be_bytes([pair[0], pair[1]])).collect();
    (reader.info().width, values)
}

fn png_writer(path: &Path, width: u32, height: u32, colour: png::ColorType) -> png::Writer<File> {
    let mut encoder = png::Encoder::new(File::create(path).unwrap(), width, height);
    encoder.set_color(colour);
    encoder.set_depth(png::BitDepth::Sixteen);
    encoder.set_compression(png::Compression::Fast);
    encoder.write_header().unwrap()
}

fn big_endian(values: &[u16]) -> Vec<u8> {
    values.iter().flat_map(|value| value.to_be_bytes()).collect()
}

/// Black, small, photographed into a folder: photographed once for all who ask.
fn black(folder: &Path) -> (Round, PathBuf) {
    static FILES: OnceLock<Vec<(OsString, Vec<u8>)>> = OnceLock::new();
    let round = Round::new("black", FARTHEST_MM);
    let files = FILES.get_or_init(|| {
        let folder = tempfile::tempdir().unwrap();
        round.write(&Laboratory::default(), folder.path());
        let entries = fs::read_dir(folder.path()).unwrap().map(Result::unwrap);
        entries.map(|entry| (entry.file_name(), fs::read(entry.path()).unwrap())).collect()
    });
    files.iter().for_each(|(name, content)| fs::write(folder.join(name), content).unwrap());
    (round, folder.join("capture.toml"))
}

fn edit(capture: &Path, change: impl Fn(&str) -> Option<String>) {
    let text = fs::read_to_string(capture).unwrap();
    let lines: Vec<String> = text.lines().filter_map(change).collect();
    fs::write(capture, lines.join("\n")).unwrap();
}

fn keep(line: &str) -> Option<String> {
    Some(line.to_owned())
}

fn check(name: &str, round: &Round, measurement: &Measurement) {
    let channel = &measurement.channels[0];
    for (series, truth) in [(&channel.reflection, &round.reflection), (&channel.transmission, &round.transmission)] {
        let errors = errors(series, truth);
        show(name, measurement, &errors);
        hold(name, &errors, 1.0);
    }
}

/// Rewrites every picture of the brackets with `write(old, values, columns, seconds, dark)`, which returns the new
/// extension; times go out of the capture file.
fn rewritten(folder: &Path, capture: &Path, write: impl Fn(&Path, &[u16], u32, f64, bool) -> &'static str) {
    let mut extension = "png";
    for series in ["reflection", "reflection_dark", "transmission", "transmission_dark"] {
        for (i, seconds) in Laboratory::default().exposures_s.into_iter().enumerate() {
            let path = folder.join(format!("{series}-{i:02}.png"));
            let (width, values) = read_png(&path);
            extension = write(&path, &values, width, seconds, series.ends_with("dark"));
        }
    }
    edit(capture, |line| match line {
        _ if line.contains("exposures-s") => None,
        _ if line.starts_with("frames") || line.starts_with("dark") => {
            Some(line.replace("-*.png", &format!("-*.{extension}")))
        }
        _ => keep(line),
    });
}

/// Microseconds over a million, as EXIF wants it.
fn rational(seconds: f64) -> [u32; 2] {
    [(seconds * 1e6).round() as u32, 1_000_000]
}

#[test]
fn exposure_times_are_read_from_tiff() {
    use tiff::encoder::{Rational, TiffEncoder, colortype};
    use tiff::tags::Tag;
    let folder = tempfile::tempdir().unwrap();
    let (round, capture) = black(folder.path());
    rewritten(folder.path(), &capture, |path, values, width, seconds, dark| {
        let mut encoder = TiffEncoder::new(File::create(path.with_extension("tif")).unwrap()).unwrap();
        let [n, d] = rational(seconds);
        let (exposure, time) = (Tag::Unknown(0x829a), Rational { n, d });
        let height = values.len() as u32 / width;
        // As cameras write it, in a directory of its own, or beside the picture, as TIFF/EP does.
        let exif = dark.then(|| {
            let mut directory = encoder.extra_directory().unwrap();
            directory.write_tag(exposure, Rational { n, d }).unwrap();
            directory.finish_with_offsets().unwrap()
        });
        let mut image = encoder.new_image::<colortype::Gray16>(width, height).unwrap();
        match exif {
            Some(exif) => image.encoder().write_tag(Tag::Unknown(0x8769), exif.offset).unwrap(),
            None => image.encoder().write_tag(exposure, time).unwrap(),
        }
        image.write_data(values).unwrap();
        "tif"
    });
    check("TIFF", &round, &measured(&capture));
}

/// An EXIF block that tells an exposure time.
fn exif_block(seconds: f64) -> Vec<u8> {
    let entry = |tag: u16, kind: u16, value: u32| {
        [&tag.to_le_bytes()[..], &kind.to_le_bytes(), &1_u32.to_le_bytes(), &value.to_le_bytes()].concat()
    };
    let directory = |entry: Vec<u8>| [&1_u16.to_le_bytes()[..], &entry, &0_u32.to_le_bytes()].concat();
    let [n, d] = rational(seconds);
    let header = [&b"II*\0"[..], &8_u32.to_le_bytes()].concat();
    // A directory takes 18 bytes.
    let rest = [directory(entry(0x8769, 4, 26)), directory(entry(0x829a, 5, 44))].concat();
    [header, rest, n.to_le_bytes().to_vec(), d.to_le_bytes().to_vec()].concat()
}

#[test]
fn exposure_times_are_read_from_png() {
    let folder = tempfile::tempdir().unwrap();
    let (round, capture) = black(folder.path());
    rewritten(folder.path(), &capture, |path, values, width, seconds, _| {
        let mut writer = png_writer(path, width, values.len() as u32 / width, png::ColorType::Grayscale);
        writer.write_chunk(png::chunk::ChunkType(*b"eXIf"), &exif_block(seconds)).unwrap();
        writer.write_image_data(&big_endian(values)).unwrap();
        "png"
    });
    check("PNG", &round, &measured(&capture));
}

/// Times are an attribute of an EXR, values floating-point numbers of any size.
#[test]
fn exr_brackets_are_measured() {
    use exr::prelude::*;
    let folder = tempfile::tempdir().unwrap();
    let (round, capture) = black(folder.path());
    let (black, scale) = (512.0_f32, 1.0 / 16_384.0_f32);
    rewritten(folder.path(), &capture, |path, values, width, seconds, _| {
        let size = Vec2(width as usize, values.len() / width as usize);
        let grey: Vec<f32> = values.iter().map(|value| (f32::from(*value) - black) * scale).collect();
        let channel = AnyChannel::new("Y", FlatSamples::F32(grey));
        let mut attributes = LayerAttributes::named("bracket");
        attributes.exposure = Some(seconds as f32);
        let layer = Layer::new(size, attributes, Encoding::FAST_LOSSLESS, AnyChannels::sort(vec![channel].into()));
        Image::from_layer(layer).write().to_file(path.with_extension("exr")).unwrap();
        "exr"
    });
    // Without the camera's levels, which were those of the PNGs, and with the albedos those pictures had shown.
    let known = ["black-level", "saturation-level", "gain-e-per-dn", "read-noise-e"];
    let text = fs::read_to_string(&capture).unwrap();
    let start = |name: &str| text.find(name).unwrap();
    let (r, t) = (round.reflection.1.integral(), round.transmission.1.integral());
    let reflection = &text[..start("[reflection.albedo]")];
    let transmission = &text[start("[transmission]")..start("[transmission.albedo]")];
    fs::write(
        &capture,
        format!("{reflection}[reflection.albedo]\nvalue = {r}\n{transmission}[transmission.albedo]\nvalue = {t}\n"),
    )
    .unwrap();
    edit(&capture, |line| if known.iter().any(|key| line.starts_with(key)) { None } else { keep(line) });
    check("EXR", &round, &measured(&capture));
}

#[test]
fn a_ruler_in_the_picture_tells_the_scale() {
    let folder = tempfile::tempdir().unwrap();
    let (round, capture) = black(folder.path());
    // 120 columns and 160 rows apart: 200 pixels.
    let ruler = "ruler-px = [10, 20, 130, 180]\nruler-mm = 8.8";
    edit(&capture, |line| if line.starts_with("mm-per-pixel") { keep(ruler) } else { keep(line) });
    let measurement = measured(&capture);
    assert!((measurement.capture.reflection.mm_per_pixel - 0.044).abs() < 1e-12);
    check("ruler", &round, &measurement);
}

#[test]
fn without_a_dark_series_the_level_is_told_from_the_outskirts() {
    let folder = tempfile::tempdir().unwrap();
    let (round, capture) = black(folder.path());
    edit(&capture, |line| if line.starts_with("dark") { None } else { keep(line) });
    let measurement = measured(&capture);
    for series in [&measurement.channels[0].reflection, &measurement.channels[0].transmission] {
        assert!(series.scan.findings.contains(&Finding::NoDarkSeries));
    }
    check("no dark series", &round, &measurement);
}

/// Cyan's three channels differ in albedo by a factor of a hundred, and each must come back as its own.
#[test]
fn colours_are_measured_channel_by_channel() {
    let folder = tempfile::tempdir().unwrap();
    let mut rounds: Vec<Round> = (0..3).map(|channel| Round::of("inks-rgb", "cyan", channel, 8.0)).collect();
    // One camera sees all channels: the widest one's field.
    let scenes =
        [Scene::around(&rounds[2].reflection.1, SQUARE, 8.0), Scene::around(&rounds[2].transmission.1, PINHOLE, 8.0)];
    for (channel, round) in rounds.iter_mut().enumerate() {
        (round.reflection.0, round.transmission.0) = (scenes[0].clone(), scenes[1].clone());
        let facts = ResinFacts {
            name: "cyan".into(),
            rgba: [0, 160, 220, 255],
            density_g_per_cm3: 1.18,
            print_as_background: false,
            thickness_mm: 1.0,
            refractive_index: 1.0,
            notes: String::new(),
        };
        let laboratory = Laboratory { seed: 1 + channel as u64, ..Laboratory::default() };
        let [r, t] = [&round.reflection, &round.transmission].map(|(scene, truth)| (scene, truth));
        write_capture(&laboratory, &facts, r, t, &folder.path().join(channel.to_string())).unwrap();
    }
    for entry in fs::read_dir(folder.path().join("0")).unwrap() {
        let name = entry.unwrap().file_name();
        if name.to_string_lossy().ends_with(".png") {
            let grey: Vec<_> =
                (0..3).map(|channel| read_png(&folder.path().join(channel.to_string()).join(&name))).collect();
            let (width, count) = (grey[0].0, grey[0].1.len());
            let woven: Vec<u16> = (0..count).flat_map(|i| grey.iter().map(move |plane| plane.1[i])).collect();
            let mut writer = png_writer(&folder.path().join(&name), width, count as u32 / width, png::ColorType::Rgb);
            writer.write_image_data(&big_endian(&woven)).unwrap();
        }
    }
    let text = fs::read_to_string(folder.path().join("0/capture.toml")).unwrap();
    let albedos: Vec<String> = rounds.iter().map(|round| round.transmission.1.integral().to_string()).collect();
    let end = text.find("[transmission.albedo]").unwrap();
    let text = format!("{}[transmission.albedo]\nvalue = [{}]\n", &text[..end], albedos.join(", "));
    let capture = folder.path().join("capture.toml");
    fs::write(&capture, text.replace("[camera]", "[camera]\nchannels = [\"R\", \"G\", \"B\"]")).unwrap();
    let measurement = measured(&capture);
    let names: Vec<&str> = measurement.channels.iter().map(|channel| channel.name.as_str()).collect();
    assert_eq!(names, ["R", "G", "B"]);
    for (channel, round) in measurement.channels.iter().zip(&rounds) {
        for (series, truth) in [(&channel.reflection, &round.reflection), (&channel.transmission, &round.transmission)]
        {
            let errors = errors(series, truth);
            println!("cyan, {}: {errors:.4?}", channel.name);
            hold(&channel.name, &errors, 1.0);
        }
    }
    // And the material file is one of three channels.
    for (name, text) in measurement.files("cyan") {
        fs::write(folder.path().join(name), text).unwrap();
    }
    let set = lumislice::optics::MaterialSet::load(&folder.path().join("cyan.toml")).unwrap();
    assert_eq!(set.channels, ["R", "G", "B"]);
    for (slab, round) in set.resins[0].channels.iter().map(|channel| &channel.slab).zip(&rounds) {
        let exact = round.reflection.1.integral();
        assert!((slab.reflection[0] / exact - 1.0).abs() < 0.005, "{} for {exact}", slab.reflection[0]);
    }
}

/// A DNG of 16-bit samples, a Bayer mosaic of which only greens are lit, by two sets of pixels with noise of their own.
#[cfg(feature = "raw")]
#[test]
fn a_dng_bracket_is_measured() {
    let folder = tempfile::tempdir().unwrap();
    let second = folder.path().join("second");
    let (round, capture) = black(folder.path());
    round.write(&Laboratory { seed: 2, ..Laboratory::default() }, &second);
    rewritten(folder.path(), &capture, |path, first, width, seconds, _| {
        let (_, other) = read_png(&second.join(path.file_name().unwrap()));
        let (columns, rows) = (2 * width as usize, 2 * first.len() / width as usize);
        let value = |x: usize, y: usize| match (x % 2, y % 2) {
            (1, 0) => first[y / 2 * width as usize + x / 2],
            (0, 1) => other[y / 2 * width as usize + x / 2],
            _ => 512,
        };
        let mosaic: Vec<u16> = (0..columns * rows).map(|i| value(i % columns, i / columns)).collect();
        fs::write(path.with_extension("dng"), dng(&mosaic, columns as u32, seconds)).unwrap();
        "dng"
    });
    // Levels are in the files; the mean of two greens has a gain of its own.
    let known = ["black-level", "saturation-level", "gain-e-per-dn", "read-noise-e"];
    edit(&capture, |line| if known.iter().any(|key| line.starts_with(key)) { None } else { keep(line) });
    let measurement = measured(&capture);
    let camera = &measurement.capture.camera;
    assert_eq!((camera.black_level, camera.saturation_level), (Some(512.0), Some(15_896.0)));
    check("DNG", &round, &measurement);
    // The mean of two greens has half the variance: 5.2 electrons per DN where a pixel has 2.6.
    let gain = measurement.channels[0].reflection.scan.gain_e_per_dn;
    assert!((gain / 5.2 - 1.0).abs() < 0.15, "gain {gain}");
    // What is cut off is refused, not half read.
    let cut = folder.path().join("reflection-03.dng");
    let bytes = fs::read(&cut).unwrap();
    for length in [12, 100, bytes.len() / 2] {
        fs::write(&cut, &bytes[..length]).unwrap();
        let capture = lumislice::measure::Capture::read(&capture);
        let error = capture.and_then(|capture| lumislice::measure::measure(capture, &lumislice::watch::Unwatched));
        let error = error.unwrap_err().to_string();
        assert!(error.contains("reflection-03.dng") && error.lines().count() == 1, "{length}: {error}");
    }
}

/// The least a DNG holds (Adobe's specification 1.4): one directory with the picture, one with EXIF, the samples.
#[cfg(feature = "raw")]
fn dng(mosaic: &[u16], width: u32, seconds: f64) -> Vec<u8> {
    const BYTE: u16 = 1;
    const ASCII: u16 = 2;
    const SHORT: u16 = 3;
    const LONG: u16 = 4;
    const RATIONAL: u16 = 5;
    let shorts = |values: &[u16]| values.iter().flat_map(|value| value.to_le_bytes()).collect::<Vec<u8>>();
    let long = |value: u32| value.to_le_bytes().to_vec();
    let name = b"Simulated\0".to_vec();
    let height = mosaic.len() as u32 / width;
    // Offsets come in the second pass, when the sizes are known.
    let build = |exif_at: u32, samples_at: u32| {
        let main: Vec<(u16, u16, u32, Vec<u8>)> = vec![
            (254, LONG, 1, long(0)),
            (256, LONG, 1, long(width)),
            (257, LONG, 1, long(height)),
            (258, SHORT, 1, shorts(&[16])),
            (259, SHORT, 1, shorts(&[1])),
            (262, SHORT, 1, shorts(&[32_803])),
            (271, ASCII, 10, name.clone()),
            (272, ASCII, 10, name.clone()),
            (273, LONG, 1, long(samples_at)),
            (274, SHORT, 1, shorts(&[1])),
            (277, SHORT, 1, shorts(&[1])),
            (278, LONG, 1, long(height)),
            (279, LONG, 1, long(2 * mosaic.len() as u32)),
            (33_421, SHORT, 2, shorts(&[2, 2])),
            (33_422, BYTE, 4, vec![0, 1, 1, 2]),
            (34_665, LONG, 1, long(exif_at)),
            (50_706, BYTE, 4, vec![1, 4, 0, 0]),
            (50_708, ASCII, 10, name.clone()),
            (50_714, SHORT, 1, shorts(&[512])),
            (50_717, LONG, 1, long(15_896)),
        ];
        let [n, d] = rational(seconds);
        let exif = vec![(33_434, RATIONAL, 1, [n.to_le_bytes(), d.to_le_bytes()].concat())];
        let mut bytes = [&b"II*\0"[..], &8_u32.to_le_bytes()].concat();
        let mut exif_start = 0;
        for (number, entries) in [main, exif].into_iter().enumerate() {
            if number == 1 {
                exif_start = bytes.len() as u32;
            }
            let mut data_at = bytes.len() + 2 + 12 * entries.len() + 4;
            let mut data = Vec::new();
            bytes.extend((entries.len() as u16).to_le_bytes());
            for (tag, kind, count, mut value) in entries {
                bytes.extend(tag.to_le_bytes());
                bytes.extend(kind.to_le_bytes());
                bytes.extend(count.to_le_bytes());
                if value.len() > 4 {
                    bytes.extend((data_at as u32).to_le_bytes());
                    value.resize(value.len().next_multiple_of(2), 0);
                    data_at += value.len();
                    data.extend(value);
                } else {
                    value.resize(4, 0);
                    bytes.extend(value);
                }
            }
            bytes.extend(0_u32.to_le_bytes());
            bytes.extend(data);
        }
        (exif_start, bytes)
    };
    let (exif_at, bytes) = build(0, 0);
    let (_, mut bytes) = build(exif_at, bytes.len() as u32);
    bytes.extend(shorts(mosaic));
    bytes
}
