//! What an object is laid from where its layers depend on more than its texture: how thick it is, and by how much its
//! print was too light or too dark.
//!
//! Both live on the surface, at [`SurfacePoints`], never in the texture, whose charts end where the surface does not.
//! Every texel has a place there, and so has every node that stands in for texels where the texture is too coarse,
//! repeats itself or is not there at all. What is laid at a texel is told by its cluster, by one of a ladder of
//! thicknesses and by one of a fine ladder of factors for each channel; each combination that occurs is a label of its
//! own.
//!
//! A factor makes up for two things: for how the print looks there, and for what the texel's own albedo differs from
//! its cluster's by. A hundred clusters are few for the colours of a photograph: in three channels they lie a quarter
//! apart. Between two steps of a ladder fine texels take either, as often as they are near it, so that over some of
//! them what is wanted is laid on the mean, and no step shows as an edge.

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::{
    answers::{Answer, Answers, Question},
    asked::{AskedMap, Surface},
    context::TargetContext,
};
use crate::{
    appearance::{Atlas, ClusterId, LabelMap, SurfacePoints, TexelSite},
    job::RunError,
    mesh::{Solid, TriangleMesh},
    optics::{Layer, Mixture, Stack},
    sdf::{Surface as Closest, half_thickness},
    watch::Watch,
};

/// Channels that are corrected each on its own; where there are more, all get the same factor.
pub(in crate::job) const CHANNELS: usize = 4;
/// What is known at a point: logarithms of half the thickness in mm and of the factor by channel.
type Known = [f64; 1 + CHANNELS];

/// Distance of nodes, mm: fine enough for what the eye tells of a glow that is a millimetre wide.
const NODE_MM: f64 = 0.5;
/// Nodes of a texture that repeats itself are as fine as its texels, down to this.
const FINEST_NODE_MM: f64 = 0.1;
/// A texture whose triangles overlap by more than this share repeats itself.
const OVERLAP: f64 = 1.2;
/// Distance of points, mm, at most; small objects have at least so many, closer together.
const POINT_MM: f64 = 0.5;
const FEWEST_POINTS: f64 = 500.0;
const MOST_POINTS: usize = 20_000;
/// Thicknesses are told apart from the first down, mm, each smaller than the one before by this factor.
const THICKEST_MM: f64 = 4.8;
const THICKNESS_STEP: f64 = std::f64::consts::SQRT_2;
/// Thinner parts are as good as this: light comes in from all sides, and no layers fit.
const THINNEST_MM: f64 = 0.15;
/// Logarithm of the step between factors; wider, by so much at a time, where there would be too many labels.
const FACTOR_STEP: f64 = 0.02;
const WIDER: f64 = 1.25;
/// Albedos below this have wider steps, alike in lightness; below the second, which counts as black, none of their own.
const DARK: f64 = 0.1;
const BLACK: f64 = 0.002;
/// Most labels beside the clusters' own: each is a row of a table that is read at every voxel.
const MOST_LABELS: usize = 4096;
/// Texels of pages as fine as this, mm, share out what lies between two steps.
const FINE_MM: f64 = 0.2;

/// One object whose layers depend on where they lie.
#[derive(Debug)]
pub(in crate::job) struct ObjectPlan {
    /// Its place among the objects.
    pub object: usize,
    pub kind: &'static str,
    has_uvs: bool,
    solid: Solid,
    atlas: Atlas,
    clusters: Vec<LabelMap>,
    sites: Vec<TexelSite>,
    /// Pages whose texels share out what lies between two steps.
    shared_out: Vec<bool>,
    /// Points that its surface is known at.
    pub points: SurfacePoints,
    half_ln: Vec<f64>,
    answers: Answers,
    channels: usize,
}

/// What a label beside the clusters' own stands for.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct VariantEntry {
    /// The cluster it is made from.
    pub cluster: usize,
    /// Half the thickness of the object that it is made for, mm; `None` where that is more than the layers need.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub half_thickness_mm: Option<f64>,
    /// Factor of the cluster's albedo, by channel.
    pub factor: Vec<f64>,
    /// Layers, top first.
    pub layers: Vec<Layer<String>>,
    /// Albedo predicted per channel: of a flat slab, or of a plate as thin as that.
    pub predicted_albedo: Vec<f64>,
}

/// What an object is laid from.
pub(in crate::job) struct Laid {
    pub labels: Vec<LabelMap>,
    pub questions: Vec<Question>,
    pub answers: Vec<Answer>,
}

