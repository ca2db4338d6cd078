//! `lumislice preview`: pictures of a finished job.

use std::path::PathBuf;

use clap::Args;
use lumislice::{job::redraw, watch::Watch};

use serde_json::json;

use super::{Answer, Result, document, print, progress::Bars};

/// Draw the pictures of a finished job again, from its slices, and the page that shows them.
#[derive(Debug, Args)]
pub struct PreviewArgs {
    /// Folder of a finished job.
    #[arg(value_name = "OUT")]
    folder: PathBuf,
}

/// Runs the command.
pub fn run(args: &PreviewArgs) -> Result<Answer> {
    let bars = Bars::new(false);
    bars.stage("pictures", 0);
    let written = redraw(&args.folder, &bars);
    bars.finish();
    let written = written?;
    document(false, &json!({ "output": args.folder.to_string_lossy(), "files": written }))?;
    let paths = written.into_iter().map(|path| format!("{}\n", args.folder.join(path).display()));
    print(&paths.collect::<String>())?;
    Ok(Answer::Yes)
}
