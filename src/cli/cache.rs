//! `--no-cache`: searches that were made before, in the user's cache folder.

use clap::Args;
use lumislice::search::SearchCache;

/// Whether to look up searches that were made before.
#[derive(Debug, Clone, Args)]
pub struct CacheArgs {
    /// Search anew what was searched before. Answers are kept in the user's cache folder, below lumislice/search; they
    /// change no result
    #[arg(long, help_heading = "Work")]
    no_cache: bool,
}

impl CacheArgs {
    /// The cache, if it is wanted and there is a place for it.
    pub fn cache(&self) -> Option<SearchCache> {
        let folder = (!self.no_cache).then(dirs::cache_dir).flatten()?;
        Some(SearchCache::in_folder(folder.join("lumislice").join("search")))
    }
}
