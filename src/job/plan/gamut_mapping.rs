//! `gamut-map`: targets that the resins cannot reach, brought within their gamut before the search.

use super::{asked::Wanted, context::TargetContext};
use crate::job::RunError;
use crate::optics::ResinId;
use crate::search::{Found, Gamut, GamutMap, Move, SearchTarget};

/// What `gamut-map` made of an object's targets.
pub(super) struct Mapped {
    pub map: GamutMap,
    /// The targets after.
    pub targets: Vec<SearchTarget>,
    /// What a search with mixtures found for them, where they are as they were.
    pub found: Option<Vec<Found>>,
}

impl TargetContext<'_> {
    /// Where the object's targets go, if the job asks for that; says what it does.
    pub(super) fn gamut_map(
        &self,
        core: ResinId,
        wanted: &Wanted,
        warnings: &mut Vec<String>,
    ) -> Result<Option<Mapped>, RunError> {
        if !self.job.objects[self.object].gamut_map {
            return Ok(None);
        }
        self.watch.stage("gamut", 0);
        let options = self.match_options(core);
        let gamut = Gamut::explored(self.materials, &options, self.watch, self.job.search_cache.as_ref());
        let gamut = gamut.map_err(|fault| self.search_fault(fault))?;
        let (targets, shares, grid) = (&wanted.targets, &wanted.shares, &self.materials.grid);
        let mut map = GamutMap::new(&gamut, targets, shares, grid);
        let mut found = None;
        if options.mixtures && !map.moves.iter().all(Move::reached) {
            // All of them, for a family is sought for all: without those inside it would be another.
            let with_mixtures = self.search(core, targets)?;
            let reflections: Vec<_> = with_mixtures.iter().map(Found::reflection).collect();
            map = GamutMap::with_mixtures(&gamut, &reflections, targets, shares, grid);
            found = (map.moved() == 0).then_some(with_mixtures);
        }
        // Of targets that the resins reach there is nothing to tell.
        if map.moved() > 0 || !map.moves.iter().all(Move::reached) {
            warnings.push(format!("object {}: gamut-map: {}", self.object + 1, map_in_words(&map, shares)));
        }
        let targets = map.moves.iter().zip(targets).map(|(moved, target)| moved.apply(target, grid)).collect();
        Ok(Some(Mapped { map, targets, found }))
    }
}

/// One sentence: how many targets move, and how far.
fn map_in_words(map: &GamutMap, shares: &[f64]) -> String {
    let moved = || map.moves.iter().filter(|moved| moved.moves());
    let range = |factor: fn(&Move) -> f64| {
        let (low, high) = moved().map(factor).fold((f64::INFINITY, 0.0_f64), |(l, h), f| (l.min(f), h.max(f)));
        format!("{low:.3} to {high:.3}")
    };
    let outside = map.moves.iter().filter(|moved| !moved.reached()).count();
    let all = map.moves.len();
    if map.moved() == 0 {
        return format!("moved none of {all} targets, {outside} lie outside of the gamut");
    }
    let share: f64 = map.moves.iter().zip(shares).filter(|(moved, _)| moved.moves()).map(|(_, share)| share).sum();
    format!(
        "moved {} of {all} targets ({:.0}% of the surface; {outside} lay outside of the gamut): albedo by factors of \
            {}, width by {}",
        map.moved(),
        100.0 * share,
        range(|moved| moved.albedo_factor),
        range(|moved| moved.width_factor),
    )
}
