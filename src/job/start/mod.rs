//! A mesh and nothing else: the job that a stranger would write for it, with what was guessed said beside it.
//!
//! **In:** a mesh file and [`StartOptions`]. **Out:** a [`Start`]: the text of a job, to be kept beside the mesh.
//!
//! | guess | by |
//! | --- | --- |
//! | unit | the format where it says (glTF metres, 3MF as stated); else the first of mm, cm, m by which the longest side is 10 to 400 mm |
//! | what is up | the format where it says; else the flat area that it would stand on, +z or +y; else +y for OBJ, +z for STL and PLY |
//! | colour | materials, textures and vertex colours of the mesh; else an image beside it that is named after it |
//! | resins | the printer's own where a set has them; else greys or colours; of more than it takes, the likeliest |
//! | height | the file's, where it is 10 mm to what fits the tray; else 40 mm |

mod resins;

use std::{
    fmt::Write,
    fs,
    path::{Path, PathBuf},
};

use glam::DVec3;

use crate::{
    appearance::MeasuredMedium,
    colour::byte_to_linear,
    job::{file::OutputFormat, plan::read_picture},
    mesh::{LoadOptions, Loaded, MeshError, TriangleMesh, Unit, bounds, load},
    voxel::Printer,
    words::toml_string,
};

use resins::{Resins, any_colours, beside};

/// What is known already.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct StartOptions {
    /// The printer's preset; `None`: `j750-27um`.
    pub printer: Option<String>,
    /// Height of the print, mm, 0.01 to 2000; `None`: as the file has it, if that makes sense.
    pub height_mm: Option<f64>,
    /// A measured material that it should look like; `None`: the colours that it has.
    pub look: Option<String>,
    /// One albedo all over, linear, 0 to 1, in place of its colours or a measured material's.
    pub albedo: Option<Albedo>,
    /// How far light travels between two events, mm, for all channels or red, green and blue; `None`: as a measured
    /// material or the mesh has it, else 0.5.
    pub mean_free_path_mm: Option<MeanFreePath>,
    /// A built-in set of resins, or a material file; `None`: the printer's own, else a set that does for its colours.
    pub materials: Option<PathBuf>,
    /// What to write, `preview` beside it always; none: `png`.
    pub formats: Vec<OutputFormat>,
}

/// One albedo, as it is written.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Albedo {
    /// A colour, encoded as sRGB.
    Srgb([u8; 3]),
    /// A number for red, green and blue light.
    Rgb([f64; 3]),
    /// A grey.
    Grey(f64),
}

impl Albedo {
    fn linear(self) -> [f32; 3] {
        match self {
            Self::Srgb(bytes) => bytes.map(byte_to_linear),
            Self::Rgb(linear) => linear.map(|channel| channel as f32),
            Self::Grey(linear) => [linear as f32; 3],
        }
    }

    /// As a job has it.
    fn toml(self) -> String {
        match self {
            Self::Srgb([r, g, b]) => format!("albedo-colour = \"#{r:02x}{g:02x}{b:02x}\""),
            Self::Rgb([r, g, b]) => format!("albedo-colour = [{r:?}, {g:?}, {b:?}]"),
            Self::Grey(linear) => format!("albedo-value = {linear:?}"),
        }
    }
}

/// One number, or one each for red, green and blue light.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum MeanFreePath {
    /// Of all channels.
    Same(f64),
    /// Of each.
    Rgb([f64; 3]),
}

impl MeanFreePath {
    fn toml(self) -> String {
        match self {
            Self::Same(mm) => format!("mean-free-path-mm = {mm:?}"),
            Self::Rgb([r, g, b]) => format!("mean-free-path-mm = [{r:?}, {g:?}, {b:?}]"),
        }
    }
}

/// A job to begin with.
#[derive(Debug, Clone, PartialEq)]
pub struct Start {
    /// Its text, TOML with comments; paths are relative to the mesh's folder.
    pub toml: String,
    /// What was found and guessed, a sentence each.
    pub notes: Vec<String>,
}

