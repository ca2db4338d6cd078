//! `lumislice verify`: is a finished folder what its manifest says?

use std::path::PathBuf;

use clap::Args;
use lumislice::{job::verify::verify, words::counted};
use serde_json::json;

use super::{Answer, Result, print, print_json, progress::Bars, say};

/// Re-read every file of a finished job and check it against the manifest.
///
/// Prints a line for everything that is wrong; exit code 1 if anything is.
#[derive(Debug, Args)]
pub struct VerifyArgs {
    /// Folder of a finished job.
    #[arg(value_name = "OUT")]
    folder: PathBuf,
    /// Print one JSON document instead of lines.
    #[arg(long)]
    json: bool,
}

/// Runs the command.
pub fn run(args: &VerifyArgs) -> Result<Answer> {
    let bars = Bars::new(args.json);
    let result = verify(&args.folder, &bars);
    bars.finish();
    let result = result?;
    let sound = result.findings.is_empty();
    if args.json {
        print_json(&json!({
            "ok": sound,
            "files": result.files,
            "bytes": result.bytes,
            "slices": result.slices,
            "voxels": result.voxels,
            "findings": result.findings,
        }))?;
    } else {
        print(&result.findings.iter().map(|finding| format!("{finding}\n")).collect::<String>())?;
        let verdict = match result.findings.len() {
            0 => "sound".to_owned(),
            n => counted(n, "finding"),
        };
        let (files, slices) = (result.files, result.slices);
        say(&format!("{}: {files} files, {slices} slices: {verdict}", args.folder.display()));
    }
    Ok(if sound { Answer::Yes } else { Answer::No })
}