/// What tells labels apart: cluster, step of thickness (or none), steps of factors.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Key {
    cluster: u16,
    thickness: u8,
    factors: [i16; CHANNELS],
}

const THICK: u8 = u8::MAX;

impl ObjectPlan {
    /// Prepares an object; texels of `map` are completed by those of the nodes.
    pub(super) fn new(
        context: &TargetContext<'_>,
        mut solid: Solid,
        kind: &'static str,
        surface: Surface,
        map: &mut AskedMap,
        answers: Answers,
    ) -> Result<Option<Self>, RunError> {
        let (mut atlas, mut clusters) = match surface {
            Surface::Uniform => (Atlas::new(&solid.mesh, &[(1, 1)], &[]), vec![LabelMap(vec![ClusterId(0)])]),
            Surface::Labelled { atlas, labels } => (atlas, labels),
        };
        let Some(closest) = Closest::new(&solid.mesh) else { return Ok(None) };
        context.watch.stage("surface", 0);
        let (spacing, texel_mm) = node_spacing(&solid.mesh, &atlas);
        let mut shared_out: Vec<bool> = texel_mm.iter().map(|mm| *mm <= FINE_MM).collect();
        let mut wanted = vec![false; atlas.pages().len()];
        for (place, spacing) in atlas.places().iter().zip(&spacing) {
            wanted[usize::from(place.page)] |= spacing.is_none();
        }
        let mut sites = atlas.sites(&solid.mesh, |page| wanted[usize::from(page)]);
        let before = solid.mesh.uvs.clone();
        let old_places = atlas.places().to_vec();
        let nodes = atlas.lay_nodes(&mut solid.mesh, &spacing);
        shared_out.resize(atlas.pages().len(), false);
        clusters
            .extend(atlas.pages()[clusters.len()..].iter().map(|page| LabelMap(vec![ClusterId(0); page.source.len()])));
        // What a node's place asked for by the texture that it had.
        let starts = atlas.starts();
        let old_pages = old_places.iter().map(|place| usize::from(place.page) + 1).max().unwrap_or(0);
        map.extend(starts[atlas.pages().len()]);
        for site in &nodes {
            let [a, b, c] = before[site.triangle as usize];
            let [v, w] = site.within();
            let page = usize::from(old_places[site.triangle as usize].page);
            let texel = atlas.pages()[page].texel_at(a + (b - a) * v + (c - a) * w);
            clusters[usize::from(site.page)].0[site.texel as usize] = clusters[page].0[texel];
            map.copy(starts[page] + texel, starts[usize::from(site.page)] + site.texel as usize);
        }
        debug_assert!(old_pages <= clusters.len());
        sites.extend(nodes);
        context.watch.go_on()?;
        let area: f64 = solid.mesh.corners().map(|[a, b, c]| 0.5 * (b - a).cross(c - a).length()).sum();
        let spacing_mm = POINT_MM.min((area / FEWEST_POINTS).sqrt());
        let points =
            SurfacePoints::spread(closest.triangles(), spacing_mm, MOST_POINTS / context.job.objects.len().max(1));
        let half = |place: &crate::appearance::PointOfSurface| {
            libm::log(half_thickness(&closest, place.point, place.normal, THICKEST_MM * 1.5).max(THINNEST_MM))
        };
        let half_ln = points.points().par_iter().map(half).collect();
        context.watch.go_on()?;
        let channels = context.materials.channels.len();
        let (object, has_uvs) = (context.object, context.has_uvs);
        Ok(Some(Self {
            object,
            kind,
            has_uvs,
            solid,
            atlas,
            clusters,
            sites,
            shared_out,
            points,
            half_ln,
            answers,
            channels,
        }))
    }

    /// The solid, with the texture coordinates of its nodes.
    pub fn solid(&self) -> &Solid {
        &self.solid
    }

    /// The texels, those of nodes among them.
    pub fn atlas(&self) -> &Atlas {
        &self.atlas
    }

    /// The stackings of its clusters.
    pub fn stackings(&self) -> impl Iterator<Item = Stack<Mixture>> {
        (0..self.answers.len()).map(|cluster| self.answers.stacking(cluster))
    }

    /// Whether the mesh file has texture coordinates.
    pub fn has_uvs(&self) -> bool {
        self.has_uvs
    }

    /// Channels that have a factor of their own.
    pub fn factors(&self) -> usize {
        if self.channels <= CHANNELS { self.channels } else { 1 }
    }

