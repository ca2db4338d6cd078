//! Every container gives back what was written, with its exposure time.

use std::fs;
use std::path::{Path, PathBuf};

use super::*;

const SIZE: (usize, usize) = (7, 5);

fn value(channel: usize, i: usize) -> u16 {
    (1000 * channel + 37 * i + 300) as u16
}

fn check(path: &Path, colour: bool) {
    let header = header(path).unwrap();
    assert_eq!((header.width, header.height, header.colour), (SIZE.0, SIZE.1, colour));
    for plane in [ColourPlane::Red, ColourPlane::Green, ColourPlane::Blue] {
        let read = planes(path, &[plane]).unwrap().remove(0);
        let channel = if colour { plane.index() } else { 0 };
        let exact: Vec<f32> = (0..SIZE.0 * SIZE.1).map(|i| f32::from(value(channel, i))).collect();
        assert_eq!(read.values, exact, "{} {plane:?}", path.display());
    }
}

fn file(name: &str) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    (folder, path)
}

fn interleaved(channels: usize) -> Vec<u16> {
    (0..SIZE.0 * SIZE.1).flat_map(|i| (0..channels).map(move |channel| value(channel, i))).collect()
}

#[test]
fn png_is_read_grey_and_in_colour() {
    for (colour, kind) in [(false, png::ColorType::Grayscale), (true, png::ColorType::Rgb)] {
        let (_folder, path) = file("a.png");
        let mut encoder = png::Encoder::new(fs::File::create(&path).unwrap(), SIZE.0 as u32, SIZE.1 as u32);
        encoder.set_color(kind);
        encoder.set_depth(png::BitDepth::Sixteen);
        let bytes: Vec<u8> = interleaved(kind.samples()).into_iter().flat_map(u16::to_be_bytes).collect();
        encoder.write_header().unwrap().write_image_data(&bytes).unwrap();
        check(&path, colour);
    }
}

#[test]
fn tiff_is_read_with_its_exposure_time() {
    use tiff::encoder::{Rational, TiffEncoder, colortype};
    use tiff::tags::Tag;
    let (_folder, path) = file("a.tif");
    let mut encoder = TiffEncoder::new(fs::File::create(&path).unwrap()).unwrap();
    let mut image = encoder.new_image::<colortype::RGB16>(SIZE.0 as u32, SIZE.1 as u32).unwrap();
    image.encoder().write_tag(Tag::Unknown(0x829a), Rational { n: 1, d: 15 }).unwrap();
    image.write_data(&interleaved(3)).unwrap();
    check(&path, true);
    assert_eq!(header(&path).unwrap().exposure_s, Some(1.0 / 15.0));
    let (_folder, path) = file("b.tif");
    let mut encoder = TiffEncoder::new(fs::File::create(&path).unwrap()).unwrap();
    let floats: Vec<f32> = interleaved(1).into_iter().map(f32::from).collect();
    encoder.write_image::<colortype::Gray32Float>(SIZE.0 as u32, SIZE.1 as u32, &floats).unwrap();
    check(&path, false);
}

#[test]
fn exr_is_read() {
    let (_folder, path) = file("a.exr");
    let pixel = |x: usize, y: usize| {
        let [r, g, b] = [0, 1, 2].map(|channel| f32::from(value(channel, y * SIZE.0 + x)));
        (r, g, b)
    };
    exr::prelude::write_rgb_file(&path, SIZE.0, SIZE.1, pixel).unwrap();
    check(&path, true);
}

#[test]
fn what_is_no_measurement_is_refused() {
    let refused = |name: &str, bytes: &[u8], words: &str| {
        let (_folder, path) = file(name);
        fs::write(&path, bytes).unwrap();
        let error = header(&path).unwrap_err().to_string();
        assert!(error.contains(words) && error.lines().count() == 1, "{error}");
    };
    refused("a.png", b"\xff\xd8\xff\xe0....", "a JPEG");
    refused("a.png", b"", "an empty file");
    refused("a.png", b"\x89PNG\r\n\x1a\n....", "a damaged PNG");
    refused("a.tif", b"II*\0\x08\0\0\0", "a damaged TIFF");
    refused("a.exr", b"\x76\x2f\x31\x01....", "an EXR that cannot be read");
    refused("a.txt", b"hello, world", "another kind");
    // Files that claim pixels which nobody took, and hold none.
    let mut vast = Vec::new();
    let mut encoder = png::Encoder::new(&mut vast, 100_000, 90_000);
    encoder.set_depth(png::BitDepth::Sixteen);
    encoder.write_header().unwrap().write_chunk(png::chunk::IDAT, b"none").unwrap();
    refused("a.png", &vast, "100000 × 90000 pixels, expected at most 268 million");
    let tags: [(u16, u32); 8] =
        [(256, 100_000), (257, 90_000), (258, 16), (259, 1), (262, 1), (273, 8), (277, 1), (279, 2)];
    let entry = |(tag, value): (u16, u32)| [&tag.to_le_bytes()[..], b"\x04\0\x01\0\0\0", &value.to_le_bytes()].concat();
    let tags = [tags.map(entry).concat(), vec![0; 4]].concat();
    let vast = [&b"II*\0\x08\0\0\0\x08\0"[..], &tags].concat();
    refused("a.tif", &vast, "100000 × 90000 pixels, expected at most 268 million");
    let mut eight = Vec::new();
    let encoder = png::Encoder::new(&mut eight, 1, 1);
    encoder.write_header().unwrap().write_image_data(&[0]).unwrap();
    refused("a.png", &eight, "8 bits per sample");
    let mut curved = Vec::new();
    let mut encoder = png::Encoder::new(&mut curved, 1, 1);
    encoder.set_depth(png::BitDepth::Sixteen);
    encoder.set_source_gamma(png::ScaledFloat::new(1.0 / 2.2));
    encoder.write_header().unwrap().write_image_data(&[0, 0]).unwrap();
    let (_folder, path) = file("a.png");
    fs::write(&path, curved).unwrap();
    assert!(header(&path).unwrap().curve.unwrap().contains("gamma"));
}
