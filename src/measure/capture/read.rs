//! Reading and checking a capture file. `docs/measure.md` lists every key.

use std::path::Path;

use super::albedo_table::ALBEDO_KEYS;
use super::files::matching;
use super::reader::{Headers, Reader, Result, bounds};
use super::{Aperture, Camera, Capture, Exposure, ResinFacts, Series};
use crate::measure::MeasureError;
use crate::measure::frame::{ColourPlane, Header};
use crate::optics::resin_table::{DENSITY, MAX_THICKNESS_MM, background, name, rgba};
use crate::optics::{MAX_REFRACTIVE_INDEX, OpticsError};
use crate::toml_reader::{At, Found, Source, Table};
use crate::words::excerpt;

const TOP_KEYS: [&str; 5] = ["resin", "camera", "profile", "reflection", "transmission"];
const RESIN_KEYS: [&str; 8] =
    ["name", "rgba", "density-g-per-cm3", "thickness-mm", "refractive-index", "print-as", "notes", "date"];
const CAMERA_KEYS: [&str; 9] = [
    "model",
    "channels",
    "black-level",
    "saturation-level",
    "gain-e-per-dn",
    "read-noise-e",
    "linear",
    "mm-per-pixel",
    "distance-mm",
];
const PROFILE_KEYS: [&str; 1] = ["bin-mm"];
const SERIES_KEYS: [&str; 12] = [
    "frames",
    "exposures-s",
    "dark",
    "dark-exposures-s",
    "flat",
    "aperture-mm",
    "aperture",
    "mm-per-pixel",
    "ruler-px",
    "ruler-mm",
    "distance-mm",
    "albedo",
];
/// Spacing of the profile in the paper, mm.
const DEFAULT_BIN_MM: f64 = 0.044;
/// Largest capture file accepted, bytes.
const MAX_BYTES: u64 = 1 << 20;

/// Reads a capture file and the headers of its pictures.
pub(super) fn capture(path: &Path) -> Result<Capture> {
    let disk = |source| OpticsError::File { file: path.to_path_buf(), source };
    let size = std::fs::metadata(path).map_err(disk)?.len();
    if size > MAX_BYTES {
        let expected = format!("a capture file of at most {MAX_BYTES}");
        return Err(MeasureError::frame(path, format!("{size} bytes"), expected));
    }
    let text = crate::regular_file::read_text(path).map_err(disk)?;
    let folder = path.parent().unwrap_or(Path::new(""));
    let source = Source::new(path, folder, &text, Found::ByType);
    let document = source.parse()?;
    let top = Reader { keys: Table::root(&source, &document), folder };
    top.keys.allow_only(&TOP_KEYS)?;

    let resin_table = top.require("resin", &RESIN_KEYS)?;
    let resin = resin_table.resin()?;
    let date = resin_table.keys.string("date")?.map(|date| date.value);
    let date = date.ok_or_else(|| resin_table.keys.missing("date", "when the pictures were taken"))?;
    let camera_table = top.require("camera", &CAMERA_KEYS)?;
    let mut camera = camera_table.camera()?;
    let planes = camera_table.planes()?;
    let bin_mm = match top.table("profile", &PROFILE_KEYS)? {
        Some(table) => table.number("bin-mm", bounds::BIN)?.unwrap_or(DEFAULT_BIN_MM),
        None => DEFAULT_BIN_MM,
    };
    let series = |name| {
        let expected = format!(
            "a table [{name}]: a material needs both profiles, of the light that comes back and of what comes through"
        );
        let table = top.table(name, &SERIES_KEYS)?.ok_or_else(|| top.keys.missing(name, &expected))?;
        table.series(&camera_table, &planes, name, &camera)
    };
    let ((reflection, header), (transmission, _)) = (series("reflection")?, series("transmission")?);
    // What the file knows of its sensor, the user need not say.
    camera.black_level = camera.black_level.or(header.black_level);
    camera.saturation_level = camera.saturation_level.or(header.saturation_level);
    Ok(Capture { path: path.to_path_buf(), resin, date, planes, camera, bin_mm, reflection, transmission })
}

