//! What is refused, and what is not.

use std::io::Write;

use super::patch::{Folder, Patch};
use crate::appearance::bssrdf::{Channel, Dataset, FactorOptions, factor, write_npy};
use crate::watch::Unwatched;

const TINY: Patch = Patch { width: 3, height: 2, window: 3, ..Patch::SMALL };

fn tiny(more: &str) -> Folder {
    TINY.write(&TINY.responses(1), more)
}

#[track_caller]
fn refused(folder: &Folder, parts: &[&str]) {
    let complaint = folder.complaint("");
    assert!(!complaint.contains('\n'), "{complaint}");
    for part in parts {
        assert!(complaint.contains(part), "{complaint}\nlacks {part}");
    }
}

#[test]
fn headers_are_checked() {
    let good = "version = 1\npitch-mm = 0.06\nresponses = \"r.npy\"\n";
    let cases = [
        ("", "missing field"),
        ("version = 2\npitch-mm = 0.06\nresponses = \"r.npy\"", "version: found 2, expected 1"),
        ("version = 1\npitch-mm = 0\nresponses = \"r.npy\"", "pitch: found 0 mm"),
        ("version = 1\npitch-mm = nan\nresponses = \"r.npy\"", "pitch: found NaN mm"),
        ("version = 1\npitch-mm = 0.06\nresponse = \"r.npy\"", "line 3"),
        (&(good.to_owned() + "channels = [\"R\", \"G\"]"), "2 names for 1 channels"),
        (&(good.to_owned() + "noise-floor-per-mm2 = -1.0"), "noise: found floor -1"),
        (&(good.to_owned() + "albedo = \"none.npy\""), "none.npy"),
        (&(good.to_owned() + "mask = \"r.npy\""), "mask: found an array of shape [2, 3, 3, 3], expected [2, 3]"),
        (&good.replace("r.npy", "dataset.toml"), "no NumPy array"),
    ];
    for (text, part) in cases {
        let folder = tiny("");
        folder.write("dataset.toml", text.as_bytes());
        refused(&folder, &[part]);
    }
    let folder = tiny("");
    assert!(folder.complaint("nothing").contains("nothing"));
    folder.write("patch.mat", b"");
    assert!(folder.complaint("patch.mat").contains("expected a folder with dataset.toml"));
}

#[test]
fn arrays_are_checked() {
    let cases: [(&[usize], &str); 5] = [
        (&[54], "an array of shape [54]"),
        (&[2, 3, 9], "an array of shape [2, 3, 9]"),
        (&[2, 3, 1, 9, 1, 1], "shape"),
        (&[9, 3, 1, 2], "odd numbers"),
        (&[0, 3, 3, 3], "3 × 0 texels"),
    ];
    for (shape, part) in cases {
        let folder = tiny("");
        folder.write("r.npy", &write_npy(shape, &vec![1.0; shape.iter().product()]));
        refused(&folder, &["responses", part]);
    }
    let folder = tiny("");
    folder.write("r.npy", &write_npy(&[2, 3, 3, 3], &[1.0; 50]));
    refused(&folder, &["r.npy: values: found 328 bytes, expected 344: the file is cut short"]);
}

#[test]
fn albedo_and_mask_are_checked() {
    for (albedo, part) in [(1.5, "albedo, row 1, column 0: found 1.5"), (-0.1, "found -0.1")] {
        let folder = tiny("albedo = \"a.npy\"\n");
        folder.write("a.npy", &write_npy(&[2, 3], &[0.5, 0.5, f32::NAN, albedo, 0.5, 0.5]));
        refused(&folder, &["a.npy", part]);
    }
    let folder = tiny("mask = \"m.npy\"\n");
    folder.write("m.npy", &write_npy(&[2, 3], &[0.0; 6]));
    refused(&folder, &["mask: found 0 for all 6 texels"]);
    folder.write("m.npy", &write_npy(&[2, 3], &[0.0, 1.0, 1.0, 1.0, 1.0, 1.0]));
    assert_eq!(folder.open().present.map(|present| present[..2].to_vec()), Some(vec![false, true]));
}

