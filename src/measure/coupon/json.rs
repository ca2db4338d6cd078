//! `coupon.json`: what a coupon is made of and where, for whoever reads its photographs.

use std::path::Path;

use serde::{Deserialize, Serialize};

use super::{Coupon, CouponResin, Field, layout::SPACING_MM};
use crate::measure::MeasureError;
use crate::optics::{Stack, VolumeCoefficients};
use crate::words::{dimensions, excerpt, one_line, short};

/// Program and version.
const GENERATOR: &str = concat!("lumislice ", env!("CARGO_PKG_VERSION"));
/// Version of its form.
const VERSION: u32 = 1;
/// Largest file that is read, bytes; fields, resins and spacings along a side that a coupon may have.
const MAX_BYTES: u64 = 4 << 20;
const MAX_FIELDS: usize = 1000;
const MAX_RESINS: usize = 64;
const MAX_SIDE: f64 = 200.0;

#[derive(Debug, Serialize, Deserialize)]
struct File {
    generator: String,
    version: u32,
    materials: String,
    printer: String,
    channels: Vec<String>,
    size_mm: [f64; 3],
    spacing_mm: f64,
    mark_mm: f64,
    /// x to the right and y up from the lower left corner, seen from above.
    marks_mm: [[f64; 2]; 5],
    rim: String,
    dark: String,
    resins: Vec<ResinRow>,
    fields: Vec<FieldRow>,
}

#[derive(Debug, Serialize, Deserialize)]
struct ResinRow {
    name: String,
    rgba: [u8; 4],
    density_g_per_cm3: f64,
    refractive_index: Vec<f64>,
    g: Vec<f64>,
    /// Where the fit starts.
    scattering_per_mm: Vec<f64>,
    absorption_per_mm: Vec<f64>,
}

#[derive(Debug, Serialize, Deserialize)]
struct FieldRow {
    middle_mm: [f64; 2],
    /// From the top down, as `--stack` has it.
    stack: String,
}

impl Coupon {
    /// Its file.
    pub fn json(&self) -> Vec<u8> {
        let row = |resin: &CouponResin| {
            let each = |value: fn(&VolumeCoefficients) -> f64| resin.believed.iter().map(value).collect();
            ResinRow {
                name: resin.name.clone(),
                rgba: resin.rgba,
                density_g_per_cm3: resin.density_g_per_cm3,
                refractive_index: each(|volume| volume.refractive_index),
                g: each(|volume| volume.g),
                scattering_per_mm: each(|volume| volume.sigma_s),
                absorption_per_mm: each(|volume| volume.sigma_a),
            }
        };
        let file = File {
            generator: GENERATOR.to_owned(),
            version: VERSION,
            materials: self.materials.clone(),
            printer: self.printer.clone(),
            channels: self.channels.clone(),
            size_mm: self.size_mm,
            spacing_mm: self.spacing_mm,
            mark_mm: self.mark_mm,
            marks_mm: self.marks,
            rim: self.resins[self.rim].name.clone(),
            dark: self.resins[self.dark].name.clone(),
            resins: self.resins.iter().map(row).collect(),
            fields: self
                .fields
                .iter()
                .map(|field| FieldRow { middle_mm: field.middle_mm, stack: self.named(field) })
                .collect(),
        };
        let mut text = serde_json::to_vec_pretty(&file).unwrap_or_default();
        text.push(b'\n');
        text
    }
}

