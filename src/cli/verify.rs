//! `lumislice verify`: is a finished folder what its manifest says?

use std::path::PathBuf;

use clap::Args;
use lumislice::{
    job::{
        Job, Prepared, RunError,
        verify::{Remake, RemakeError, verify, verify_job},
    },
    words::counted,
};
use serde_json::json;

use super::{Answer, Result, document, print_words, progress::Bars, say};

/// Re-read every file of a finished job and check it against the manifest.
///
/// Prints a line for everything that is wrong; exit code 1 if anything is.
#[derive(Debug, Args)]
pub struct VerifyArgs {
    /// Folder of a finished job.
    #[arg(value_name = "OUT")]
    folder: PathBuf,
    /// Job file that the folder was made from: makes the stackings and some slices again, and finds what was changed
    /// together with the manifest.
    #[arg(long, value_name = "JOB.toml")]
    job: Option<PathBuf>,
    /// With --job: makes every file again.
    #[arg(long, requires = "job")]
    deep: bool,
    /// Print one JSON document instead of lines.
    #[arg(long)]
    json: bool,
}

/// Runs the command.
pub fn run(args: &VerifyArgs) -> Result<Answer> {
    let bars = Bars::new(args.json);
    let result = match &args.job {
        None => verify(&args.folder, &bars).map_err(RemakeError::from),
        Some(path) => {
            let remake = if args.deep { Remake::All } else { Remake::Sample };
            let prepared = Job::load(path)
                .map_err(RunError::from)
                .and_then(|job| Prepared::for_folders(job, &[&args.folder], &bars));
            prepared.map_err(RemakeError::from).and_then(|prepared| verify_job(&args.folder, &prepared, remake, &bars))
        }
    };
    bars.finish();
    let result = result?;
    let sound = result.findings.is_empty();
    if !document(
        args.json,
        &json!({
            "ok": sound,
            "files": result.files,
            "bytes": result.bytes,
            "slices": result.slices,
            "voxels": result.voxels,
            "findings": result.findings,
        }),
    )? {
        print_words(&result.findings.iter().map(|finding| format!("{finding}\n")).collect::<String>())?;
        let verdict = match result.findings.len() {
            0 => "sound".to_owned(),
            n => counted(n, "finding"),
        };
        let [files, slices] =
            [(result.files, "file"), (result.slices, "slice")].map(|(count, noun)| counted(count as usize, noun));
        say(&format!("{}: {files}, {slices}: {verdict}", args.folder.display()));
    }
    Ok(if sound { Answer::Yes } else { Answer::No })
}