/// Data that no surface gives are refused when they are read.
#[test]
fn data_that_are_no_bssrdf_are_refused() {
    let complaint = |value: f32| {
        let folder = TINY.write(&[value; 54], "");
        factor(&folder.open(), Channel::Stored(0), &FactorOptions::default(), &Unwatched).unwrap_err().to_string()
    };
    assert!(complaint(f32::NAN).contains("no value that is a number"));
    assert!(complaint(0.0).contains("no value above 0"));
    assert!(complaint(-1.0).contains("no value above 0"));
    assert!(complaint(1000.0).contains("times the light sent in"), "a pitch that is wrong, or values per pixel");
    let folder = TINY.write(&[1.0, -0.9].repeat(27), "");
    let error = factor(&folder.open(), Channel::Stored(0), &FactorOptions::default(), &Unwatched).unwrap_err();
    assert!(error.to_string().contains("negative values that take away 90% of the light"), "{error}");
}

fn read_all(dataset: &Dataset, channel: Channel) -> Vec<f32> {
    let (mut row, mut all) = (Vec::new(), Vec::new());
    let mut reader = dataset.responses.reader().unwrap();
    for y in 0..dataset.height {
        reader.read(y, channel, &mut row).unwrap();
        all.extend_from_slice(&row);
    }
    all
}

/// Pixels of all windows in the order a row reader gives them.
fn turned(patch: &Patch, values: &[f32]) -> Vec<f32> {
    let pixels = patch.window * patch.window;
    let at = |y: usize, x: usize, pixel: usize| values[(y * patch.width + x) * pixels + pixel];
    (0..patch.height)
        .flat_map(|y| (0..pixels).flat_map(move |pixel| (0..patch.width).map(move |x| (y, x, pixel))))
        .map(|(y, x, pixel)| at(y, x, pixel))
        .collect()
}

#[test]
fn an_archive_is_a_dataset_too() {
    let patch = Patch { width: 20, height: 3, window: 5, ..Patch::SMALL };
    let values = patch.responses(1);
    for method in [zip::CompressionMethod::Stored, zip::CompressionMethod::Deflated] {
        let folder = tiny("");
        let mut archive = zip::ZipWriter::new(std::fs::File::create(folder.path("p.npz")).unwrap());
        let options = zip::write::SimpleFileOptions::default().compression_method(method);
        for (name, bytes) in [
            ("responses.npy", write_npy(&patch.shape(), &values)),
            ("pitch_mm.npy", write_npy(&[], &[0.06])),
            ("albedo.npy", write_npy(&[3, 20], &[0.5; 60])),
        ] {
            archive.start_file(name, options).unwrap();
            archive.write_all(&bytes).unwrap();
        }
        archive.finish().unwrap();
        let dataset = Dataset::open(&folder.path("p.npz"), false).unwrap();
        assert_eq!((dataset.pitch_mm, dataset.width, dataset.height, dataset.window), (0.06, 20, 3, [5, 5]));
        assert!(dataset.responses.is_scratch() && dataset.albedo.as_ref().is_some_and(|albedo| albedo.len() == 60));
        assert_eq!(read_all(&dataset, Channel::Stored(0)), turned(&patch, &values));
    }
    let folder = tiny("");
    folder.write("p.npz", b"PK");
    assert!(folder.complaint("p.npz").contains("archive"));
}