pub(super) fn read(path: &Path) -> Result<Coupon, MeasureError> {
    let wrong = |found: String, expected: String| MeasureError::frame(path, found, expected);
    let read = |source| MeasureError::Read { file: path.to_path_buf(), source };
    let bytes = crate::regular_file::read(path, MAX_BYTES).map_err(read)?;
    let file: File = serde_json::from_slice(&bytes)
        .map_err(|error| wrong(one_line(error), "the coupon.json of `material coupon`".into()))?;
    if file.version != VERSION {
        return Err(wrong(format!("version {}", file.version), format!("version {VERSION}")));
    }
    let channels = file.channels.len();
    if file.resins.len() > MAX_RESINS || file.fields.is_empty() || file.fields.len() > MAX_FIELDS {
        let found = format!("{} resins in {} fields", file.resins.len(), file.fields.len());
        return Err(wrong(found, format!("at most {MAX_RESINS} in 1 to {MAX_FIELDS}")));
    }
    let names = || file.resins.iter().map(|row| &row.name);
    let is_name = |name: &String| !name.trim().is_empty() && !name.contains(|c: char| c.is_control());
    if let Some(odd) = names().chain(&file.channels).find(|name| !is_name(name)) {
        return Err(wrong(format!("the name {}", excerpt(odd)), "a name on one line".into()));
    }
    if let Some((_, twice)) = names().enumerate().find(|(n, name)| names().take(*n).any(|other| other == *name)) {
        return Err(wrong(format!("resin {} twice", excerpt(twice)), "each resin once".into()));
    }
    let mut resins = Vec::new();
    for row in &file.resins {
        let lists = [&row.refractive_index, &row.g, &row.scattering_per_mm, &row.absorption_per_mm];
        if channels == 0 || lists.iter().any(|list| list.len() != channels) {
            let expected = format!("{channels} values each, one a channel, and a channel at least");
            return Err(wrong(format!("resin {}: other numbers of values", excerpt(&row.name)), expected));
        }
        let of = |channel: usize| {
            let (sigma_s, sigma_a) = (row.scattering_per_mm[channel], row.absorption_per_mm[channel]);
            let volume = VolumeCoefficients {
                sigma_s,
                sigma_a,
                g: row.g[channel],
                refractive_index: row.refractive_index[channel],
            };
            volume.check().map(|()| volume)
        };
        resins.push(CouponResin {
            name: row.name.clone(),
            rgba: row.rgba,
            density_g_per_cm3: row.density_g_per_cm3,
            believed: (0..channels).map(of).collect::<Result<_, _>>()?,
        });
    }
    let place = |name: &String| {
        let found = resins.iter().position(|resin| resin.name == *name);
        found.ok_or_else(|| wrong(format!("resin {}", excerpt(name)), "one of its resins".into()))
    };
    let field = |row: &FieldRow| -> Result<Field, MeasureError> {
        let stack: Stack<String> = row.stack.parse().map_err(|error| wrong(one_line(error), "layers".into()))?;
        Ok(Field { middle_mm: row.middle_mm, stack: stack.try_map(place)? })
    };
    let lengths = file.size_mm.into_iter().chain([file.spacing_mm, file.mark_mm]);
    if !lengths.clone().all(|mm| mm.is_finite() && mm > 0.0) {
        let found = lengths.map(short).collect::<Vec<_>>().join(", ");
        return Err(wrong(format!("lengths {found}"), "millimetres above 0".into()));
    }
    let sides = file.size_mm[..2].iter().map(|mm| mm / file.spacing_mm);
    if !SPACING_MM.contains(&file.spacing_mm) || file.mark_mm >= file.spacing_mm || sides.clone().any(|n| n > MAX_SIDE)
    {
        let found = format!(
            "fields of {} mm and marks of {} mm on {} mm",
            short(file.spacing_mm),
            short(file.mark_mm),
            dimensions(file.size_mm)
        );
        let (from, to) = (SPACING_MM.start(), SPACING_MM.end());
        let expected = format!("fields of {from} to {to} mm, smaller marks, and at most {MAX_SIDE} fields a side");
        return Err(wrong(found, expected));
    }
    let places = file.marks_mm.iter().chain(file.fields.iter().map(|row| &row.middle_mm));
    let inside = |at: &[f64; 2]| (0..2).all(|axis| (0.0..=file.size_mm[axis]).contains(&at[axis]));
    if let Some(odd) = places.clone().find(|at| !inside(at)) {
        return Err(wrong(format!("a place at ({}) mm", odd.map(short).join(", ")), "places within the coupon".into()));
    }
    let coupon = Coupon {
        fields: file.fields.iter().map(field).collect::<Result<_, _>>()?,
        rim: place(&file.rim)?,
        dark: place(&file.dark)?,
        materials: file.materials,
        printer: file.printer,
        spacing_mm: file.spacing_mm,
        size_mm: file.size_mm,
        channels: file.channels,
        marks: file.marks_mm,
        mark_mm: file.mark_mm,
        resins,
    };
    coupon.refractive_index_or(|found, expected| wrong(format!("refractive indices {found}"), expected.into()))?;
    Ok(coupon)
}