/// The measured material that stands in for colours where there are none.
const NO_COLOUR: &str = "marble";
/// The printer of a job that says nothing of it.
const PRINTER: &str = "j750-27um";
/// Height of what has no sensible size of its own, mm.
const HEIGHT_MM: f64 = 40.0;
/// Longest sides that make sense, mm.
const SENSIBLE_MM: std::ops::RangeInclusive<f64> = 10.0..=400.0;
/// The mean free path of what does not say, mm.
const MEAN_FREE_PATH: MeanFreePath = MeanFreePath::Same(0.5);
/// Linear channels further apart than this are a colour.
const COLOURFUL: f32 = 0.02;
/// The largest albedo that the set of greys, `synthetic`, does without becoming translucent.
const GREYS: f32 = 0.6;
/// Colours that stand for all of a mesh.
const SAMPLES: usize = 48;

/// Looks at a mesh and writes a job for it.
///
/// # Errors
/// The mesh cannot be read.
pub fn start(mesh: &Path, options: &StartOptions) -> Result<Start, MeshError> {
    let loaded = load(mesh, &LoadOptions::default())?;
    let extension = mesh.extension().map(|e| e.to_string_lossy().to_ascii_lowercase()).unwrap_or_default();
    let mut notes = Vec::new();
    let size = Sized::guess(&loaded.mesh, &extension, options, &mut notes);
    let looks = Looks::of(&loaded, mesh, options, &mut notes);
    let resins = Resins::choose(options, looks.is_colourful, &looks.colours);
    notes.extend(resins.notes.iter().cloned());
    if let (Source::One(_) | Source::Image { .. } | Source::Mesh { tells_path: false }, None) =
        (&looks.source, options.mean_free_path_mm)
    {
        notes.push("glow: mean-free-path-mm = 0.5, a guess: how far light travels between two events".to_owned());
    }
    notes.extend(loaded.warnings.iter().cloned());
    let name = mesh.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
    let stem = mesh.file_stem().map(|stem| stem.to_string_lossy().into_owned()).unwrap_or_default();
    let mut text = format!(
        "# {}\n#\n#   lumislice slice {stem}.toml --dry-run    size, voxels, grams of resin, what will not print\n\
         #   lumislice slice {stem}.toml --quick      how it will look, coarsely\n\
         #   lumislice slice {stem}.toml              printer files in {stem}-out/\n\
         #\n# docs/job.md lists every key; `lumislice schema` is what editors complete them by.\n\n",
        crate::words::escaped(&name),
    );
    line(&mut text, "[[object]]", "");
    line(&mut text, &format!("mesh = {}", toml_string(&name)), "");
    if let Some(unit) = size.unit {
        line(&mut text, &format!("unit = \"{}\"", unit.name()), "guessed: the file does not say");
    }
    match size.height_mm {
        Some(height) => line(&mut text, &format!("height-mm = {height}"), &size.why),
        None => line(&mut text, "scale = 1.0", &format!("{}; or height-mm = {HEIGHT_MM} in its place", size.why)),
    }
    let turn = if size.y_up { "rotate-deg = [90, 0, 0]" } else { "rotate-deg = [0, 0, 0]" };
    line(&mut text, turn, &size.turned_by);
    line(&mut text, "\n[printer]", "");
    let printer = options.printer.as_deref().unwrap_or(PRINTER);
    line(&mut text, &format!("preset = \"{printer}\""), &size.fits(printer));
    line(&mut text, "\n[materials]", "");
    materials(&mut text, &resins, mesh);
    line(&mut text, "\n[target]", "");
    looks.target(&mut text, options, &resins);
    line(&mut text, "\n[output]", "");
    let asked = options.formats.iter().filter(|format| **format != OutputFormat::Preview);
    let mut names: Vec<_> = asked.map(|format| format.name()).collect();
    let why = match names.is_empty() {
        true => "slices for GrabCAD Voxel Print, and pictures with a report",
        false => "as asked for, and pictures with a report",
    };
    if names.is_empty() {
        names.push(OutputFormat::Png.name());
    }
    names.push(OutputFormat::Preview.name());
    line(&mut text, &format!("formats = [\"{}\"]", names.join("\", \"")), why);
    Ok(Start { toml: text, notes })
}

