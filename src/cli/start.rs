//! From a mesh alone: `lumislice init`, and the job that `slice` makes up for a mesh.

use std::{
    fs::OpenOptions,
    io::Write,
    path::{Path, PathBuf},
};

use clap::Args;
use lumislice::{
    appearance::MeasuredMedium,
    job::{
        Job, Prepared, RunError,
        file::OutputFormat,
        start::{Albedo, MeanFreePath, Start, StartOptions, start},
    },
    mesh::extensions,
    optics::{MaterialFile, OpticsError},
    voxel::Printer,
    watch::Unwatched,
};

use serde_json::json;

use super::{
    Answer, Result, document,
    failure::{Failure, refuse},
    match_target::parse_srgb,
    note, print,
};

/// What is said of a mesh on the command line.
#[derive(Debug, Clone, Default, Args)]
pub struct MeshArgs {
    /// The printer's preset (`lumislice printers` lists them), for a mesh; default j750-27um.
    #[arg(long, value_name = "PRESET", value_parser = printer, help_heading = "Mesh")]
    pub printer: Option<String>,
    /// Height of the print in mm, for a mesh; default the file's, where it makes sense.
    #[arg(long, value_name = "MM", value_parser = height, help_heading = "Mesh")]
    pub height_mm: Option<f64>,
    /// A measured material that the mesh should look like, as marble or skin1 (another word lists them); default its
    /// own colours.
    #[arg(long, value_name = "NAME", value_parser = look, conflicts_with_all = ["colour", "albedo"])]
    #[arg(help_heading = "Mesh")]
    pub look: Option<String>,
    /// One colour that the mesh should have all over, sRGB; default its own colours.
    #[arg(long, value_name = "#RRGGBB", value_parser = parse_srgb, visible_alias = "color", alias = "srgb")]
    #[arg(conflicts_with = "albedo", help_heading = "Mesh")]
    pub colour: Option<[u8; 3]>,
    /// The same as an albedo, linear: one number, or one each for red, green and blue light, 0.6,0.5,0.4.
    #[arg(long, value_name = "A", value_delimiter = ',', value_parser = albedo, help_heading = "Mesh")]
    pub albedo: Vec<f64>,
    /// How far light travels between two events, mm, one number or R,G,B; default as a --look or the mesh has it, else
    /// 0.5.
    #[arg(long, value_name = "L", value_delimiter = ',', value_parser = path_mm, help_heading = "Mesh")]
    pub mean_free_path_mm: Vec<f64>,
    /// A built-in set of resins (`lumislice material list`) or a material file, for a mesh; default what its printer
    /// prints with, where there is a set of that.
    #[arg(long, value_name = "SET|FILE", value_parser = materials, help_heading = "Mesh")]
    pub materials: Option<PathBuf>,
    /// What to write for a mesh, as gcvf or png,stl; default png. Pictures with a report come with it.
    #[arg(long, value_name = "FORMATS", value_delimiter = ',', value_parser = format, help_heading = "Mesh")]
    pub formats: Vec<OutputFormat>,
}

fn format(text: &str) -> Result<OutputFormat, String> {
    let known = OutputFormat::ALL.iter().find(|(name, _)| *name == text.trim());
    let names = || OutputFormat::ALL.map(|(name, _)| name).join(", ");
    known.map(|(_, format)| *format).ok_or_else(|| format!("found `{text}`, expected one of {}", names()))
}

fn printer(text: &str) -> Result<String, String> {
    Printer::by_name(text).map(|printer| printer.name).map_err(|error| error.to_string())
}

fn height(text: &str) -> Result<f64, String> {
    let mm = text.trim().parse::<f64>().ok().filter(|mm| (0.01..=2000.0).contains(mm));
    mm.ok_or_else(|| format!("found `{text}`, expected a height in mm from 0.01 to 2000"))
}

fn albedo(text: &str) -> Result<f64, String> {
    let number = text.trim().parse().ok().filter(|albedo| (0.0..=0.999).contains(albedo));
    number.ok_or_else(|| format!("found `{text}`, expected a number from 0 to 0.999"))
}

fn path_mm(text: &str) -> Result<f64, String> {
    let mm = text.trim().parse().ok().filter(|mm| (1e-3..=100.0).contains(mm));
    mm.ok_or_else(|| format!("found `{text}`, expected a length in mm from 0.001 to 100"))
}

/// One number for all channels, or one each for red, green and blue light.
fn one_or_three(flag: &str, numbers: &[f64]) -> Result<Option<(f64, Option<[f64; 3]>)>> {
    match *numbers {
        [] => Ok(None),
        [one] => Ok(Some((one, None))),
        [r, g, b] => Ok(Some((r, Some([r, g, b])))),
        _ => refuse!("{flag}: found {} numbers, expected one, or three for red, green and blue light", numbers.len()),
    }
}

fn look(text: &str) -> Result<String, String> {
    let names = || MeasuredMedium::names().collect::<Vec<_>>().join(", ");
    match MeasuredMedium::named(text) {
        Some(_) => Ok(text.to_owned()),
        None => Err(format!("found `{text}`, expected a material that was measured: {}", names())),
    }
}

