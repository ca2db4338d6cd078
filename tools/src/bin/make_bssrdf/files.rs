//! A dataset's files, written row by row.

use std::{
    fs::File,
    io::{BufWriter, Write},
    path::PathBuf,
};

use half::f16;
use lumislice::appearance::bssrdf::write_npy;

use super::Request;

/// Response windows on their way to disk, in half precision.
pub struct Windows {
    path: PathBuf,
    file: BufWriter<File>,
}

impl Windows {
    pub fn create(request: &Request) -> Result<Self, String> {
        let path = request.folder.join("responses.npy");
        let fault = |error| format!("{}: {error}", path.display());
        let mut file = BufWriter::new(File::create(&path).map_err(fault)?);
        let [columns, rows] = request.texels;
        let shape = [rows, columns, request.window, request.window];
        // The header of a half-precision array is that of a float one but for the type.
        let header = String::from_utf8_lossy(&write_npy(&shape, &[])[10..]).replace("<f4", "<f2");
        file.write_all(&write_npy(&shape, &[])[..10]).map_err(fault)?;
        file.write_all(header.as_bytes()).map_err(fault)?;
        Ok(Self { path, file })
    }

    pub fn write(&mut self, values: &[f32]) -> Result<(), String> {
        let bytes: Vec<u8> = values.iter().flat_map(|value| f16::from_f32(*value).to_le_bytes()).collect();
        self.file.write_all(&bytes).map_err(|error| format!("{}: {error}", self.path.display()))
    }
}

/// Albedo and header; `more` are further lines.
pub fn finish(request: &Request, windows: Windows, albedo: &[f32], more: &str) -> Result<(), String> {
    let write = |name: &str, content: &[u8]| {
        let path = request.folder.join(name);
        std::fs::write(&path, content).map_err(|error| format!("{}: {error}", path.display()))
    };
    let Windows { path, mut file } = windows;
    file.flush().map_err(|error| format!("{}: {error}", path.display()))?;
    let [columns, rows] = request.texels;
    write("albedo.npy", &write_npy(&[rows, columns], albedo))?;
    let header = format!(
        "# {} by make_bssrdf, seed {}\nversion = 1\npitch-mm = {}\nresponses = \"responses.npy\"\nalbedo \
            = \"albedo.npy\"\n{more}",
        request.kind, request.seed, request.pitch_mm
    );
    write("dataset.toml", header.as_bytes())
}
