//! What was asked for is what prints: a job is printed in memory and looked at, and its targets are corrected where the
//! print misses; then it is printed again.
//!
//! **In:** a [`Prepared`] job as a draft. **Out:** the same job with other layers, and what every round found
//! ([`Rounds`]).
//!
//! ```text
//!   fields ──► voxels ──► printed albedo at points of the surface
//!     ▲                                │
//!     │                   ln (asked / printed): what places of like shape, contrast and grain
//!     │                   of their voxels miss alike, and means over some mm² of what is
//!     │                   left, as far as noise allows
//!     │                                │
//!   labels ◄── factors of the albedo ◄─┘  over how far the print followed the last ones
//!              (see `plan/on_surface`)
//! ```
//!
//! A flat slab's promise misses where a surface bends, where light comes through from another side, beside an edge, and
//! where the lattice cannot hold a layer. What makes up for it is a factor of the albedo that the stackings are asked
//! for, one for each channel, smooth over the surface (of a flat patch one for every texel). Where no stacking reaches
//! it, the factor stays at what is reached. What is laid last is looked at once more, and what lay before is laid again
//! if that was better: stackings may jump where factors hardly change.
//!
//! Points, walks and means are drawn and summed in a fixed order, and factors are rounded to a thousandth before they
//! are used: what is found is the same for any number of threads, and reads back from a file as what it was.

mod contrast;
mod correct;
mod grain;
mod progress;
mod residual;
mod response;
mod shape;

use std::{path::Path, time::Instant};

use contrast::Contrast;
use grain::Meant;
use progress::Wanting;
use residual::{Looked, Residuals, Seen, Sums};
use response::Responses;
use shape::Shape;

use super::{
    Job, Prepared, RunError,
    look::{LOOK_VOXELS, SPOT_RADIUS_MM, shade},
    plan::{CHANNELS, ObjectPlan},
    record::{Ended, ObjectCorrection, RoundRecord, Rounds},
};
use crate::{
    appearance::PointOfSurface,
    look::{Scene, Spot},
    parallel,
    watch::{StopOnly, Watch},
};

/// Walks of a round in all channels, and at most in one; and how many a point has at least and at most in each. With
/// 400 in place of 125 at each of a rabbit's 20,000 points, what bells and shape cannot tell of a miss is smaller by a
/// tenth in thin parts; with 400 in place of 200 a cube of albedo 0.2 is off by 1.2% in place of 1.4%.
const WALKS: u64 = 12_000_000;
const WALKS_OF_A_CHANNEL: u64 = 8_000_000;
const WALKS_EACH: [u64; 2] = [128, 8192];
/// The look after the last round has so many times fewer.
const FEWER: u64 = 4;
/// Seeds of rounds: apart from those of looks.
const SEED: u64 = 0x5EED_0F20_0D50;
/// Factors end here, as logarithms: what needs more is out of reach.
const GREATEST: f64 = 2.5;
/// Part of a miss that a round makes up for: where a part is so thin that its core all but ends, the print answers up
/// to 1.4 times as strongly as the model. Where it answers by less, for light from around, see [`response`].
const DAMPING: f64 = 0.8;
/// A factor that falls short by more than this is out of reach.
const SHORT: f64 = 0.03;

/// Turns rays differently from point to point.
const SPREAD: f64 = 0.754_877_666_246_692_7;

/// Factors of an object's albedo at its points, as logarithms.
type Factors = Vec<[f64; CHANNELS]>;

/// A round of all objects.
struct Round {
    looked: Looked,
    /// The factors that were asked for, by object.
    laid: Vec<Factors>,
    /// The factors that the stackings came to.
    reached: Vec<Factors>,
}

impl Round {
    fn followed(&self, object: usize, plan: &ObjectPlan) -> Followed<'_> {
        Followed { reached: &self.reached[object], sums: self.looked.sums(object, plan) }
    }
}

/// What came of the factors of an object in one round.
struct Followed<'a> {
    /// The factors that the stackings came to.
    reached: &'a Factors,
    /// What is asked and printed at each point.
    sums: Vec<Option<Sums<'a>>>,
}