#[test]
fn layers_of_an_exr_are_rows_of_texels() {
    use exr::prelude::*;
    let patch = Patch { width: 4, height: 3, window: 5, ..Patch::SMALL };
    let values = patch.responses(1);
    let folder = tiny("");
    let size = Vec2(4 * 5, 5);
    let row = |y: usize| {
        let value = |p: Vec2<usize>| values[((y * 4 + p.0 / 5) * 5 + p.1) * 5 + p.0 % 5];
        let plane = |factor: f32| -> Vec<f32> {
            (0..5).flat_map(|j| (0..20).map(move |i| Vec2(i, j))).map(|p| factor * value(p)).collect()
        };
        let channel = |name: &str, factor| AnyChannel::new(name, FlatSamples::F32(plane(factor)));
        let channels =
            AnyChannels::sort([channel("R", 1.0), channel("G", 2.0), channel("B", 4.0)].into_iter().collect());
        Layer::new(size, LayerAttributes::named(format!("row {y}").as_str()), Encoding::FAST_LOSSLESS, channels)
    };
    let attributes = ImageAttributes::new(IntegerBounds::from_dimensions(size));
    let image = Image::from_layers(attributes, (0..3).map(row).collect::<SmallVec<_>>());
    image.write().to_file(folder.path("r.exr")).unwrap();
    folder.write("dataset.toml", b"version = 1\npitch-mm = 0.06\nresponses = \"r.exr\"\n");
    let dataset = folder.open();
    assert_eq!((dataset.width, dataset.height, &dataset.channels[..]), (4, 3, &["R", "G", "B"].map(String::from)[..]));
    let truth = turned(&patch, &values);
    assert_eq!(read_all(&dataset, Channel::Stored(0)), truth);
    assert_eq!(read_all(&dataset, Channel::Stored(2)), truth.iter().map(|v| 4.0 * v).collect::<Vec<_>>());
    let luminance = read_all(&Dataset::open(&folder.path(""), true).unwrap(), Channel::Luminance);
    let factor = 0.2126 + 2.0 * 0.7152 + 4.0 * 0.0722;
    assert!(luminance.iter().zip(&truth).all(|(found, v)| (found / (factor * v) - 1.0).abs() < 1e-5));
    folder.write("dataset.toml", b"version = 1\npitch-mm = 0.06\nresponses = \"r.exr\"\nwindow = [7, 5]\n");
    refused(&folder, &["r.exr", "20 × 5 pixels for windows of 7 × 5"]);
    folder.write("r.exr", b"v/1\x01");
    refused(&folder, &["r.exr"]);
}

#[test]
fn a_folder_of_images_is_cut_into_windows() {
    let folder = tiny("");
    std::fs::create_dir(folder.path("lit")).unwrap();
    // The image of texel (x, y) has the value 1000·(1 + y·3 + x) + 10·row + column, of 65535.
    for (x, y) in [(0, 0), (1, 0), (2, 0), (0, 1), (1, 1)] {
        let pixel = |column: u32, row: u32| image::Luma([(1000 * (1 + y * 3 + x) + 10 * row + column) as u16]);
        image::ImageBuffer::from_fn(3, 2, pixel).save(folder.path("lit").join(format!("{x}_{y}.png"))).unwrap();
    }
    let header = "version = 1\npitch-mm = 0.06\nresponses = \"lit\"\nwindow = [3, 3]\n";
    folder.write("dataset.toml", (header.to_owned() + "full-scale-per-mm2 = 65535\n").as_bytes());
    let dataset = folder.open();
    assert_eq!((dataset.width, dataset.height, dataset.window), (3, 2, [3, 3]));
    let all = read_all(&dataset, Channel::Stored(0));
    // Row 0, middle pixel of each window; then the one to its right, beyond the image for the last texel.
    let close = |found: &[f32], truth: [f32; 3]| {
        found.iter().zip(truth).all(|(a, b)| (a - b).abs() < 0.01 || (a.is_nan() && b.is_nan()))
    };
    assert!(close(&all[4 * 3..5 * 3], [1000.0, 2001.0, 3002.0]));
    assert!(close(&all[5 * 3..6 * 3], [1001.0, 2002.0, f32::NAN]));
    assert!(close(&all[27 + 4 * 3..27 + 5 * 3], [4010.0, 5011.0, f32::NAN]), "2_1 has no image");
    folder.write("dataset.toml", header.as_bytes());
    refused(&folder, &["full-scale-per-mm2"]);
    folder.write("lit/lamp.png", b"");
    refused(&folder, &["images: found lamp.png, expected names X_Y.png"]);
}