fn materials(text: &str) -> Result<PathBuf, String> {
    let path = PathBuf::from(text);
    match MaterialFile::named(&path) {
        Err(error @ OpticsError::UnknownSet { .. }) => Err(error.to_string()),
        // What is wrong with a file is told by the job that names it.
        _ => Ok(path),
    }
}

impl MeshArgs {
    fn options(&self) -> Result<StartOptions> {
        let Self { printer, height_mm, look, materials, formats, .. } = self.clone();
        let grey = one_or_three("--albedo", &self.albedo)?.map(|(one, all)| all.map_or(Albedo::Grey(one), Albedo::Rgb));
        let albedo = self.colour.map(Albedo::Srgb).or(grey);
        let path = one_or_three("--mean-free-path-mm", &self.mean_free_path_mm)?;
        let mean_free_path_mm = path.map(|(one, all)| all.map_or(MeanFreePath::Same(one), MeanFreePath::Rgb));
        Ok(StartOptions { printer, height_mm, look, albedo, mean_free_path_mm, materials, formats })
    }

    /// The first flag that is given.
    pub fn given(&self) -> Option<&'static str> {
        let flags = [
            ("--printer", self.printer.is_some()),
            ("--height-mm", self.height_mm.is_some()),
            ("--look", self.look.is_some()),
            ("--colour", self.colour.is_some()),
            ("--albedo", !self.albedo.is_empty()),
            ("--mean-free-path-mm", !self.mean_free_path_mm.is_empty()),
            ("--materials", self.materials.is_some()),
            ("--formats", !self.formats.is_empty()),
        ];
        flags.into_iter().find(|(_, given)| *given).map(|(flag, _)| flag)
    }
}

/// Where a job goes unless it is said.
pub fn default_folder(job: &Job) -> PathBuf {
    PathBuf::from(format!("{}-out", job.name))
}

/// Whether a file is a mesh by its name.
pub fn is_mesh(path: &Path) -> bool {
    let extension = path.extension().map(|extension| extension.to_string_lossy().to_ascii_lowercase());
    extension.is_some_and(|extension| extensions().any(|known| known == extension))
}

/// The job that a mesh gets where none is written, and its text; `path` is where it is, or would be.
pub fn job_for(mesh: &Path, path: &Path, args: &MeshArgs) -> Result<(Job, String)> {
    let Start { toml, notes } = start(mesh, path, &args.options()?).map_err(RunError::from)?;
    notes.iter().for_each(|text| note(text));
    let folder = path.parent().unwrap_or(Path::new(""));
    let job = Job::from_toml(&toml, path, folder).map_err(RunError::from)?;
    Ok((job, toml))
}

/// Write a commented job beside a mesh: unit, orientation, colour and size guessed, and said.
#[derive(Debug, Args)]
pub struct InitArgs {
    /// The mesh: GLB/glTF, OBJ, STL, PLY or 3MF.
    mesh: PathBuf,
    /// Where the job is written; default beside the mesh, by its name. A folder holds it by that name too.
    #[arg(short, long, value_name = "JOB.toml")]
    output: Option<PathBuf>,
    #[command(flatten)]
    start: MeshArgs,
}

/// Runs `init`.
pub fn init(args: &InitArgs) -> Result<Answer> {
    if !is_mesh(&args.mesh) {
        let extensions = extensions().collect::<Vec<_>>().join(", ");
        refuse!("{}: found a file of another kind, expected a mesh: {extensions}", args.mesh.display());
    }
    let own = args.mesh.with_extension("toml");
    let path = match &args.output {
        None => own,
        Some(folder) if folder.is_dir() => folder.join(own.file_name().unwrap_or_default()),
        Some(file) if file.extension().is_some_and(|extension| extension == "toml") => file.clone(),
        Some(file) => refuse!("--output: found {}, expected a name that ends in .toml, or a folder", file.display()),
    };
    if path.exists() {
        refuse!("{}: found a file, expected none: init never overwrites", path.display());
    }
    let (job, text) = job_for(&args.mesh, &path, &args.start)?;
    // A job that would be refused is no beginning.
    Prepared::check(&job, &Unwatched)?;
    let written = OpenOptions::new().write(true).create_new(true).open(&path);
    written
        .and_then(|mut file| file.write_all(text.as_bytes()))
        .map_err(|error| Failure::writing(path.display(), error))?;
    document(false, &json!({ "job": path.to_string_lossy() }))?;
    print(&format!("{}\n", path.display()))?;
    Ok(Answer::Yes)
}

/// Print the JSON schema of job files, for taplo and editors.
#[derive(Debug, Args)]
pub struct SchemaArgs {}

/// Runs `schema`.
pub fn schema(_: &SchemaArgs) -> Result<Answer> {
    super::print_json(&lumislice::job::file::schema())?;
    Ok(Answer::Yes)
}
