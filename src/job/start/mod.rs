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

mod looks;
mod resins;
mod size;

use std::{
    fmt::Write,
    path::{Path, PathBuf},
};

use crate::{
    colour::byte_to_linear,
    job::file::OutputFormat,
    mesh::{LoadOptions, MeshError, load},
    words::{escaped, toml_string},
};

use looks::{Looks, Source};
use resins::{Resins, beside};
use size::Sized;

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
    /// Its text, TOML with comments; paths are those of the folder it goes to, or absolute.
    pub toml: String,
    /// What was found and guessed, a sentence each.
    pub notes: Vec<String>,
}

/// The printer of a job that says nothing of it.
const PRINTER: &str = "j750-27um";
/// Height of what has no sensible size of its own, mm.
const HEIGHT_MM: f64 = 40.0;

/// Looks at a mesh and writes a job for it that goes to the file `job`.
///
/// # Errors
/// The mesh cannot be read.
pub fn start(mesh: &Path, job: &Path, options: &StartOptions) -> Result<Start, MeshError> {
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
    let stem = job.file_stem().map(|stem| stem.to_string_lossy().into_owned()).unwrap_or_default();
    let mut text = format!(
        "# {}\n#\n#   lumislice slice {stem}.toml --dry-run    size, voxels, grams of resin, what will not print\n\
         #   lumislice slice {stem}.toml --quick      how it will look, coarsely\n\
         #   lumislice slice {stem}.toml              printer files in {stem}-out/\n\
         #\n# docs/job.md lists every key; `lumislice schema` is what editors complete them by.\n\n",
        escaped(&name),
        stem = escaped(&stem),
    );
    line(&mut text, "[[object]]", "");
    line(&mut text, &format!("mesh = {}", toml_string(&beside(mesh, job))), "");
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
    materials(&mut text, &resins, job);
    line(&mut text, "\n[target]", "");
    looks.target(&mut text, options, &resins, job);
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
fn materials(text: &mut String, resins: &Resins, job: &Path) {
    match (&resins.set, &resins.file) {
        (Some(set), _) => {
            let about = format!("{}; or file = \"resins.toml\", your own measurements", resins.about);
            let about = if resins.about.is_empty() { "" } else { about.as_str() };
            line(text, &format!("set = {}", toml_string(set)), about);
        }
        (None, file) => {
            let named = file.as_deref().map(|file| beside(file, job)).unwrap_or_default();
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

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;
    use crate::{
        appearance::MeasuredMedium,
        job::{
            Job, Prepared,
            file::{AlbedoSource, TargetSpec},
        },
        optics::MaterialSet,
        voxel::Printer,
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
        let toml = start(mesh, &mesh.with_extension("toml"), options).unwrap().toml;
        (Job::from_toml(&toml, mesh.with_extension("toml"), mesh.parent().unwrap()).unwrap(), toml)
    }

    #[cfg(unix)]
    #[test]
    fn a_name_with_control_characters_makes_a_job_that_is_read() {
        let folder = tempfile::tempdir().unwrap();
        let mesh = folder.path().join("ev\u{1b}[31mil\u{7}.obj");
        fs::rename(a_box(folder.path(), 12.0), &mesh).unwrap();
        let (_, toml) = job(&mesh, &StartOptions::default());
        assert!(!toml.contains('\u{1b}'), "{toml}");
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
            let Start { toml, notes } = start(&mesh, &mesh.with_extension("toml"), &options).unwrap();
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
