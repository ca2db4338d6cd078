//! `lumislice convert`: a finished job in other formats.

use std::path::{Path, PathBuf};

use clap::{
    Args,
    builder::{PossibleValue, PossibleValuesParser},
};
use lumislice::job::{convert, file::OutputFormat};

use serde_json::json;

use super::{
    Answer, Result, document,
    failure::{refusal, refuse},
    print,
    progress::Bars,
    warn_of,
};

/// Write a finished job in other formats too, from its slices.
///
/// The new files lie beside the others in OUT and in its manifest; those of an earlier conversion are replaced. Slices
/// hold printed voxels: volumes of fractions, and meshes, are made by slicing the job again.
#[derive(Debug, Args)]
pub struct ConvertArgs {
    /// Folder of a finished job, with its slices.
    #[arg(value_name = "OUT")]
    folder: PathBuf,
    /// The format, or several with commas between: gcvf for GrabCAD Print, bmp for Objet printers, vti for ParaView,
    /// nrrd for napari and 3D Slicer, vdb for Blender and Houdini.
    #[arg(
        long, value_name = "FORMAT", required = true, value_delimiter = ',',
        value_parser = PossibleValuesParser::new(values())
    )]
    to: Vec<String>,
}

/// Names of all formats, but shown only those that slices become: the others are answered with what makes them.
fn values() -> Vec<PossibleValue> {
    let value =
        |(name, format): &(&'static str, OutputFormat)| PossibleValue::new(*name).hide(!format.holds_whole_jobs());
    OutputFormat::ALL.iter().map(value).collect()
}

fn names() -> Vec<&'static str> {
    OutputFormat::ALL.iter().filter(|(_, format)| format.holds_whole_jobs()).map(|(name, _)| *name).collect()
}

/// Why a format is none that slices become, and what makes it.
fn elsewhere(format: OutputFormat, folder: &Path) -> String {
    let (name, folder) = (format.name(), folder.display());
    let (why, cure) = match format {
        OutputFormat::Png => ("which OUT is read from", format!("one that it becomes: {}", names().join(", "))),
        OutputFormat::Preview => ("pictures and a page", format!("lumislice preview {folder}")),
        OutputFormat::Stl | OutputFormat::ThreeMf | OutputFormat::Heights | OutputFormat::Masks => {
            let why = if format == OutputFormat::Masks {
                "images that are written slice by slice"
            } else {
                "which is made from the layers below the mesh, and slices no longer have them"
            };
            let cure = format!(
                "the job sliced into another folder: lumislice slice JOB.toml -o OTHER, with formats = [\"{name}\"]"
            );
            (why, cure)
        }
        _ => ("none that slices become", names().join(", ")),
    };
    format!("--to: found {name}, {why}; expected {cure}")
}

/// The format of a name, one that slices become.
fn format(name: &str, folder: &Path) -> Result<OutputFormat> {
    let format = OutputFormat::ALL.iter().find(|known| known.0 == name).map(|known| known.1);
    let format = format.ok_or_else(|| refusal!("--to: found {name}, expected one of {}", names().join(", ")))?;
    if !format.holds_whole_jobs() {
        refuse!("{}", elsewhere(format, folder));
    }
    Ok(format)
}

/// Runs the command.
pub fn run(args: &ConvertArgs) -> Result<Answer> {
    let formats: Vec<_> = args.to.iter().map(|name| format(name, &args.folder)).collect::<Result<_>>()?;
    if args.folder.is_file() {
        refuse!("{}: found a file, expected the folder of a finished job", args.folder.display());
    }
    let bars = Bars::new(false);
    let converted: std::result::Result<Vec<_>, _> =
        formats.into_iter().map(|format| convert(&args.folder, format, &bars)).collect();
    bars.finish();
    let converted = converted?;
    let warnings = converted.iter().flat_map(|converted| &converted.warnings).cloned().collect::<Vec<_>>();
    warn_of(&warnings, false);
    // Bitmaps are thousands.
    let files = converted.iter().flat_map(|converted| &converted.files).filter(|path| !path.ends_with(".bmp"));
    let mut told: Vec<&String> = Vec::new();
    for path in files {
        // Several containers have one mapping.txt.
        if !told.contains(&path) {
            told.push(path);
        }
    }
    document(false, &json!({ "output": args.folder.to_string_lossy(), "files": told }))?;
    print(&told.iter().map(|path| format!("{}\n", args.folder.join(path).display())).collect::<String>())?;
    Ok(Answer::Yes)
}
