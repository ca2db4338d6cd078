//! Slices as Objet and Connex printers take them: a bitmap of one bit per pixel for each material, and a text that
//! names them.
//!
//! The bitmap method as it is publicly described: bitmaps of one size, their width divisible by 32, that do not
//! overlap, for up to three materials, called `Mat1_0000.bmp` and so on, and a text file of three sections. Bitmaps
//! have their origin at the top left, so shown by any program they look like our PNG slices.

use std::io::{self, Write};

use super::{Content, ContentResin, Voxels};
use crate::voxel::Lattice;

/// Most materials.
pub const MAX_MATERIALS: usize = 3;
/// Widths are multiples of this; rows are then whole words, as the format wants them.
pub const WIDTH_STEP: u32 = 32;
/// Bytes before the pixels: file header, image header, two colours.
pub const HEADER: usize = 14 + 40 + 8;

/// The folder of bitmaps.
pub const FOLDER: &str = "bmp";

/// Path of the bitmap of slice `k` for the material `number`, from 1, of a job of so many `slices`.
pub fn bitmap_path(number: usize, k: u32, slices: u32) -> String {
    format!("{FOLDER}/Mat{number}_{k:0digits$}.bmp", digits = digits(slices))
}

/// Path of the text that names the bitmaps.
pub fn text_path(job: &str) -> String {
    format!("{FOLDER}/{job}.txt")
}

/// Digits of slice numbers: four, as in all descriptions of the format, or as many as it takes.
fn digits(slices: u32) -> usize {
    slices.saturating_sub(1).to_string().len().max(4)
}

/// Width of bitmaps of a lattice.
pub fn padded_width(lattice: &Lattice) -> u32 {
    lattice.dims[0].next_multiple_of(WIDTH_STEP)
}

/// The header of every bitmap of a lattice.
pub fn header(lattice: &Lattice) -> [u8; HEADER] {
    let (width, height) = (padded_width(lattice), lattice.dims[1]);
    let pixels = u64::from(width / 8) * u64::from(height);
    let whole = |bytes: u64| u32::try_from(bytes).unwrap_or(0);
    let per_metre = |pitch_mm: f64| (1000.0 / pitch_mm).round() as u32;
    let mut header = [0; HEADER];
    let mut at = 0;
    let mut put = |bytes: &[u8]| {
        header[at..at + bytes.len()].copy_from_slice(bytes);
        at += bytes.len();
    };
    put(b"BM");
    put(&whole(pixels + HEADER as u64).to_le_bytes());
    put(&[0; 4]);
    put(&(HEADER as u32).to_le_bytes());
    put(&40_u32.to_le_bytes());
    put(&width.to_le_bytes());
    put(&height.to_le_bytes());
    put(&1_u16.to_le_bytes()); // planes
    put(&1_u16.to_le_bytes()); // bits a pixel
    put(&0_u32.to_le_bytes()); // not compressed
    put(&whole(pixels).to_le_bytes());
    put(&per_metre(lattice.pitch.x).to_le_bytes());
    put(&per_metre(lattice.pitch.y).to_le_bytes());
    put(&2_u32.to_le_bytes()); // colours: black where the material is not, white where it is
    put(&2_u32.to_le_bytes());
    put(&[0, 0, 0, 0]);
    put(&[255, 255, 255, 0]);
    header
}

/// Encodes the voxels of slice `k` that are of material `id`.
///
/// # Errors
/// Those of `out`.
pub fn encode_bmp(voxels: &dyn Voxels, k: u32, id: u8, mut out: impl Write) -> io::Result<()> {
    let lattice = voxels.lattice();
    out.write_all(&header(lattice))?;
    let mut ids = vec![0; lattice.dims[0] as usize];
    let mut bits = vec![0_u8; padded_width(lattice) as usize / 8];
    // The last row comes first in a bitmap, and it is that of j = 0.
    for j in 0..lattice.dims[1] {
        voxels.read_row(j, k, &mut ids);
        for (byte, eight) in bits.iter_mut().zip(ids.chunks(8)) {
            let set = eight.iter().enumerate().map(|(bit, &voxel)| u8::from(voxel == id) << (7 - bit));
            *byte = set.fold(0, |byte, bit| byte | bit);
        }
        out.write_all(&bits)?;
    }
    Ok(())
}

/// The text that names bitmaps and resins: `materials` in the order of their numbers.
pub fn text(content: &Content, materials: &[&ContentResin]) -> String {
    let slices = content.lattice.dims[2];
    let mut text = format!(
        "[Build]\r\nFormat version = 1;\r\nLayer thickness = {};\r\nNumber of slices = {slices};\r\n\r\n\
         [Resin Type]\r\n",
        content.lattice.pitch.z
    );
    if let Some(support) = content.resins.iter().find(|resin| resin.rgba[3] == 0) {
        text += &format!("Support = {};\r\n", support.name);
    }
    for (number, resin) in (1..).zip(materials) {
        let key = if number == 1 { "Color".to_owned() } else { format!("Resin{number}") };
        text += &format!("{key} = {};\r\n", resin.name);
    }
    text += "\r\n[Materials]\r\n";
    for number in 1..=materials.len() {
        text += &format!("Material{number} = Mat{number}_{};\r\n", "x".repeat(digits(slices)) + ".bmp");
    }
    text
}