/// What a round says.
struct Judged {
    round: Round,
    record: RoundRecord,
    /// Why no other round should follow, if none should.
    ends: Option<Ended>,
    /// The factors to ask for next, by object.
    next: Vec<Factors>,
}

impl Prepared {
    /// Reads the inputs of `job`, searches the stackings, builds the fields; then looks at the print and corrects it,
    /// as often as the job says.
    ///
    /// # Errors
    /// Any input that cannot be used; see [`RunError`].
    pub fn new(job: Job, watch: &dyn Watch) -> Result<Self, RunError> {
        Self::corrected(job, &[], watch)
    }

    /// [`Self::new`], which takes what an earlier run of the same job left in the first of `folders` that has it in
    /// place of looking again.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn for_folders(job: Job, folders: &[impl AsRef<Path>], watch: &dyn Watch) -> Result<Self, RunError> {
        Self::corrected(job, &folders.iter().map(AsRef::as_ref).collect::<Vec<_>>(), watch)
    }

    /// Whether its rounds of correction are those that lie in `folder`.
    pub fn took_rounds_from(&self, folder: &Path) -> bool {
        let Some(rounds) = &self.rounds else { return false };
        self.took.rounds.is_empty() && Rounds::read(folder, &rounds.sha256).as_ref() == Some(rounds)
    }

    fn corrected(job: Job, folders: &[&Path], watch: &dyn Watch) -> Result<Self, RunError> {
        let started = Instant::now();
        let mut prepared = Self::corrected_draft(job, folders, watch)?;
        prepared.took.whole = started.elapsed();
        Ok(prepared)
    }

    fn corrected_draft(job: Job, folders: &[&Path], watch: &dyn Watch) -> Result<Self, RunError> {
        let mut prepared = Self::draft(job, watch)?;
        let plans = std::mem::take(&mut prepared.plans);
        if prepared.job.rounds() == 0 || plans.is_empty() {
            return Ok(prepared);
        }
        let voxels = prepared.looked_at_voxels();
        if voxels > LOOK_VOXELS {
            prepared.warnings.push(format!(
                "appearance.rounds: the print is not corrected, for its {voxels} voxels are more than the {LOOK_VOXELS} that \
                 are looked at in memory"
            ));
            return Ok(prepared);
        }
        let sha256 = prepared.digest();
        let mut known = folders.iter().filter_map(|folder| Rounds::read(folder, &sha256));
        prepared.rounds = Some(match known.find(|known| known.fits(&plans)) {
            Some(known) => {
                for (plan, correction) in plans.iter().zip(&known.objects) {
                    prepared.lay_again(plan, &factors(correction), watch)?;
                }
                let rounds = prepared.job.rounds();
                (1..).zip(&known.rounds).for_each(|(number, record)| record.tell(number, rounds, watch));
                known
            }
            None => prepared.correct(&plans, sha256, watch)?,
        });
        Ok(prepared)
    }

    /// Lays all objects with these factors; by how much their labels fall short of them.
    fn lay_all_again(
        &mut self,
        plans: &[ObjectPlan],
        laid: &[Factors],
        watch: &dyn Watch,
    ) -> Result<Vec<Vec<[f64; CHANNELS]>>, RunError> {
        plans.iter().zip(laid).map(|(plan, factors)| self.lay_again(plan, factors, watch)).collect()
    }

    /// Prints in memory and looks at the points, at `spots` from the second round on; after the last round with fewer
    /// walks, which tell whether its correction brought the print nearer.
    fn look_at_print(
        &self,
        plans: &[ObjectPlan],
        spots: &mut Option<Vec<PointSpot>>,
        round: u32,
        watch: &dyn Watch,
    ) -> Result<Looked, RunError> {
        let name = match self.job.rounds() {
            rounds if round < rounds => format!("round {} of {rounds}", round + 1),
            _ => "after the last round".to_owned(),
        };
        watch.stage(&format!("{name}: voxels"), 0);
        let scene = self.scene(&StopOnly(watch))?;
        let scene = self.between_mirrors(&scene)?.unwrap_or(scene);
        // Where they lie and what is asked for does not change.
        let spots = spots.get_or_insert_with(|| self.spots_of(plans, &scene));
        watch.stage(&format!("{name}: light"), spots.len() as u64);
        self.look_at_points(plans, &scene, spots, round, watch)
    }

    /// Holds what is printed against what is asked for: what to ask of the labels next, and whether to. `laid` was
    /// asked this time, and the labels fell short of it by `short_of`.
    fn judge(
        &self,
        plans: &[ObjectPlan],
        looked: Looked,
        laid: Vec<Factors>,
        short_of: &[Vec<[f64; CHANNELS]>],
        before: Option<&Round>,
    ) -> Judged {
        let mut record = looked.record();
        let short = |(plan, short_of): (&ObjectPlan, &Vec<_>)| self.short_at_points(plan, short_of);
        let short: Vec<Factors> = plans.iter().zip(short_of).map(short).collect();
        let reached = |(laid, short): (&Factors, &Factors)| laid.iter().zip(short).map(|(a, b)| minus(a, b)).collect();
        let reached = laid.iter().zip(&short).map(reached).collect();
        let round = Round { looked, laid, reached };
        let (mut lost, mut wanting) = (0, Wanting::default());
        let mut next = Vec::with_capacity(plans.len());
        for (n, (plan, short)) in plans.iter().zip(&short).enumerate() {
            let now = round.followed(n, plan);
            let residuals = Residuals::of(plan, &now.sums);
            record.worst = record.worst.max(residuals.worst);
            let factors = plan.factors();
            for (off, short) in residuals.off.iter().zip(short) {
                lost += usize::from(short[..factors].iter().any(|short| short.abs() > SHORT));
                wanting.count(&off[..factors], &short[..factors], SHORT);
            }
            let before = before.map(|before| before.followed(n, plan));
            let response = |channel: usize| Responses::of(plan, channel, before.as_ref(), &now);
            next.push(corrected(&now, &residuals, &(0..factors).map(response).collect::<Vec<_>>()));
        }
        record.out_of_reach = lost as f64 / record.points.max(1) as f64;
        let ends = wanting.ends(before.map(|before| &before.looked), &round.looked);
        Judged { round, record, ends, next }
    }

    /// By how much what lies at the points of an object falls short of what was asked of its labels, which `short_of`
    /// tells.
    fn short_at_points(&self, plan: &ObjectPlan, short_of: &[[f64; CHANNELS]]) -> Factors {
        let clusters = self.objects[plan.object].stackings.stackings.len();
        let field = &self.slicer().objects()[plan.object];
        let short_at = |point: &PointOfSurface| {
            let mut short = [0.0; CHANNELS];
            for shared in field.shares(point.triangle, point.point) {
                let label = usize::from(shared.stacking).checked_sub(clusters);
                if let Some(of_label) = label.and_then(|label| short_of.get(label)) {
                    short.iter_mut().zip(of_label).for_each(|(sum, one)| *sum += f64::from(shared.share) * one);
                }
            }
            short
        };
        plan.points.points().iter().map(short_at).collect()
    }

    /// A spot around every point that can be seen, and what is asked for there.
    fn spots_of(&self, plans: &[ObjectPlan], scene: &Scene) -> Vec<PointSpot> {
        let of_point = |&(n, at): &(usize, usize)| {
            let plan = &plans[n];
            let point = &plan.points.points()[at];
            let radius_mm = plan.point_a_texel_mm.map_or(SPOT_RADIUS_MM, |mm| 0.5 * mm);
            let spot = self.spot_of(scene, plan.object, point.triangle, point.point, radius_mm)?;
            let turn = (at as f64 * SPREAD).fract();
            let sky = shade::sky(scene, &spot.middle, turn);
            let shape = Shape::new(scene, &spot.middle, sky, plan.half_ln(at), turn);
            let asked = &self.objects[plan.object].asked;
            let goal = |texel: usize, albedo: &[f64]| plan.within_reach(texel, albedo, asked);
            let albedo = self.expected_as(&spot, &goal).asked?;
            let asked = shade::all_shown(&albedo, sky);
            Some((PointSpot { plan: n, at, spot: spot.spot, radius_mm, asked, contrast: Vec::new(), shape }, albedo))
        };
        let points = |(n, plan): (usize, &ObjectPlan)| (0..plan.points.points().len()).map(move |at| (n, at));
        let points: Vec<_> = plans.iter().enumerate().flat_map(points).collect();
        let (mut spots, albedos): (Vec<_>, Vec<_>) = parallel::map_all(&points, of_point).into_iter().flatten().unzip();
        let contrasts = contrast::of_spots(plans, &spots, &albedos);
        spots.iter_mut().zip(contrasts).for_each(|(spot, contrast)| spot.contrast = contrast);
        spots
    }

    /// Looks at the points of all objects that can be corrected.
    fn look_at_points(
        &self,
        plans: &[ObjectPlan],
        scene: &Scene,
        spots: &[PointSpot],
        round: u32,
        watch: &dyn Watch,
    ) -> Result<Looked, RunError> {
        let channels = self.materials.channels.len();
        let all = walks_of_a_round(spots.len(), channels);
        let walks = if round < self.job.rounds() { all } else { all / FEWER };
        let seed = SEED.wrapping_mul(u64::from(round) + 1);
        let sites: Vec<Spot> = spots.iter().map(|spot| spot.spot.clone()).collect();
        let printed = scene.printed_albedo(&sites, walks, seed, watch)?;
        let mut looked = Looked::new(plans, walks, channels);
        for (spot, printed) in spots.iter().zip(printed) {
            if let Some(printed) = printed.into_iter().collect() {
                let (asked, contrast) = (spot.asked.clone(), spot.contrast.clone());
                let seen = Seen { asked, printed, shape: spot.shape, grain: Vec::new(), contrast };
                looked.objects[spot.plan][spot.at] = Some(seen);
            }
        }
        // In several channels it tells next to nothing, and no correction follows the last look.
        if channels == 1 && round < self.job.rounds() {
            self.count_grain(plans, scene, spots, &mut looked)?;
        }
        Ok(looked)
    }

    /// Counts what lies below the points that were seen.
    fn count_grain(
        &self,
        plans: &[ObjectPlan],
        scene: &Scene,
        spots: &[PointSpot],
        looked: &mut Looked,
    ) -> Result<(), RunError> {
        let meant = plans.iter().map(|plan| Meant::of(self, plan.object)).collect::<Result<Vec<_>, _>>()?;
        let grain = parallel::map_all(spots, |spot| {
            let field = &self.slicer().objects()[plans[spot.plan].object];
            meant[spot.plan].beside(scene.volume(), field, &spot.spot.sites, spot.radius_mm)
        });
        for (spot, grain) in spots.iter().zip(grain) {
            if let Some(seen) = &mut looked.objects[spot.plan][spot.at] {
                seen.grain = grain;
            }
        }
        Ok(())
    }
}

