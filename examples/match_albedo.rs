//! Which stack of resins reflects like this? `cargo run --release --example match_albedo -- 0.4 0.5`: an albedo, and a
//! mean free path in mm.

use lumislice::{
    appearance::material_target,
    optics::MaterialSet,
    search::{MatchOptions, Matcher, Objective, SearchOptions},
    watch::Unwatched,
};

#[allow(clippy::print_stdout)] // a program answers on stdout
fn main() -> Result<(), Box<dyn std::error::Error>> {
    let number = |place: usize, default: f64| std::env::args().nth(place).map_or(Ok(default), |text| text.parse());
    let (albedo, mean_free_path_mm) = (number(1, 0.4)?, number(2, 0.5)?);
    let set = MaterialSet::builtin("synthetic")?;
    let target = material_target(&[albedo], &[mean_free_path_mm], set.channels.len(), &set.grid)?;
    let core = set.resin("black").map(|(id, _)| id);
    let search = SearchOptions { core, objective: Objective::default(), ..SearchOptions::default() };
    let options = MatchOptions { search, ..MatchOptions::default() };
    let found = Matcher::new(&set, &options)?.match_targets(&[target], &Unwatched)?.remove(0);
    println!("{} over black reflects {:.4}", set.named(&found.stacking()), found.reflection()[0][0]);
    Ok(())
}
