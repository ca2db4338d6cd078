//! `kind = "texture"`: albedo and mean free path, everywhere or by texel, in the words of whoever knows them: linear
//! numbers, colours, materials that were measured, or the subsurface parameters of OpenPBR and MaterialX.

use super::paths::InputPath;
use super::ranges::{ALBEDO, ANISOTROPY, MAX_ALBEDO, MEAN_FREE_PATH, SUBSURFACE_SCALE, TILE};
use super::read::{Result, Table, Value};
use crate::appearance::{MeasuredMedium, isotropic_path_factor};
use crate::colour::srgb_to_linear_f64;
use crate::toml_reader::Range;
use crate::words::short;

/// A profile per texel, modelled from albedo and mean free path.
#[derive(Debug, Clone, PartialEq)]
pub struct TextureTarget {
    /// How much light comes back.
    pub albedo: AlbedoSource,
    /// Linear image that multiplies the mean free path, by its own channels; `None`: 1 everywhere.
    pub mean_free_path: Option<InputPath>,
    /// Mean free path of red, green and blue light where the image is 1, mm, 0.0001 to 1000 each; `None`: the mesh's
    /// own where its materials state one, else 1.
    pub mean_free_path_mm: Option<[f64; 3]>,
    /// The largest albedo after rescaling, 0.001 to 1; `None`: not rescaled.
    pub max_albedo: Option<f64>,
    /// How images come onto the surface.
    pub projection: Projection,
}

/// Where a texture target takes its albedo from.
#[derive(Debug, Clone, PartialEq)]
pub enum AlbedoSource {
    /// The mesh's own base colour (the default).
    MeshBaseColor,
    /// An sRGB image.
    Texture(InputPath),
    /// The same albedo everywhere and in every channel, linear, 0 to 1.
    Constant(f64),
    /// The same linear albedo of red, green and blue light everywhere, 0 to 1.
    Colour([f64; 3]),
}

/// How images come onto a surface.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub enum Projection {
    /// By the mesh's texture coordinates.
    #[default]
    Coordinates,
    /// Along x, y and z, blended by where the surface faces.
    Triplanar {
        /// Width of the object that an image covers before it begins anew, mm, 0.1 to 2000; `None`: the object's
        /// longest side.
        tile_mm: Option<f64>,
    },
}

pub(super) const KEYS: &[&str] = &[
    "preset",
    "albedo",
    "albedo-value",
    "albedo-colour",
    "mean-free-path",
    "mean-free-path-mm",
    "subsurface-colour",
    "subsurface-radius-mm",
    "subsurface-scale",
    "subsurface-anisotropy",
    "projection",
    "tile-mm",
    "max-albedo",
    "gamut-map",
];

/// Keys of which one at most says how much light comes back.
pub(super) const ALBEDOS: [&str; 4] = ["albedo", "albedo-value", "albedo-colour", "subsurface-colour"];

pub(super) fn read(table: &Table<'_>) -> Result<TextureTarget> {
    for (index, one) in ALBEDOS.iter().enumerate() {
        ALBEDOS[index + 1..].iter().try_for_each(|other| table.exclusive(one, other))?;
    }
    table.exclusive("mean-free-path-mm", "subsurface-radius-mm")?;
    let preset = table.get("preset").map(|value| read_preset(&value)).transpose()?;
    let colour = |key| table.get(key).map(|value| read_colour(&value)).transpose();
    let colours = [colour("albedo-colour")?, colour("subsurface-colour")?];
    let albedo = match (table.get("albedo"), table.get("albedo-value")) {
        (Some(path), _) => AlbedoSource::Texture(path.file("an albedo texture")?),
        (None, Some(value)) => AlbedoSource::Constant(value.number(ALBEDO)?),
        (None, None) => match (colours.into_iter().flatten().next(), preset) {
            (Some(colour), _) => AlbedoSource::Colour(colour),
            (None, Some(preset)) => AlbedoSource::Colour(preset.albedo()),
            (None, None) => AlbedoSource::MeshBaseColor,
        },
    };
    let given = table.get("mean-free-path-mm").map(|value| one_or_three(&value, MEAN_FREE_PATH)).transpose()?;
    let given = given.or(read_subsurface(table, &albedo)?);
    let default = match (preset, &albedo) {
        (Some(preset), _) => Some(preset.mean_free_path_mm()),
        (None, AlbedoSource::MeshBaseColor) => None,
        (None, _) => Some([1.0; 3]),
    };
    Ok(TextureTarget {
        albedo,
        mean_free_path: table.get("mean-free-path").map(|path| path.file("a mean-free-path texture")).transpose()?,
        mean_free_path_mm: given.or(default),
        max_albedo: table.get("max-albedo").map(|value| value.number(MAX_ALBEDO)).transpose()?,
        projection: read_projection(table)?,
    })
}