impl Reader<'_> {
    fn resin(&self) -> Result<ResinFacts> {
        let keys = &self.keys;
        let name = name(keys)?.value;
        let print_as_background = background(keys)?.is_some();
        let thickness_mm = self.require_number("thickness-mm", 0.0..=MAX_THICKNESS_MM)?;
        if thickness_mm == 0.0 {
            return self.refuse("thickness-mm", "0", "the thickness of the sample in mm");
        }
        Ok(ResinFacts {
            name,
            rgba: rgba(keys)?.value,
            density_g_per_cm3: self.require_number("density-g-per-cm3", DENSITY)?,
            print_as_background,
            thickness_mm,
            refractive_index: self.number("refractive-index", 1.0..=MAX_REFRACTIVE_INDEX)?.unwrap_or(1.0),
            notes: keys.string("notes")?.map(|notes| notes.value).unwrap_or_default(),
        })
    }

    fn camera(&self) -> Result<Camera> {
        let linear = self.keys.get("linear").map_or(Ok(false), |value| value.truth())?;
        let camera = Camera {
            model: self.keys.string("model")?.map_or("not stated".into(), |model| model.value),
            black_level: self.number("black-level", bounds::LEVEL)?,
            saturation_level: self.number("saturation-level", bounds::LEVEL)?,
            gain_e_per_dn: self.number("gain-e-per-dn", bounds::GAIN)?,
            read_noise_e: self.number("read-noise-e", bounds::READ_NOISE)?,
            linear,
        };
        if let (Some(black), Some(full)) = (camera.black_level, camera.saturation_level)
            && full <= black
        {
            return self.refuse("saturation-level", full.to_string(), format!("more than the black level {black}"));
        }
        Ok(camera)
    }

    fn planes(&self) -> Result<Vec<ColourPlane>> {
        let Some(list) = self.keys.strings("channels")? else { return Ok(vec![ColourPlane::Green]) };
        let mut planes = Vec::new();
        for item in list.items {
            match ColourPlane::from_letter(&item.value) {
                Some(plane) if !planes.contains(&plane) => planes.push(plane),
                _ => return Err(self.keys.wrong("channels", &item, "\"R\", \"G\" or \"B\", each once")),
            }
        }
        if planes.is_empty() { self.refuse("channels", "none", "\"G\", or [\"R\", \"G\", \"B\"]") } else { Ok(planes) }
    }

    fn series(
        &self,
        camera_table: &Reader<'_>,
        planes: &[ColourPlane],
        name: &'static str,
        camera: &Camera,
    ) -> Result<(Series, Header)> {
        let mut all = Headers { first: None, planes, camera };
        let frames = self.exposures("frames", "exposures-s", &mut all)?;
        let Some((_, header)) = frames.first().cloned() else {
            return Err(self.keys.missing("frames", "the pictures of the bracket"));
        };
        let dark = self.exposures("dark", "dark-exposures-s", &mut all)?;
        let flat = match self.keys.string("flat")? {
            None => None,
            Some(name) => {
                let file = self.folder.join(name.value);
                all.check(&file)?;
                Some(Exposure { file, seconds: 1.0 })
            }
        };
        let shape = match self.keys.string("aperture")? {
            None => name == "transmission",
            Some(text) if text.value == "disc" => true,
            Some(text) if text.value == "square" => false,
            Some(text) => return Err(self.keys.wrong("aperture", &text, "\"square\" or \"disc\"")),
        };
        let aperture = self.number("aperture-mm", bounds::APERTURE)?.map(|size| match shape {
            true => Aperture::Disc { diameter_mm: size },
            false => Aperture::Square { side_mm: size },
        });
        let distance = match self.number("distance-mm", bounds::DISTANCE)? {
            Some(distance) => Some(distance),
            None => camera_table.number("distance-mm", bounds::DISTANCE)?,
        };
        let (frames, dark) = (frames.into_iter().map(|f| f.0).collect(), dark.into_iter().map(|f| f.0).collect());
        let series = Series {
            frames,
            dark,
            flat,
            aperture,
            mm_per_pixel: self.scale(camera_table)?,
            camera_distance_mm: distance,
            albedo: self.require("albedo", &ALBEDO_KEYS)?.albedo(name, &all)?,
        };
        Ok((series, header))
    }

    /// mm per pixel: said here, by a ruler in the picture, or for the whole camera.
    fn scale(&self, camera_table: &Reader<'_>) -> Result<f64> {
        let ruler = self.keys.numbers("ruler-px")?;
        let own = self.number("mm-per-pixel", bounds::MM_PER_PIXEL)?;
        if let (Some(_), Some(_)) = (&ruler, own) {
            return self.refuse("ruler-px", "together with `mm-per-pixel`", "only one of the two");
        }
        if let Some(ends) = ruler {
            let numbers: Vec<f64> = ends.value.iter().map(|end| end.value).collect();
            let [x0, y0, x1, y1] = numbers[..] else {
                return self.refuse("ruler-px", format!("{} numbers", numbers.len()), "[x, y, x, y] of its two ends");
            };
            if let Some(out) = ends.value.iter().find(|end| !bounds::PIXEL.contains(&end.value)) {
                return Err(self.keys.wrong("ruler-px", out, "a place in the picture, pixels"));
            }
            let scale = self.require_number("ruler-mm", bounds::RULER)? / libm::hypot(x1 - x0, y1 - y0);
            if !bounds::MM_PER_PIXEL.contains(&scale) {
                return self.refuse("ruler-px", format!("{scale} mm per pixel"), "0.0001 to 5 mm per pixel");
            }
            return Ok(scale);
        }
        match own {
            Some(scale) => Ok(scale),
            None => camera_table.require_number("mm-per-pixel", bounds::MM_PER_PIXEL),
        }
    }

    /// The pictures under `key`, with exposure times from `times_key` or the files themselves.
    fn exposures(&self, key: &str, times_key: &str, all: &mut Headers<'_>) -> Result<Vec<(Exposure, Header)>> {
        let Some(list) = self.keys.strings(key)? else { return Ok(Vec::new()) };
        let mut files = Vec::new();
        for At { value: pattern, at } in list.items {
            let found = matching(self.folder, &pattern)
                .map_err(|source| OpticsError::File { file: self.folder.join(&pattern), source })?;
            if found.is_empty() {
                let expected = "pictures of such names".to_owned();
                return Err(self.keys.error(at, key, format!("nothing that fits \"{pattern}\""), expected));
            }
            files.extend(found);
        }
        let times = self.seconds(times_key)?;
        if let Some(times) = &times
            && times.len() != files.len()
        {
            let expected = format!("{}: one per picture", files.len());
            return self.refuse(times_key, format!("{} times", times.len()), expected);
        }
        let mut exposures = Vec::new();
        for (i, file) in files.into_iter().enumerate() {
            let header = all.check(&file)?;
            let seconds = times.as_ref().map(|times| times[i]).or(header.exposure_s);
            let Some(seconds) = seconds else {
                let expected = format!("one in EXIF, or `{times_key}` in the capture file");
                return Err(MeasureError::frame(&file, "no exposure time", expected));
            };
            if exposures.iter().any(|(other, _): &(Exposure, Header)| other.file == file) {
                return self.refuse(key, format!("{} twice", file.display()), "each picture once");
            }
            exposures.push((Exposure { file, seconds }, header));
        }
        Ok(exposures)
    }

    /// Exposure times in s, as numbers or as photographers write them: `"1/15"`.
    fn seconds(&self, key: &str) -> Result<Option<Vec<f64>>> {
        let Some(value) = self.keys.get(key) else { return Ok(None) };
        let expected = "a time in s, 0.000001 to 100000, or a fraction such as \"1/15\"";
        let mut times = Vec::new();
        for item in value.list("an array of times in s")? {
            let time = match item.as_number() {
                Some(time) => Some(time),
                None => fraction(item.text(expected)?),
            };
            let time = time.filter(|time| bounds::SECONDS.contains(time));
            times.push(time.ok_or_else(|| item.refuse_as(excerpt(item.written()), expected))?);
        }
        Ok(Some(times))
    }
}

fn fraction(text: &str) -> Option<f64> {
    match text.split_once('/') {
        Some((above, below)) => Some(above.trim().parse::<f64>().ok()? / below.trim().parse::<f64>().ok()?),
        None => text.trim().parse().ok(),
    }
}
