//! One matcher for all who ask which stacking reflects like a target: a command, a job, a program.

use serde::{Deserialize, Serialize};

use super::{
    Family, FamilyAnswer, Match, Objective, PartTarget, RefineOptions, Refined, SearchCache, SearchError,
    SearchOptions, SearchTarget, algorithm_1::algorithm_1, branch_and_bound::match_targets, forward, refine::Refiner,
    table::BlockTable,
};
use crate::{
    optics::{MaterialSet, Mixture, Model, OpticsError, Resin, Stack, VolumeCoefficients, predict},
    watch::{Unwatched, Watch},
};

/// Which model judges stackings.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Judge {
    /// Scalar Kubelka–Munk: layers of whole units, proven the best.
    KubelkaMunk,
    /// Transport, which holds for thin layers too: what Kubelka–Munk finds is refined to layers of any thickness. Needs
    /// the coefficients of all resins.
    #[default]
    Transport,
}

/// What is asked of all targets.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct MatchOptions {
    /// The space that is searched, and what is minimised.
    pub search: SearchOptions,
    /// Who judges.
    pub judge: Judge,
    /// Layers that may be printed: of stackings refined by transport, and of those that span a gamut.
    pub layers: RefineOptions,
    /// Whether layers may be mixtures: then stackings are those of a [`Family`], where transport judges and layers are
    /// of no whole steps.
    pub mixtures: bool,
}

/// Tables of a set of resins, built once for any number of targets.
pub struct Matcher {
    kind: Kind,
}

enum Kind {
    Pure(Box<Pure>),
    /// A family is chosen for all targets that are asked for.
    Mixed(Box<(MaterialSet, MatchOptions)>),
}

/// What stackings of pure resins are searched with.
struct Pure {
    table: BlockTable,
    refiner: Option<Refiner>,
}

/// What was found for a target.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Found {
    /// The best stacking of whole units by Kubelka–Munk; `None` where a family answered.
    pub search: Option<Match>,
    /// What became of it by transport, if that judges.
    pub refined: Option<Refined>,
    /// The stacking of a family, where layers may be mixtures.
    pub family: Option<FamilyAnswer>,
}

/// A stacking, and what each model says of it.
#[derive(Debug, Clone, PartialEq)]
pub struct Judged {
    /// The layers over the core.
    pub stacking: Stack<Mixture>,
    /// R̂ per channel by the model that judged.
    pub reflection: Vec<Vec<f64>>,
    /// The objective by Kubelka–Munk.
    pub kubelka_munk: f64,
    /// The objective by transport; `None` where a resin of the set has no coefficients.
    pub transport: Option<f64>,
}

/// Targets that are searched between two looks at the watch.
const BATCH: usize = 16;

impl MatchOptions {
    /// Coefficients of all resins of `set`, index `[resin][channel]`, if transport judges.
    ///
    /// # Errors
    /// [`SearchError::NoCoefficients`].
    pub(super) fn volumes(&self, set: &MaterialSet) -> Result<Option<Vec<Vec<VolumeCoefficients>>>, SearchError> {
        if self.judge == Judge::KubelkaMunk {
            return Ok(None);
        }
        let volumes =
            |resin: &Resin| resin.volumes().ok_or_else(|| SearchError::NoCoefficients { resin: resin.name.clone() });
        set.resins.iter().map(volumes).collect::<Result<_, _>>().map(Some)
    }
}

impl Found {
    /// The layers, by the model that judged; of a family every slot, those of no thickness too.
    pub fn stacking(&self) -> Stack<Mixture> {
        match (&self.family, &self.refined, &self.search) {
            (Some(answer), ..) => answer.stacking.clone(),
            (None, Some(refined), _) => refined.stacking.clone().into(),
            (None, None, Some(search)) => search.stacking.clone().into(),
            (None, None, None) => Stack::default(),
        }
    }