/// The mean free path that subsurface keys come to: the radius times its scale, for isotropic scattering.
fn read_subsurface(table: &Table<'_>, albedo: &AlbedoSource) -> Result<Option<[f64; 3]>> {
    let Some(value) = table.get("subsurface-radius-mm") else {
        for key in ["subsurface-scale", "subsurface-anisotropy"] {
            if let Some(value) = table.get(key) {
                return Err(value.refuse_as("a number that nothing uses", "subsurface-radius-mm beside it"));
            }
        }
        return Ok(None);
    };
    let radius = one_or_three(&value, MEAN_FREE_PATH)?;
    let scale = table.get("subsurface-scale").map(|value| one_or_three(&value, SUBSURFACE_SCALE)).transpose()?;
    let anisotropy = table.get("subsurface-anisotropy").map(|value| value.number(ANISOTROPY)).transpose()?;
    let shown = match (albedo, anisotropy) {
        (_, None) => [1.0; 3],
        (AlbedoSource::Colour(colour), _) => *colour,
        (AlbedoSource::Constant(value), _) => [*value; 3],
        (AlbedoSource::Texture(_) | AlbedoSource::MeshBaseColor, Some(_)) => {
            let expected = "a subsurface-colour beside it: what the angles of scattering come to depends on it";
            return Err(value.refuse_as("subsurface-anisotropy without a colour of its own", expected));
        }
    };
    let factor = |channel: usize| {
        let isotropic = anisotropy.map_or(1.0, |anisotropy| isotropic_path_factor(shown[channel], anisotropy));
        scale.map_or(1.0, |scale| scale[channel]) * isotropic
    };
    let path: [f64; 3] = std::array::from_fn(|channel| radius[channel] * factor(channel));
    match path.iter().find(|mm| !MEAN_FREE_PATH.contains(**mm)) {
        None => Ok(Some(path)),
        Some(mm) => Err(value.refuse_as(format!("{} mm with its scale", short(*mm)), MEAN_FREE_PATH.to_string())),
    }
}

fn read_preset(value: &Value<'_>) -> Result<&'static MeasuredMedium> {
    let name = value.name("a measured material")?;
    MeasuredMedium::named(&name).ok_or_else(|| {
        let hint = crate::words::hint(&name, MeasuredMedium::names());
        value.unknown("measured material", &name, hint)
    })
}

/// `"#c08040"`, encoded as sRGB, or `[r, g, b]`, linear.
fn read_colour(value: &Value<'_>) -> Result<[f64; 3]> {
    const EXPECTED: &str = "a colour: \"#rrggbb\" in sRGB, or three linear numbers [r, g, b] from 0 to 1";
    if value.is_list() {
        return value.triple(ALBEDO);
    }
    let digits = value.text(EXPECTED)?.trim().strip_prefix('#');
    let digits = digits.filter(|digits| digits.len() == 6 && digits.bytes().all(|byte| byte.is_ascii_hexdigit()));
    let code = digits.and_then(|digits| u32::from_str_radix(digits, 16).ok()).ok_or_else(|| value.refuse(EXPECTED))?;
    Ok([16, 8, 0].map(|shift| srgb_to_linear_f64(f64::from(code >> shift & 0xff) / 255.0)))
}

/// One number for all channels, or one each for red, green and blue light.
fn one_or_three(value: &Value<'_>, range: Range) -> Result<[f64; 3]> {
    if value.is_list() { value.triple(range) } else { Ok([value.number(range)?; 3]) }
}

fn read_projection(table: &Table<'_>) -> Result<Projection> {
    let triplanar = match table.get("projection") {
        None => false,
        Some(value) => value.choice(&[("uv", false), ("triplanar", true)])?,
    };
    match table.get("tile-mm") {
        Some(value) if !triplanar => {
            Err(value.refuse_as("a size that nothing uses", "projection = \"triplanar\" beside it"))
        }
        tile => {
            let tile_mm = tile.map(|value| value.number(TILE)).transpose()?;
            Ok(if triplanar { Projection::Triplanar { tile_mm } } else { Projection::Coordinates })
        }
    }
}