/// Walks from each of so many points in a round, for each channel.
pub(in crate::job) fn walks_of_a_round(points: usize, channels: usize) -> u64 {
    let [fewest, most] = WALKS_EACH;
    let of_a_channel = (WALKS / channels.max(1) as u64).min(WALKS_OF_A_CHANNEL);
    (of_a_channel / points.max(1) as u64).clamp(fewest, most)
}

fn minus(a: &[f64; CHANNELS], b: &[f64; CHANNELS]) -> [f64; CHANNELS] {
    std::array::from_fn(|channel| a[channel] - b[channel])
}

/// The factors of the next round: those reached, as far as a place is lit, and most of what is off, as far as the
/// print follows.
fn corrected(now: &Followed<'_>, residuals: &Residuals, responses: &[Responses]) -> Factors {
    let at = |n: usize| {
        let mut factor = [0.0; CHANNELS];
        for (channel, response) in responses.iter().enumerate() {
            let shape = now.sums[n].as_ref().map(|sums| &sums[channel].shape);
            let [of_means, of_points] = shape.map_or([1.0; 2], |shape| response.at(shape));
            let kept = shape.map_or(1.0, Shape::lit) * now.reached[n][channel];
            let own = residuals.of_points[n][channel];
            let off = (residuals.off[n][channel] - own) / of_means + own / of_points;
            factor[channel] = (kept + DAMPING * off).clamp(-GREATEST, GREATEST);
        }
        factor
    };
    (0..now.sums.len()).map(at).collect()
}