/// The thickest that stackings of a job are that says nothing of it, mm.
const DEEPEST_MM: f64 = 5.0;
/// Column that comments begin in.
const COMMENTS: usize = 36;

fn line(text: &mut String, code: &str, comment: &str) {
    // Text in memory takes all that is written to it.
    let _ = match comment {
        "" => writeln!(text, "{code}"),
        comment if code.chars().count() < COMMENTS => writeln!(text, "{code:COMMENTS$}# {comment}"),
        comment => writeln!(text, "{code} # {comment}"),
    };
}

/// The resins, what fills the inside, and a limit for each that is left out.
fn materials(text: &mut String, resins: &Resins, mesh: &Path) {
    match (&resins.set, &resins.file) {
        (Some(set), _) => {
            let about = format!("{}; or file = \"resins.toml\", your own measurements", resins.about);
            let about = if resins.about.is_empty() { "" } else { about.as_str() };
            line(text, &format!("set = {}", toml_string(set)), about);
        }
        (None, file) => {
            let named = file.as_deref().map(|file| beside(file, mesh)).unwrap_or_default();
            line(text, &format!("file = {}", toml_string(&named)), "");
        }
    }
    if let Some(core) = &resins.core {
        line(text, "\n[stacking]", "");
        line(text, &format!("core = {}", toml_string(core)), "what fills the inside below the stacking");
    }
    for (index, resin) in resins.left_out.iter().enumerate() {
        line(text, "\n[[stacking.limit]]", if index == 0 { &resins.why_left_out } else { "" });
        line(text, &format!("resin = {}", toml_string(resin)), "");
        line(text, &format!("min-depth-mm = {DEEPEST_MM:.1}"), "as thick as a stacking may be: there is none of it");
    }
}

/// How large an object will be, and how it stands.
struct Sized {
    unit: Option<Unit>,
    height_mm: Option<f64>,
    why: String,
    y_up: bool,
    turned_by: String,
    /// As printed, mm.
    printed: DVec3,
}

impl Sized {
    fn guess(mesh: &TriangleMesh, extension: &str, options: &StartOptions, notes: &mut Vec<String>) -> Self {
        let (low, high) = bounds(&mesh.positions);
        let found = high - low;
        let stated = matches!(extension, "glb" | "gltf" | "3mf");
        let (y_up, turned_by) = match stated {
            true => (false, "the file says what is up; z is up here".to_owned()),
            false => what_is_up(mesh, low, high, extension),
        };
        let turned = if y_up { DVec3::new(found.x, found.z, found.y) } else { found };
        let longest = found.max_element();
        let unit = [Unit::Mm, Unit::Cm, Unit::M].into_iter().find(|unit| SENSIBLE_MM.contains(&(longest * unit.mm())));
        let unit = unit.filter(|unit| !stated && *unit != Unit::Mm);
        let size = turned * unit.map_or(1.0, Unit::mm);
        let printer = options.printer.as_deref().unwrap_or(PRINTER);
        let tray = Printer::by_name(printer).ok().and_then(|printer| printer.tray_mm);
        let in_words = |size: DVec3| format!("{:.4} × {:.4} × {:.4} mm", size.x, size.y, size.z);
        let fits = tray.is_none_or(|tray| size.cmple(tray).all());
        let sensible = fits && size.max_element() >= *SENSIBLE_MM.start();
        let (height_mm, unit, why) = match options.height_mm {
            Some(height) => (Some(height), None, format!("as asked for; the file has {}", in_words(turned))),
            None if sensible => (None, unit, format!("{} as the file has it", in_words(size))),
            None => (Some(HEIGHT_MM), None, format!("the file has {}, which is no size to print", in_words(turned))),
        };
        let printed = height_mm.map_or(size, |height| turned * (height / turned.z.max(f64::MIN_POSITIVE)));
        if let Some(unit) = unit {
            notes.push(format!("unit: guessed {}, by which the object is {}", unit.name(), in_words(size)));
        }
        notes.push(format!("size: {}; {why}", in_words(printed)));
        notes.push(format!("orientation: {turned_by}"));
        Self { unit, height_mm, why, y_up, turned_by, printed }
    }