    /// Labels of all texels where thickness counts, if it does, factors are as `ln_factors` says at the points, and
    /// each asks for what it does in `asked`.
    pub fn lay(
        &self,
        by_thickness: bool,
        ln_factors: &[[f64; CHANNELS]],
        asked: &AskedMap,
        watch: &dyn Watch,
    ) -> Result<Laid, RunError> {
        let known: Vec<Known> = self
            .half_ln
            .iter()
            .zip(ln_factors)
            .map(|(&half, ln)| std::array::from_fn(|n| if n == 0 { half } else { ln[n - 1] }))
            .collect();
        let corners: Vec<_> = self.solid.mesh.corners().collect();
        let normals: Vec<_> = corners.iter().map(|[a, b, c]| (*b - *a).cross(*c - *a).normalize_or_zero()).collect();
        let starts = self.atlas.starts();
        let at_sites: Vec<Known> = self
            .sites
            .par_iter()
            .map(|site| {
                let triangle = site.triangle as usize;
                let mut known = self.points.interpolate(site.position(&corners[triangle]), normals[triangle], &known);
                let texel = starts[usize::from(site.page)] + site.texel as usize;
                let own = asked.ln_own(texel, self.cluster(site), BLACK);
                // One factor for all is of their mean.
                let each = own.len() / self.factors();
                let own = own.chunks(each.max(1)).map(|own| own.iter().sum::<f64>() / own.len() as f64);
                own.zip(&mut known[1..]).for_each(|(own, ln)| *ln += own);
                known
            })
            .collect();
        watch.go_on()?;
        let mut step = FACTOR_STEP;
        let (keys, distinct) = loop {
            let keys: Vec<Key> = self
                .sites
                .par_iter()
                .zip(&at_sites)
                .map(|(site, known)| self.key(site, known, by_thickness, step))
                .collect();
            let mut distinct = keys.clone();
            distinct.par_sort_unstable();
            distinct.dedup();
            distinct.retain(|key| !key.is_plain());
            if distinct.len() <= MOST_LABELS {
                break (keys, distinct);
            }
            step *= WIDER;
        };
        let question = |key: &Key| Question {
            cluster: usize::from(key.cluster),
            half_mm: (key.thickness != THICK).then(|| thickness_mm(key.thickness)),
            ln_factor: (0..self.channels)
                .map(|channel| {
                    let factor = if self.channels <= CHANNELS { channel } else { 0 };
                    f64::from(key.factors[factor]) * self.step(usize::from(key.cluster), factor, step)
                })
                .collect(),
        };
        let questions: Vec<Question> = distinct.iter().map(question).collect();
        let answers = self.answers.answer(&questions, watch)?;
        let mut labels = self.clusters.clone();
        for (site, key) in self.sites.iter().zip(&keys).filter(|(_, key)| !key.is_plain()) {
            let label = self.answers.len() + distinct.partition_point(|other| other < key);
            labels[usize::from(site.page)].0[site.texel as usize] = ClusterId(label as u16);
        }
        Ok(Laid { labels, questions, answers })
    }

    fn cluster(&self, site: &TexelSite) -> ClusterId {
        self.clusters[usize::from(site.page)].0[site.texel as usize]
    }

    /// Logarithm of the step between a cluster's factors, where lighter ones have `step`.
    fn step(&self, cluster: usize, factor: usize, step: f64) -> f64 {
        let albedo = self.answers.asked(cluster).get(factor).copied().unwrap_or(DARK).max(BLACK);
        step * libm::cbrt(DARK / albedo).max(1.0)
    }

    fn key(&self, site: &TexelSite, known: &Known, by_thickness: bool, step: f64) -> Key {
        let cluster = self.cluster(site);
        let page = usize::from(site.page);
        // One threshold for all ladders: of the corners of a cell no more than one more than there are ladders are
        // used.
        let threshold = if self.shared_out[page] { threshold(site.texel, self.atlas.pages()[page].width) } else { 0.5 };
        let on_ladder = |steps: f64| steps.floor() + if steps - steps.floor() > threshold { 1.0 } else { 0.0 };
        let half_mm = libm::exp(known[0]);
        let thin = by_thickness && half_mm < self.answers.thickness_mm(cluster.index()).min(THICKEST_MM);
        let mut factors = [0; CHANNELS];
        for (n, (factor, ln)) in factors.iter_mut().zip(&known[1..=self.factors()]).enumerate() {
            *factor = on_ladder(ln / self.step(cluster.index(), n, step)).clamp(-9999.0, 9999.0) as i16;
        }
        let thickness =
            if thin { on_ladder(thickness_steps(half_mm)).clamp(0.0, f64::from(THICK - 1)) as u8 } else { THICK };
        Key { cluster: cluster.0, thickness, factors }
    }
}