/// A point of a plan as it is looked at.
struct PointSpot {
    plan: usize,
    at: usize,
    spot: Spot,
    radius_mm: f64,
    /// Albedo that is asked for, as far as it can be reached, less what other parts of the object take of the light
    /// there, by channel.
    asked: Vec<f64>,
    contrast: Vec<Contrast>,
    shape: Shape,
}

impl Rounds {
    /// Whether it holds a factor for every point of every plan.
    fn fits(&self, plans: &[ObjectPlan]) -> bool {
        let fits = |(plan, found): (&ObjectPlan, &ObjectCorrection)| {
            let points = plan.points.points().len();
            found.object == plan.object
                && found.ln_factor_thousandths.len() == plan.factors()
                && found.ln_factor_thousandths.iter().all(|channel| channel.len() == points)
        };
        self.objects.len() == plans.len() && plans.iter().zip(&self.objects).all(fits)
    }
}

fn correction(plan: &ObjectPlan, factors: &Factors) -> ObjectCorrection {
    let rounded = |channel: usize| factors.iter().map(|ln| (1000.0 * ln[channel]).round() as i32).collect();
    ObjectCorrection { object: plan.object, ln_factor_thousandths: (0..plan.factors()).map(rounded).collect() }
}

fn factors(correction: &ObjectCorrection) -> Factors {
    let of = |channel: usize, at: usize| {
        correction.ln_factor_thousandths.get(channel).map_or(0.0, |factors| f64::from(factors[at]) / 1000.0)
    };
    let points = correction.ln_factor_thousandths.first().map_or(0, Vec::len);
    (0..points).map(|at| std::array::from_fn(|channel| of(channel, at))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What was asked for once fades where no sky is seen, and stays where it is.
    #[test]
    fn places_that_see_no_sky_go_back_to_what_was_found() {
        let [dark, dim, lit] = [0.0, 0.15, 1.0].map(|sky| Shape::with([0.0, 0.0, 1.0 - sky]));
        let sample = |shape: Shape| shape::Sample {
            shape,
            grain: &[],
            contrast: contrast::EVEN,
            asked: 0.1,
            printed: 0.1,
            variance: 0.0,
        };
        let sums: Vec<_> = [dark, dim, lit].map(|shape| Some(vec![sample(shape)])).to_vec();
        let reached = vec![[-0.5; CHANNELS]; 3];
        let now = Followed { reached: &reached, sums };
        let none = vec![[0.0; CHANNELS]; 3];
        let residuals = Residuals { off: none.clone(), of_points: none, worst: 0.0 };
        let next = corrected(&now, &residuals, &[Responses::WHOLE]);
        let factors: Vec<f64> = next.iter().map(|factor| factor[0]).collect();
        assert!(factors[0] == 0.0 && (factors[1] + 0.25).abs() < 1e-9 && factors[2] == -0.5, "{factors:?}");
    }

    /// What is asked for against grain and contrast is divided by how far the print follows single points, the rest by how far it
    /// follows means.
    #[test]
    fn corrections_are_divided_by_how_far_the_print_follows_them() {
        let shape = Shape::with([0.0; 3]);
        let sample =
            shape::Sample { shape, grain: &[], contrast: contrast::EVEN, asked: 0.1, printed: 0.1, variance: 0.0 };
        let reached = vec![[0.0; CHANNELS]];
        let now = Followed { reached: &reached, sums: vec![Some(vec![sample])] };
        let residuals = Residuals { off: vec![[0.15; CHANNELS]], of_points: vec![[0.05; CHANNELS]], worst: 0.0 };
        let next = corrected(&now, &residuals, &[Responses::with(1.0, 0.5)]);
        assert!((next[0][0] - DAMPING * (0.1 + 0.05 / 0.5)).abs() < 1e-12, "{next:?}");
    }
}