    /// Whether it fits, in words.
    fn fits(&self, printer: &str) -> String {
        let Some(tray) = Printer::by_name(printer).ok().and_then(|printer| printer.tray_mm) else {
            return "`lumislice printers` lists them".to_owned();
        };
        let fits = if self.printed.cmple(tray).all() { "fits" } else { "does not fit" };
        format!("tray {} × {} × {} mm: {fits}; `lumislice printers` lists others", tray.x, tray.y, tray.z)
    }
}

/// How near to the lowest point a foot is, as a share of the extent.
const FOOT: f64 = 0.01;
/// Cosine of what is flat.
const FLAT: f64 = 0.985;

/// Whether +y is up rather than +z, and why.
fn what_is_up(mesh: &TriangleMesh, low: DVec3, high: DVec3, extension: &str) -> (bool, String) {
    let foot = |axis: usize| -> f64 {
        let reach = low[axis] + FOOT * (high - low)[axis];
        let areas = mesh.triangles.iter().map(|triangle| {
            let [a, b, c] = triangle.map(|v| mesh.positions[v as usize]);
            let normal = (b - a).cross(c - a);
            let lies = [a, b, c].iter().all(|p| p[axis] <= reach);
            if lies && normal[axis].abs() >= FLAT * normal.length() { 0.5 * normal.length() } else { 0.0 }
        });
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        areas.sum::<f64>() / ((high - low)[u] * (high - low)[v]).max(f64::MIN_POSITIVE)
    };
    let (along_y, along_z) = (foot(1), foot(2));
    let words = |axis: &str, share: f64| {
        format!("guessed: it stands on a flat foot, {:.0}% of its outline, if {axis} is up", 100.0 * share)
    };
    if along_z > 0.02 && along_z > 2.0 * along_y {
        return (false, words("z", along_z));
    }
    if along_y > 0.02 && along_y > 2.0 * along_z {
        return (true, words("y", along_y));
    }
    match extension {
        "obj" => (true, "guessed: in most OBJ files y is up".to_owned()),
        _ => (false, "guessed: z is up".to_owned()),
    }
}

/// Where a look is to come from.
#[derive(Debug, PartialEq)]
enum Source {
    Preset(String),
    One(Albedo),
    Mesh { tells_path: bool },
    Image { name: String, has_uvs: bool },
    Nothing,
}

struct Looks {
    source: Source,
    is_colourful: bool,
    /// Albedos go beyond what [`GREYS`] can do.
    is_bright: bool,
    /// Albedos that stand for all it has, linear.
    colours: Vec<[f32; 3]>,
}

impl Looks {
    fn of(loaded: &Loaded, path: &Path, options: &StartOptions, notes: &mut Vec<String>) -> Self {
        let one = |source: Source, albedo: [f32; 3]| Self {
            source,
            is_colourful: is_colour(albedo),
            is_bright: false,
            colours: vec![albedo],
        };
        if let Some(albedo) = options.albedo {
            return one(Source::One(albedo), albedo.linear());
        }
        let of_preset = |name: &str| {
            // An unknown name is the job's to refuse.
            MeasuredMedium::named(name).map_or([0.0; 3], |medium| medium.albedo().map(|channel| channel as f32))
        };
        if let Some(look) = &options.look {
            return one(Source::Preset(look.clone()), of_preset(look));
        }
        let mesh = &loaded.mesh;
        let has_own = mesh
            .materials
            .iter()
            .any(|material| material.base_color_texture.is_some() || material.base_color[..3] != [1.0; 3]);
        if loaded.lost_color.is_none() && (has_own || !mesh.corner_colors.is_empty()) {
            let tells_path = mesh.materials.iter().any(|material| material.mean_free_path_mm.is_some());
            notes.push("colour: the mesh's own".to_owned());
            let (is_colourful, is_bright) =
                (colors(mesh).any(is_colour), colors(mesh).flatten().any(|albedo| albedo > GREYS));
            let all = colors(mesh).count();
            let colours = colors(mesh).step_by(all.div_ceil(SAMPLES).max(1)).collect();
            return Self { source: Source::Mesh { tells_path }, is_colourful, is_bright, colours };
        }
        match image_beside(path) {
            Some(name) => {
                notes.push(format!("colour: {name}, which lies beside the mesh"));
                let (is_colourful, colours) = image_colours(&path.with_file_name(&name));
                let is_bright = !is_colourful && colours.iter().flatten().any(|albedo| *albedo > GREYS);
                Self { source: Source::Image { name, has_uvs: !mesh.uvs.is_empty() }, is_colourful, is_bright, colours }
            }
            None => {
                notes.push("colour: none was found; marble in its place".to_owned());
                Self { is_colourful: false, ..one(Source::Nothing, of_preset(NO_COLOUR)) }
            }
        }
    }

