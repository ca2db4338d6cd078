//! `--no-cache`: searches that were made before, in the user's cache folder.

use std::{env, path::PathBuf};

use clap::Args;
use lumislice::search::SearchCache;

/// Names the folder that answers are kept in; empty, none are.
const VARIABLE: &str = "LUMISLICE_CACHE";

/// Whether to look up searches that were made before.
#[derive(Debug, Clone, Args)]
pub struct CacheArgs {
    /// Search anew what was searched before. Answers are kept in the user's cache folder, or in the folder that
    /// LUMISLICE_CACHE names; they change no result
    #[arg(long, help_heading = "Work")]
    no_cache: bool,
}

impl CacheArgs {
    /// The cache, if it is wanted and there is a place for it.
    pub fn cache(&self) -> Option<SearchCache> {
        let folder = match env::var_os(VARIABLE) {
            Some(folder) => PathBuf::from(folder),
            None => user_cache()?.join("lumislice").join("search"),
        };
        (!self.no_cache && !folder.as_os_str().is_empty()).then(|| SearchCache::in_folder(folder))
    }
}

/// Where programs of this system keep what they can make again.
fn user_cache() -> Option<PathBuf> {
    let folder = |variable: &str| env::var_os(variable).map(PathBuf::from).filter(|path| path.is_absolute());
    if cfg!(windows) {
        folder("LOCALAPPDATA")
    } else if cfg!(target_os = "macos") {
        Some(folder("HOME")?.join("Library").join("Caches"))
    } else {
        folder("XDG_CACHE_HOME").or_else(|| Some(folder("HOME")?.join(".cache")))
    }
}