    /// R̂ of them per channel.
    pub fn reflection(&self) -> &[Vec<f64>] {
        let family = self.family.as_ref().map(|answer| &answer.reflection);
        let refined = self.refined.as_ref().map(|refined| &refined.reflection);
        let search = self.search.as_ref().map(|search| &search.reflection);
        family.or(refined).or(search).map_or(&[], Vec::as_slice)
    }

    /// Their objective.
    pub fn objective(&self) -> f64 {
        let family = self.family.as_ref().map(|answer| answer.objective);
        let refined = self.refined.as_ref().map(|refined| refined.objective);
        family.or(refined).or(self.search.as_ref().map(|search| search.objective)).unwrap_or(f64::NAN)
    }

    /// The answer to `target`, by every model; `set` is the one that the matcher was made of.
    pub fn judged(&self, set: &MaterialSet, target: &SearchTarget, objective: &Objective) -> Judged {
        Judged::new(set, self.stacking(), self.reflection(), target, objective)
    }

    /// The stacking of whole units that was refined, by every model; `None` where none was.
    pub fn unrefined(&self, set: &MaterialSet, target: &SearchTarget, objective: &Objective) -> Option<Judged> {
        let Match { stacking, reflection, .. } = self.search.as_ref()?;
        self.refined.is_some().then(|| Judged::new(set, stacking.clone().into(), reflection, target, objective))
    }
}

impl Judged {
    fn new(
        set: &MaterialSet,
        stacking: Stack<Mixture>,
        reflection: &[Vec<f64>],
        target: &SearchTarget,
        objective: &Objective,
    ) -> Self {
        let by = |judge: Judge| judge.reflection(set, &stacking).map(|reflection| objective.of(&reflection, target));
        Self {
            reflection: reflection.to_vec(),
            // Every set has what Kubelka–Munk needs.
            kubelka_munk: by(Judge::KubelkaMunk).unwrap_or(f64::NAN),
            transport: if set.has_coefficients() { by(Judge::Transport).ok() } else { None },
            stacking,
        }
    }
}

impl Matcher {
    /// Precomputes for the resins of `set`.
    ///
    /// # Errors
    /// Options out of range, contradictory limits; a resin without coefficients, if transport judges.
    pub fn new(set: &MaterialSet, options: &MatchOptions) -> Result<Self, SearchError> {
        let mixed = options.mixtures && options.judge == Judge::Transport && options.layers.step_mm.is_none();
        let kind = if mixed {
            options.search.validate(set.resins.len())?;
            options.volumes(set)?;
            Kind::Mixed(Box::new((set.clone(), options.clone())))
        } else {
            Kind::Pure(Box::new(Pure::new(set, options)?))
        };
        Ok(Self { kind })
    }

    /// [`Self::match_targets`] by a matcher that is made for it, unless `cache` knows what it would find.
    ///
    /// # Errors
    /// Those of [`Self::new`] and of [`Self::match_targets`].
    pub fn matched(
        set: &MaterialSet,
        options: &MatchOptions,
        targets: &[SearchTarget],
        watch: &dyn Watch,
        cache: Option<&SearchCache>,
    ) -> Result<Vec<Found>, SearchError> {
        let search = || Self::new(set, options)?.match_targets(targets, watch);
        SearchCache::recall(cache, "stackings", &(set, options, targets), search)
    }