    fn target(&self, text: &mut String, options: &StartOptions, resins: &Resins) {
        let path = options.mean_free_path_mm;
        let travels = || (path.unwrap_or(MEAN_FREE_PATH).toml(), "how far light travels between two events");
        let given = |text: &mut String| {
            if let Some(path) = path {
                line(text, &path.toml(), "in place of what was measured");
            }
        };
        match &self.source {
            Source::Preset(look) => {
                line(text, &format!("preset = {}", toml_string(look)), "a measured material");
                given(text);
            }
            Source::Nothing => {
                let code = format!("preset = \"{NO_COLOUR}\"");
                line(text, &code, "the mesh has no colour of its own; or skin1, wholemilk, …");
                given(text);
            }
            Source::One(albedo) => {
                line(text, "kind = \"texture\"", "");
                line(text, &albedo.toml(), "one albedo all over, as asked for");
                let (code, why) = travels();
                line(text, &code, why);
            }
            Source::Mesh { tells_path } => {
                line(text, "kind = \"texture\"", "albedo: the mesh's own base colour");
                let (code, why) = travels();
                match tells_path {
                    true if path.is_none() => {
                        line(text, &format!("# {code}"), "how far light travels: as the file says, with its size");
                    }
                    _ => line(text, &code, why),
                }
            }
            Source::Image { name, has_uvs } => {
                line(text, "kind = \"texture\"", "");
                line(text, &format!("albedo = {}", toml_string(name)), "found beside the mesh");
                if !has_uvs {
                    line(text, "projection = \"triplanar\"", "the mesh has no texture coordinates");
                }
                let (code, why) = travels();
                line(text, &code, why);
            }
        }
        // Of the built-in greys many albedos keep their ratios; one, or those that are dark enough, stay as they are.
        let greys = resins.are_greys();
        if greys && self.is_bright {
            line(text, &format!("max-albedo = {GREYS}"), "the brightest that 5 mm of white on black can do is 0.63");
        } else if !greys {
            line(text, "gamut-map = true", "what the resins cannot do is brought smoothly to what they can");
        }
    }
}

/// Every albedo of a mesh's surface, linear, 0 to 1: a corner's colour times its material's; of a textured one every
/// texel times the most that its corners have.
fn colors(mesh: &TriangleMesh) -> impl Iterator<Item = [f32; 3]> {
    let corners = |triangle: usize| mesh.corner_colors.get(triangle).copied().unwrap_or([[1.0; 3]; 3]);
    let material = |triangle: usize| mesh.material_of.get(triangle).map_or(0, |material| usize::from(*material));
    let mut most: Vec<Option<[f32; 3]>> = vec![None; mesh.materials.len()];
    for triangle in 0..mesh.triangles.len() {
        if let Some(most) = most.get_mut(material(triangle)) {
            let all = corners(triangle).into_iter().chain(*most);
            *most = all.reduce(|a, b| [0, 1, 2].map(|channel| a[channel].max(b[channel])));
        }
    }
    let times = |a: [f32; 3], b: [f32; 3]| [0, 1, 2].map(|channel| a[channel] * b[channel]);
    let textured = mesh.materials.iter().zip(most).flat_map(move |(material, most)| {
        let [r, g, b, _] = material.base_color;
        let tint = most.map(|most| times(most, [r, g, b]));
        let texels = material.base_color_texture.iter().flat_map(|texture| &texture.texels);
        let of = move |[r, g, b, _]: &[u8; 4]| Some(times(tint?, [*r, *g, *b].map(crate::colour::byte_to_linear)));
        texels.filter_map(of)
    });
    let plain = (0..mesh.triangles.len()).flat_map(move |triangle| {
        let material = mesh.materials.get(material(triangle));
        let base = match material {
            Some(material) if material.base_color_texture.is_some() => None,
            Some(material) => Some([material.base_color[0], material.base_color[1], material.base_color[2]]),
            None => Some([1.0; 3]),
        };
        base.into_iter().flat_map(move |base| corners(triangle).map(|corner| times(corner, base)))
    });
    plain.chain(textured)
}

