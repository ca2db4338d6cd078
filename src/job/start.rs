//! A mesh and nothing else: the job that a stranger would write for it, with what was guessed said beside it.
//!
//! **In:** a mesh file and [`StartOptions`]. **Out:** a [`Start`]: the text of a job, to be kept beside the mesh.
//!
//! | guess | by |
//! | --- | --- |
//! | unit | the format where it says (glTF metres, 3MF as stated); else the first of mm, cm, m by which the longest side is 10 to 400 mm |
//! | what is up | the format where it says; else the flat area that it would stand on, +z or +y; else +y for OBJ, +z for STL and PLY |
//! | colour | materials, textures and vertex colours of the mesh; else an image beside it that is named after it |
//! | height | the file's, where it is 10 mm to what fits the tray; else 40 mm |

use std::{
    fmt::Write,
    fs,
    path::{Path, PathBuf},
};

use glam::DVec3;

use crate::{
    appearance::MeasuredMedium,
    job::file::OutputFormat,
    mesh::{LoadOptions, Loaded, MeshError, TriangleMesh, Unit, bounds, load},
    optics::MaterialSet,
    voxel::Printer,
    words::toml_string,
};

/// What is known already.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct StartOptions {
    /// The printer's preset; `None`: `j750-27um`.
    pub printer: Option<String>,
    /// Height of the print, mm, 0.01 to 2000; `None`: as the file has it, if that makes sense.
    pub height_mm: Option<f64>,
    /// A measured material that it should look like; `None`: the colours that it has.
    pub look: Option<String>,
    /// A built-in set of resins, or a material file; `None`: a set that does for its colours.
    pub materials: Option<PathBuf>,
    /// What to write, `preview` beside it always; none: `png`.
    pub formats: Vec<OutputFormat>,
}

/// A job to begin with.
#[derive(Debug, Clone, PartialEq)]
pub struct Start {
    /// Its text, TOML with comments; paths are relative to the mesh's folder.
    pub toml: String,
    /// What was found and guessed, a sentence each.
    pub notes: Vec<String>,
}

/// The printer of a job that says nothing of it.
const PRINTER: &str = "j750-27um";
/// Height of what has no sensible size of its own, mm.
const HEIGHT_MM: f64 = 40.0;
/// Longest sides that make sense, mm.
const SENSIBLE_MM: std::ops::RangeInclusive<f64> = 10.0..=400.0;
/// Linear channels further apart than this are a colour.
const COLOURFUL: f32 = 0.02;
/// The largest albedo that the set of greys, `synthetic`, does without becoming translucent.
const GREYS: f32 = 0.6;

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
    looks.materials(&mut text, options, mesh);
    line(&mut text, "\n[target]", "");
    looks.target(&mut text, options);
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

/// Column that comments begin in.
const COMMENTS: usize = 36;

fn line(text: &mut String, code: &str, comment: &str) {
    // Text in memory takes all that is written to it.
    let _ = match comment {
        "" => writeln!(text, "{code}"),
        comment => writeln!(text, "{code:COMMENTS$}# {comment}"),
    };
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
    Mesh { tells_path: bool },
    Image { name: String, has_uvs: bool },
    Nothing,
}

struct Looks {
    source: Source,
    is_colourful: bool,
    /// Albedos go beyond what [`GREYS`] can do.
    is_bright: bool,
}

impl Looks {
    fn of(loaded: &Loaded, path: &Path, options: &StartOptions, notes: &mut Vec<String>) -> Self {
        if let Some(look) = &options.look {
            // An unknown name is the job's to refuse.
            let albedo = MeasuredMedium::named(look).map_or([0.0; 3], MeasuredMedium::albedo);
            let is_colourful = is_colour(albedo.map(|channel| channel as f32));
            return Self { source: Source::Preset(look.clone()), is_colourful, is_bright: false };
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
            return Self { source: Source::Mesh { tells_path }, is_colourful, is_bright };
        }
        match image_beside(path) {
            Some(name) => {
                notes.push(format!("colour: {name}, which lies beside the mesh"));
                let source = Source::Image { name, has_uvs: !mesh.uvs.is_empty() };
                Self { source, is_colourful: true, is_bright: false }
            }
            None => {
                notes.push("colour: none was found; marble in its place".to_owned());
                Self { source: Source::Nothing, is_colourful: false, is_bright: false }
            }
        }
    }

    fn materials(&self, text: &mut String, options: &StartOptions, mesh: &Path) {
        match &options.materials {
            None if self.is_colourful => line(
                text,
                "set = \"inks-rgb-7\"",
                "published coefficients of five inks, an invented clear and support; or file = \"resins.toml\"",
            ),
            None => {
                line(text, "set = \"synthetic\"", "invented resins, none of them measured; or file = \"resins.toml\"");
            }
            Some(given) => {
                let name = given.to_string_lossy();
                if MaterialSet::builtin_names().any(|set| set == name) {
                    line(text, &format!("set = {}", toml_string(&name)), "");
                    return;
                }
                let beside = given.parent() == mesh.parent();
                let named = if beside { given.file_name().map(PathBuf::from) } else { std::path::absolute(given).ok() };
                let named = named.unwrap_or_else(|| given.clone());
                line(text, &format!("file = {}", toml_string(&named.to_string_lossy())), "");
            }
        }
    }

    fn target(&self, text: &mut String, options: &StartOptions) {
        match &self.source {
            Source::Preset(look) => line(text, &format!("preset = {}", toml_string(look)), "a measured material"),
            Source::Nothing => {
                line(text, "preset = \"marble\"", "the mesh has no colour of its own; or skin1, wholemilk, …");
            }
            Source::Mesh { tells_path } => {
                line(text, "kind = \"texture\"", "albedo: the mesh's own base colour");
                let code = "mean-free-path-mm = 0.5";
                match tells_path {
                    true => line(text, &format!("# {code}"), "how far light travels: as the file says, with its size"),
                    false => line(text, code, "how far light travels between two events"),
                }
            }
            Source::Image { name, has_uvs } => {
                line(text, "kind = \"texture\"", "");
                line(text, &format!("albedo = {}", toml_string(name)), "found beside the mesh");
                if !has_uvs {
                    line(text, "projection = \"triplanar\"", "the mesh has no texture coordinates");
                }
                line(text, "mean-free-path-mm = 0.5", "how far light travels between two events");
            }
        }
        // The built-in greys are the default's, named or not. Many albedos keep their ratios; one, or those that are
        // dark enough, stay as they are.
        let greys = match &options.materials {
            None => !self.is_colourful,
            Some(given) => given.as_os_str() == "synthetic",
        };
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