    /// The best stacking of each target, in parallel; the answers do not depend on the number of threads. A target is a
    /// step of the stage that `watch` hears. Mixed layers of all answers are those of one [`Family`]; where limits
    /// leave none, layers are of pure resins.
    ///
    /// # Errors
    /// The first in the order of the targets: one unlike the resins, limits that leave no stacking, a node budget too
    /// small to find one, no layers of whole steps; [`SearchError::Stopped`].
    pub fn match_targets(&self, targets: &[SearchTarget], watch: &dyn Watch) -> Result<Vec<Found>, SearchError> {
        let (set, options) = match &self.kind {
            Kind::Pure(pure) => return pure.match_targets(targets, watch),
            Kind::Mixed(mixed) => &**mixed,
        };
        let parts: Vec<PartTarget> = targets.iter().cloned().map(PartTarget::from).collect();
        match Family::new(set, &options.search, &options.layers, &parts, watch)? {
            Some(family) => {
                let found = |answer| Found { search: None, refined: None, family: Some(answer) };
                Ok(family.answers(&parts, watch)?.into_iter().map(found).collect())
            }
            None => Pure::new(set, options)?.match_targets(targets, watch),
        }
    }

    /// The best stacking of whole units by Algorithm 1 of Hašan et al. 2010 as printed: slow, for checks and
    /// comparisons. Ignores `max_nodes`.
    ///
    /// # Errors
    /// A target unlike the resins; limits that leave no stacking.
    pub fn algorithm_1(&self, target: &SearchTarget) -> Result<Match, SearchError> {
        match &self.kind {
            Kind::Pure(pure) => algorithm_1(&pure.table, target),
            Kind::Mixed(mixed) => algorithm_1(&Pure::table(&mixed.0, &mixed.1)?, target),
        }
    }
}

impl Pure {
    fn new(set: &MaterialSet, options: &MatchOptions) -> Result<Self, SearchError> {
        let table = Self::table(set, options)?;
        let volumes = options.volumes(set)?;
        let refiner = volumes.map(|volumes| Refiner::new(&volumes, &set.grid, &options.search, options.layers));
        Ok(Self { table, refiner })
    }

    fn table(set: &MaterialSet, options: &MatchOptions) -> Result<BlockTable, SearchError> {
        let parameters: Vec<_> = set.resins.iter().map(Resin::kubelka_munk).collect();
        let search = SearchOptions { surface: set.surface(), ..options.search.clone() };
        BlockTable::new(&parameters, &search)
    }

    fn match_targets(&self, targets: &[SearchTarget], watch: &dyn Watch) -> Result<Vec<Found>, SearchError> {
        let mut found = Vec::with_capacity(targets.len());
        for batch in targets.chunks(BATCH) {
            watch.go_on()?;
            match &self.refiner {
                None => {
                    let matches = match_targets(&self.table, batch, watch)?.into_iter();
                    found.extend(matches.map(|search| Found { search: Some(search), refined: None, family: None }));
                }
                Some(refiner) => {
                    let matches = refiner.match_targets(&self.table, batch, watch)?.into_iter();
                    found.extend(matches.map(|(search, refined)| Found {
                        search: Some(search),
                        refined: Some(refined),
                        family: None,
                    }));
                }
            }
            watch.advance(batch.len() as u64);
        }
        Ok(found)
    }
}

impl Judge {
    /// R̂ per channel of `stack`, of resins of `set` or mixtures of them.
    ///
    /// # Errors
    /// A resin without coefficients, if transport judges.
    pub fn reflection<M: Clone + Into<Mixture>>(
        self,
        set: &MaterialSet,
        stack: &Stack<M>,
    ) -> Result<Vec<Vec<f64>>, OpticsError> {
        match self {
            Self::KubelkaMunk => {
                let stack: Stack<Mixture> = stack.map(|medium| medium.clone().into());
                let in_channel = |channel| {
                    let parameters =
                        stack.map(|mixture| (set.mixed_kubelka_munk(mixture, channel), set.refractive_index(mixture)));
                    let parameters = parameters.map(|(parameters, index)| (&**parameters, *index));
                    forward::reflection_under(&parameters, set.grid.len())
                };
                Ok(set.channel_ids().map(in_channel).collect())
            }
            Self::Transport => {
                let light = predict(set, stack, &Model::REFLECTION, &Unwatched)?.light;
                Ok(light.into_iter().map(|light| light.reflection_hankel).collect())
            }
        }
    }
}