/// Whether an image has colours rather than greys, and some of them, linear, spread over it; any colours where it
/// cannot be read, which the job tells.
fn image_colours(path: &Path) -> (bool, Vec<[f32; 3]>) {
    let Ok(picture) = read_picture(path) else { return (true, any_colours()) };
    let side = SAMPLES.isqrt();
    let at = |step: usize| (step as f32 + 0.5) / side as f32;
    let colours = (0..side * side).map(|sample| picture.light(at(sample % side), at(sample / side)));
    (!picture.is_grey(), colours.collect())
}

/// Whether it is a colour rather than a grey.
fn is_colour([r, g, b]: [f32; 3]) -> bool {
    r.max(g).max(b) - r.min(g).min(b) > COLOURFUL
}

/// An image in the mesh's folder that is named after it and is no map of something else.
fn image_beside(mesh: &Path) -> Option<String> {
    let stem = mesh.file_stem()?.to_string_lossy().to_lowercase();
    let folder = mesh.parent().filter(|folder| *folder != Path::new("")).unwrap_or(Path::new("."));
    let mut names: Vec<String> = fs::read_dir(folder)
        .ok()?
        .filter_map(|entry| entry.ok()?.file_name().into_string().ok())
        .filter(|name| {
            let lower = name.to_lowercase();
            let is_image = [".png", ".jpg", ".jpeg"].iter().any(|extension| lower.ends_with(extension));
            let others = ["normal", "rough", "metal", "bump", "height", "occlusion", "mfp", "label", "preview"];
            is_image && lower.starts_with(&stem) && !others.iter().any(|other| lower.contains(other))
        })
        .collect();
    let says_colour = |name: &String| {
        let lower = name.to_lowercase();
        !["albedo", "basecolor", "base_color", "diffuse", "color", "colour", "texture"]
            .iter()
            .any(|w| lower.contains(w))
    };
    names.sort_by_key(|name| (says_colour(name), name.clone()));
    names.into_iter().next()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        job::{
            Job, Prepared,
            file::{AlbedoSource, TargetSpec},
        },
        optics::MaterialSet,
        watch::Unwatched,
    };

    /// A box on the ground, mm, as an OBJ file.
    fn a_box(folder: &Path, edge: f64) -> PathBuf {
        let mut text = String::new();
        for corner in 0..8 {
            let at = |axis: usize| if corner >> axis & 1 == 1 { edge } else { 0.0 };
            let _ = writeln!(text, "v {} {} {}", at(0), at(1), at(2));
        }
        text += "f 1 3 4 2\nf 5 6 8 7\nf 1 2 6 5\nf 3 7 8 4\nf 1 5 7 3\nf 2 4 8 6\n";
        let path = folder.join("box.obj");
        fs::write(&path, text).unwrap();
        path
    }

    fn job(mesh: &Path, options: &StartOptions) -> (Job, String) {
        let toml = start(mesh, options).unwrap().toml;
        (Job::from_toml(&toml, mesh.with_extension("toml"), mesh.parent().unwrap()).unwrap(), toml)
    }

    #[test]
    fn no_printer_and_look_make_a_job_that_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let mesh = a_box(folder.path(), 12.0);
        for printer in Printer::preset_names() {
            let looks = MeasuredMedium::names()
                .map(|look| StartOptions { look: Some(look.to_owned()), ..StartOptions::default() });
            let colours = [[0xc0, 0x80, 0x40], [0x20, 0x40, 0xc0], [0x80; 3]]
                .map(|srgb| StartOptions { albedo: Some(Albedo::Srgb(srgb)), ..StartOptions::default() });
            let formats = [OutputFormat::Gcvf, OutputFormat::Bmp].map(|format| StartOptions {
                formats: vec![format],
                look: Some("skin".to_owned()),
                ..StartOptions::default()
            });
            let sets = MaterialSet::builtin_names().map(|set| StartOptions {
                materials: Some(set.into()),
                look: Some("marble".to_owned()),
                ..StartOptions::default()
            });
            for options in looks.chain(colours).chain(formats).chain(sets) {
                let options = StartOptions { printer: Some(printer.to_owned()), ..options };
                let (job, toml) = job(&mesh, &options);
                Prepared::check(&job, &Unwatched).unwrap_or_else(|error| panic!("{options:?}: {error}\n{toml}"));
            }
        }
    }

    #[test]
    fn a_colour_and_a_path_are_what_the_job_asks_for() {
        let folder = tempfile::tempdir().unwrap();
        let mesh = a_box(folder.path(), 12.0);
        let asked = |albedo, path| {
            let options = StartOptions { albedo: Some(albedo), mean_free_path_mm: path, ..StartOptions::default() };
            let (job, toml) = job(&mesh, &options);
            let TargetSpec::Texture(texture) = job.objects[0].target.clone() else { panic!("{toml}") };
            (texture.albedo, texture.mean_free_path_mm, toml)
        };
        let (albedo, path, toml) = asked(Albedo::Srgb([0xc0, 0x80, 0x40]), None);
        let AlbedoSource::Colour(colour) = albedo else { panic!("{toml}") };
        for (found, byte) in colour.into_iter().zip([0xc0, 0x80, 0x40]) {
            assert!((found - f64::from(byte_to_linear(byte))).abs() < 1e-6, "{colour:?}");
        }
        assert_eq!(path, Some([0.5; 3]));
        assert!(toml.contains("set = \"inks-rgb-7\""), "{toml}");
        let (albedo, path, _) = asked(Albedo::Rgb([0.5, 0.25, 0.125]), Some(MeanFreePath::Rgb([1.0, 0.5, 0.25])));
        assert_eq!((albedo, path), (AlbedoSource::Colour([0.5, 0.25, 0.125]), Some([1.0, 0.5, 0.25])));
        let (albedo, path, toml) = asked(Albedo::Grey(0.8), Some(MeanFreePath::Same(2.0)));
        assert_eq!((albedo, path), (AlbedoSource::Constant(0.8), Some([2.0; 3])));
        // What is asked for by number stays as it is.
        assert!(toml.contains("set = \"synthetic\"") && !toml.contains("max-albedo"), "{toml}");
    }

    #[test]
    fn what_a_printer_prints_with_is_taken_and_said() {
        let folder = tempfile::tempdir().unwrap();
        let mesh = a_box(folder.path(), 12.0);
        let found = |printer: &str, look: &str| {
            let options = StartOptions {
                printer: Some(printer.to_owned()),
                look: Some(look.to_owned()),
                ..StartOptions::default()
            };
            let Start { toml, notes } = start(&mesh, &options).unwrap();
            let said: Vec<_> = notes.into_iter().filter(|note| note.starts_with("resins: ")).collect();
            (toml, said)
        };
        let (toml, said) = found("j850-27um", "marble");
        assert!(toml.contains("set = \"vero-j850-provisional\"") && toml.contains("provisional;"), "{toml}");
        assert!(said.len() == 1 && said[0].contains("provisional") && said[0].contains("--materials"), "{said:?}");
        let (toml, said) = found("j750-27um", "marble");
        assert!(toml.contains("set = \"inks-rgb-7\""), "{toml}");
        assert!(said[0].contains("no set has what j750-27um prints with"), "{said:?}");
        // Three of six, and which.
        let (toml, said) = found("j850-hs-27um", "skin");
        assert_eq!(toml.matches("[[stacking.limit]]").count(), 3, "{toml}");
        assert!(said.len() == 2 && said[1].contains("j850-hs-27um takes 3"), "{said:?}");
    }
}