/// From 0 to 1, as evenly spread among any neighbouring texels as can be: Roberts' additive recurrence in two
/// dimensions (*The unreasonable effectiveness of quasirandom sequences*, 2018).
fn threshold(texel: u32, width: u32) -> f64 {
    const PLASTIC: f64 = 1.324_717_957_244_746;
    let (x, y) = (f64::from(texel % width), f64::from(texel / width));
    (0.5 + x / PLASTIC + y / (PLASTIC * PLASTIC)).fract()
}

impl Key {
    /// Whether the cluster's own stacking is laid.
    fn is_plain(&self) -> bool {
        self.thickness == THICK && self.factors == [0; CHANNELS]
    }
}

/// Where on the ladder half a thickness lies, mm.
fn thickness_steps(half_mm: f64) -> f64 {
    libm::log(THICKEST_MM / half_mm) / libm::log(THICKNESS_STEP)
}

fn thickness_mm(step: u8) -> f64 {
    THICKEST_MM / libm::pow(THICKNESS_STEP, f64::from(step))
}

/// Distance of nodes for every triangle whose texels will not do; `None` for those whose texels are as fine as nodes
/// and lie on one place of the surface each. And the length of the texels of every page, mm.
fn node_spacing(mesh: &TriangleMesh, atlas: &Atlas) -> (Vec<Option<f64>>, Vec<f64>) {
    let pages = atlas.pages().len();
    let (mut mm2, mut texels) = (vec![0.0; pages], vec![0.0; pages]);
    let areas = || mesh.corners().map(|[a, b, c]| 0.5 * (b - a).cross(c - a).length());
    for ((area, uvs), place) in areas().zip(&mesh.uvs).zip(atlas.places()) {
        let page = usize::from(place.page);
        let size = f64::from(atlas.pages()[page].width) * f64::from(atlas.pages()[page].height);
        let [a, b, c] = uvs.map(|uv| uv.as_dvec2());
        mm2[page] += area;
        texels[page] += 0.5 * (b - a).perp_dot(c - a).abs() * size;
    }
    let texel_mm: Vec<f64> = (0..pages).map(|page| (mm2[page] / texels[page].max(f64::MIN_POSITIVE)).sqrt()).collect();
    let of_page: Vec<Option<f64>> = (0..pages)
        .map(|page| {
            let covered = atlas.pages()[page].covered().count() as f64;
            let coarse = mm2[page] / covered.max(1.0) > NODE_MM * NODE_MM;
            let repeats = !(texels[page] <= OVERLAP * covered);
            (coarse || repeats).then(|| texel_mm[page].clamp(FINEST_NODE_MM, NODE_MM))
        })
        .collect();
    (atlas.places().iter().map(|place| of_page[usize::from(place.page)]).collect(), texel_mm)
}

impl Laid {
    /// What its labels beside the clusters' own stand for.
    pub(super) fn variants(&self, context: &TargetContext<'_>) -> Vec<VariantEntry> {
        let entry = |(question, answer): (&Question, &Answer)| VariantEntry {
            cluster: question.cluster,
            half_thickness_mm: question.half_mm,
            factor: question.ln_factor.iter().map(|ln| libm::exp(*ln)).collect(),
            // A slot that a stacking skips is no layer of it.
            layers: context
                .materials
                .named(&Stack::joined(answer.stacking.pairs().map(|(mixture, mm)| (mixture.clone(), mm))))
                .layers,
            predicted_albedo: answer.albedo.clone(),
        };
        self.questions.iter().zip(&self.answers).map(entry).collect()
    }

    /// By how much the factors of its labels beside the clusters' own are out of reach, as logarithms by channel.
    pub fn short(&self) -> Vec<[f64; CHANNELS]> {
        let of = |answer: &Answer| std::array::from_fn(|channel| answer.short.get(channel).copied().unwrap_or(0.0));
        self.answers.iter().map(of).collect()
    }

    /// Stackings of its labels beside the clusters' own.
    pub fn stackings(&self) -> impl Iterator<Item = &Stack<Mixture>> {
        self.answers.iter().map(|answer| &answer.stacking)
    }
}
