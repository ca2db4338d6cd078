//! What an object is laid from where its layers depend on more than its texture: how thick it is, and by how much its
//! print was too light or too dark.
//!
//! Both live on the surface, at [`SurfacePoints`], never in the texture, whose charts end where the surface does not;
//! but a flat patch has a point for every texel, where they are few.
//! Every texel has a place there, and so has every node that stands in for texels where the texture is too coarse,
//! repeats itself or is not there at all. What is laid at a texel is told by the albedo that its stacking is to have,
//! by one of a ladder of thicknesses and by its width; each combination that occurs on the lattices of these is a label
//! of its own ([`lattice`](super::lattice)).
//!
//! That albedo is the texel's own, for a hundred clusters are few for the colours of a photograph; times a factor that
//! makes up for how the print looks there; and where the texel's cluster is out of reach, as far off as the stacking
//! that was found for it. Between two steps of a lattice fine texels take either, as often as they are near it, so that
//! over some of them what is wanted is laid on the mean, and no step shows as an edge.

use glam::DVec3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::{
    answers::{Answer, Answers, Question},
    asked::{AskedMap, Surface},
    context::TargetContext,
    lattice::{BLACK, CHANNELS, Classes, Key, Lattice, Place, THICKEST_MM},
};
use crate::{
    appearance::{Atlas, ClusterId, LabelMap, PointOfSurface, SurfacePoints, TexelSite},
    job::RunError,
    mesh::{Solid, TriangleMesh},
    numeric::rounding::rounded,
    optics::{Layer, Mixture, Stack},
    parallel,
    sdf::{Surface as Closest, half_thickness},
    watch::Watch,
};

/// What is known at a point: logarithms of half the thickness in mm and of the factor by channel.
type Known = [f64; 1 + CHANNELS];

/// Texels coarser than this, mm, are replaced by nodes.
const COARSE_MM: f64 = 0.5;
/// Distance of nodes, mm, at least: beside a sharp edge what must be asked for changes by half within so much. Where
/// points are farther apart nodes are too, up to [`COARSE_MM`].
const NODE_MM: f64 = 0.2;
/// Nodes of a texture that repeats itself are as fine as its texels, down to this.
const FINEST_NODE_MM: f64 = 0.1;
/// A texture whose triangles overlap by more than this share repeats itself.
const OVERLAP: f64 = 1.2;
/// Distance of points, mm, at most; small objects have at least so many, closer together. Of an L of two plates, albedo
/// 0.2, mean free path 0.3 mm, spots within 0.2 mm of an edge were 40% too light with nodes every 0.5 mm and points
/// every 0.25 mm; 20% with nodes as near as points, and 17% with both as here. At 0.45 and 0.6 mm rms over all spots
/// went from 2.8 to 2.5 to 1.8%.
const POINT_MM: f64 = 0.16;
const FEWEST_POINTS: f64 = 500.0;
const MOST_POINTS: usize = 20_000;
/// Thinner parts are as good as this: light comes in from all sides, and no layers fit.
const THINNEST_MM: f64 = 0.15;
/// Half thicknesses in mm lie within these.
pub(in crate::job) const HALF_THICKNESSES_MM: [f64; 2] = [THINNEST_MM, 1.5 * THICKEST_MM];
/// Logarithm of a factor by which a stacking's albedo may miss what is asked for and is near.
const NEAR: f64 = 0.02;
/// Most labels beside the clusters' own: each is a row of a table that is read at every voxel.
const MOST_LABELS: usize = 4096;
/// Texels of pages as fine as this, mm, share out what lies between two steps; others where steps are small, for what
/// is wanted all over a plate would all be laid at the same one.
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
    /// Length of its texels, mm, where each has a point of its own.
    pub point_a_texel_mm: Option<f64>,
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
    /// Factor of the albedo that the cluster's stacking has as a flat slab, by channel.
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
        let area: f64 = solid.mesh.corners().map(|[a, b, c]| 0.5 * (b - a).cross(c - a).length()).sum();
        let spacing_mm = POINT_MM.min((area / FEWEST_POINTS).sqrt());
        let mut points = SurfacePoints::spread(
            closest.triangles(),
            spacing_mm,
            (MOST_POINTS / context.job.objects.len().max(1)).max(1),
        );
        // Nodes much nearer than points know no more than these.
        let node_mm = points.spacing_mm().clamp(NODE_MM, COARSE_MM);
        let (spacing, texel_mm) = node_spacing(&solid.mesh, &atlas, node_mm);
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
        let texels_alone = nodes.is_empty();
        sites.extend(nodes);
        context.watch.go_on()?;
        let [thinnest, thickest] = HALF_THICKNESSES_MM;
        let is_patch = context.job.is_patch(context.object, context.solid);
        // Few enough texels are looked at one by one.
        let mut point_a_texel_mm = None;
        if let (true, [mm]) = (is_patch && texels_alone && sites.len() <= MOST_POINTS, &texel_mm[..])
            && *mm >= FINEST_NODE_MM
        {
            points = SurfacePoints::apart(closest.triangles(), points_of(&sites, closest.triangles()), *mm);
            point_a_texel_mm = Some(*mm);
        }
        let half = |place: &PointOfSurface| {
            if is_patch {
                return libm::log(thickest);
            }
            let body = context.body.unwrap_or(&closest);
            libm::log(half_thickness(body, place.point, place.normal, thickest).max(thinnest))
        };
        let half_ln = parallel::map_all(points.points(), half);
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
            point_a_texel_mm,
            half_ln,
            answers,
            channels,
        }))
    }

    /// Logarithm of half the thickness in mm at a point.
    pub fn half_ln(&self, point: usize) -> f64 {
        self.half_ln[point]
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
        let wanted: Vec<Vec<f64>> = (0..self.answers.len()).map(|cluster| self.ln_wanted(cluster, asked)).collect();
        let alike = self.factors() < self.channels;
        let classes =
            if asked.texels() == 0 || alike { Classes::OneEach { alike } } else { Classes::by_width(&asked.targets) };
        let promised = |cluster: ClusterId, n: usize| libm::log(self.answers.promised(cluster.index())[n].max(BLACK));
        let place = |site: &TexelSite| {
            let triangle = site.triangle as usize;
            let known = self.points.interpolate(site.position(&corners[triangle]), normals[triangle], &known);
            let cluster = self.cluster(site);
            let own = asked.ln_own(starts[usize::from(site.page)] + site.texel as usize, cluster, BLACK);
            let wanted = &wanted[cluster.index()];
            let mut ln: [f64; CHANNELS] = std::array::from_fn(|n| known[1 + n]);
            if alike {
                let own = (0..wanted.len()).map(|n| wanted[n] + own.get(n).unwrap_or(&0.0) - promised(cluster, n));
                ln[0] += own.sum::<f64>() / wanted.len() as f64;
            } else {
                let own = own.iter().chain(std::iter::repeat(&0.0));
                ln.iter_mut().zip(wanted.iter().zip(own)).for_each(|(ln, (wanted, own))| *ln += wanted + own);
            }
            let page = usize::from(site.page);
            let width = self.atlas.pages()[page].width;
            let threshold = threshold(site.texel, width);
            let near = self.shared_out[page];
            Place { cluster: cluster.0, half_ln: by_thickness.then_some(known[0]), ln, threshold, near }
        };
        let places: Vec<Place> = self.sites.par_iter().map(place).collect();
        watch.go_on()?;
        let (lattice, keys, distinct) = Lattice::finest(&self.answers, &classes, &places, MOST_LABELS);
        let question = |key: &Key| Question {
            cluster: usize::from(key.cluster),
            half_mm: key.half_mm(),
            ln_albedo: lattice.ln_albedo(key),
        };
        let questions: Vec<Question> = distinct.iter().map(question).collect();
        let answers = self.answers.answer(&questions, watch)?;
        let mut labels = self.clusters.clone();
        for (site, key) in self.sites.iter().zip(&keys) {
            let label = match lattice.plain(key) {
                Some(cluster) => usize::from(cluster),
                None => self.answers.len() + distinct.partition_point(|other| other < key),
            };
            labels[usize::from(site.page)].0[site.texel as usize] = ClusterId(label as u16);
        }
        Ok(Laid { labels, questions, answers })
    }

    /// Logarithms of the albedos that a cluster's stacking is to have, by channel: what is asked for, or as far off as
    /// the stacking that was found where that is far.
    fn ln_wanted(&self, cluster: usize, asked: &AskedMap) -> Vec<f64> {
        let promised = self.answers.promised(cluster);
        let Some(target) = asked.targets.get(cluster) else {
            return promised.iter().map(|albedo| libm::log(albedo.max(BLACK))).collect();
        };
        let of = |(channel, &promised): (&Vec<f64>, &f64)| libm::log(within_reach(channel[0], promised).max(BLACK));
        target.channels.iter().zip(promised).map(of).collect()
    }

    /// An albedo that a texel asks for, as far as the stacking of its cluster shows that it can be reached.
    pub fn within_reach(&self, texel: usize, albedo: &[f64], asked: &AskedMap) -> Vec<f64> {
        let starts = self.atlas.starts();
        let page = starts.partition_point(|start| *start <= texel) - 1;
        let cluster = self.clusters[page].0[texel - starts[page]];
        let Some(target) = asked.targets.get(cluster.index()) else { return albedo.to_vec() };
        let of = |((own, channel), promised): ((&f64, &Vec<f64>), &f64)| as_far_off(*own, channel[0], *promised);
        albedo.iter().zip(&target.channels).zip(self.answers.promised(cluster.index())).map(of).collect()
    }

    fn cluster(&self, site: &TexelSite) -> ClusterId {
        self.clusters[usize::from(site.page)].0[site.texel as usize]
    }
}

/// An albedo that is asked for, as near as `promised` is where that is far from it: what is a few percent off is made
/// up for, and what no stacking reaches is not striven for in one channel at the cost of another.
fn within_reach(asked: f64, promised: f64) -> f64 {
    if asked <= 0.0 || promised <= 0.0 {
        return asked.max(promised);
    }
    let off = libm::log(promised / asked);
    asked * libm::exp(off.signum() * (off.abs() - NEAR).max(0.0))
}

/// What `own` asks for among places whose mean `asked` for what [`within_reach`] of `promised` is: as far off as that,
/// but no farther than the promise, and not at all beyond it.
fn as_far_off(own: f64, asked: f64, promised: f64) -> f64 {
    if asked <= 0.0 {
        return own.max(promised);
    }
    let reached = within_reach(asked, promised);
    // No factor moves 0: black that is out of reach is asked for as it is promised.
    let moved = if own <= 0.0 && reached > asked { promised } else { own * reached / asked };
    if promised > asked { own.max(moved.min(promised)) } else { own.min(moved.max(promised)) }
}

fn points_of(sites: &[TexelSite], triangles: &[[DVec3; 3]]) -> Vec<PointOfSurface> {
    let point = |site: &TexelSite| {
        let corners @ [a, b, c] = &triangles[site.triangle as usize];
        let normal = (*b - *a).cross(*c - *a).normalize_or_zero();
        PointOfSurface { point: site.position(corners), normal, triangle: site.triangle }
    };
    sites.iter().map(point).collect()
}

/// From 0 to 1, as evenly spread among any neighbouring texels as can be: Roberts' additive recurrence in two
/// dimensions (*The unreasonable effectiveness of quasirandom sequences*, 2018).
fn threshold(texel: u32, width: u32) -> f64 {
    const PLASTIC: f64 = 1.324_717_957_244_746;
    let (x, y) = (f64::from(texel % width), f64::from(texel / width));
    (0.5 + x / PLASTIC + y / (PLASTIC * PLASTIC)).fract()
}

/// Distance of nodes for every triangle whose texels will not do; `None` for those whose texels are as fine as nodes
/// and lie on one place of the surface each. And the length of the texels of every page, mm.
/// Nodes are `node_mm` apart, or as near as the texels that they stand for.
fn node_spacing(mesh: &TriangleMesh, atlas: &Atlas, node_mm: f64) -> (Vec<Option<f64>>, Vec<f64>) {
    let sizes = TexelSizes::new(mesh, atlas);
    let texel_mm = sizes.length_mm();
    let TexelSizes { mm2, texels } = sizes;
    let of_page: Vec<Option<f64>> = (0..mm2.len())
        .map(|page| {
            let covered = atlas.pages()[page].covered().count() as f64;
            let coarse = mm2[page] / covered.max(1.0) > COARSE_MM * COARSE_MM;
            let repeats = !(texels[page] <= OVERLAP * covered);
            (coarse || repeats).then(|| texel_mm[page].clamp(FINEST_NODE_MM, node_mm))
        })
        .collect();
    (atlas.places().iter().map(|place| of_page[usize::from(place.page)]).collect(), texel_mm)
}

/// Length of the texels of every page, mm.
pub(super) fn texel_mm(mesh: &TriangleMesh, atlas: &Atlas) -> Vec<f64> {
    TexelSizes::new(mesh, atlas).length_mm()
}

/// How much surface the triangles of every page have, mm², and over how many texels.
struct TexelSizes {
    mm2: Vec<f64>,
    texels: Vec<f64>,
}

impl TexelSizes {
    fn new(mesh: &TriangleMesh, atlas: &Atlas) -> Self {
        let pages = atlas.pages().len();
        let mut sizes = Self { mm2: vec![0.0; pages], texels: vec![0.0; pages] };
        let areas = mesh.corners().map(|[a, b, c]| 0.5 * (b - a).cross(c - a).length());
        for ((area, uvs), place) in areas.zip(&mesh.uvs).zip(atlas.places()) {
            let page = usize::from(place.page);
            let size = f64::from(atlas.pages()[page].width) * f64::from(atlas.pages()[page].height);
            let [a, b, c] = uvs.map(|uv| uv.as_dvec2());
            sizes.mm2[page] += area;
            sizes.texels[page] += 0.5 * (b - a).perp_dot(c - a).abs() * size;
        }
        sizes
    }

    fn length_mm(&self) -> Vec<f64> {
        self.mm2.iter().zip(&self.texels).map(|(mm2, texels)| (mm2 / texels.max(f64::MIN_POSITIVE)).sqrt()).collect()
    }
}

impl Laid {
    /// What its labels beside the clusters' own stand for.
    pub(super) fn variants(&self, plan: &ObjectPlan, context: &TargetContext<'_>) -> Vec<VariantEntry> {
        let entry = |(question, answer): (&Question, &Answer)| VariantEntry {
            cluster: question.cluster,
            half_thickness_mm: question.half_mm,
            factor: (question.ln_albedo.iter().zip(plan.answers.promised(question.cluster)))
                .map(|(ln, promised)| rounded(libm::exp(*ln) / promised.max(BLACK)))
                .collect(),
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_near_is_asked_for_and_what_is_far_as_near_as_promised() {
        assert_eq!(within_reach(0.5, 0.505), 0.5);
        assert!((within_reach(0.5, 0.4) - 0.4 * NEAR.exp()).abs() < 1e-12);
        assert!((within_reach(0.03, 0.05) - 0.05 * (-NEAR).exp()).abs() < 1e-12);
    }

    /// A cluster of black, of which no resin is, holds texels that are not so black.
    #[test]
    fn nothing_lighter_than_the_promise_is_asked_for_where_black_is_out_of_reach() {
        for asked in [0.0, 1e-12, 1e-4, 0.02] {
            assert!(
                (as_far_off(0.03, asked, 0.05) - 0.05).abs() < 0.1 * 0.05,
                "{asked}: {}",
                as_far_off(0.03, asked, 0.05)
            );
            assert_eq!([0.06, 0.3].map(|own| as_far_off(own, asked, 0.05)), [0.06, 0.3], "{asked}");
        }
        // The other way round, of white.
        assert_eq!(as_far_off(0.8, 0.95, 0.82), 0.8);
        assert!((as_far_off(0.9, 0.95, 0.82) - 0.82).abs() < 1e-12);
        // Of black itself, out of reach and among places that are lighter.
        let black = [0.0, 1e-4, 0.02].map(|asked| as_far_off(0.0, asked, 0.05));
        assert_eq!((black, as_far_off(0.0, 0.5, 0.503)), ([0.05; 3], 0.0));
        // And where the promise is near, each is asked for as it is.
        assert_eq!([0.4, 0.5, 0.6].map(|own| as_far_off(own, 0.5, 0.503)), [0.4, 0.5, 0.6]);
    }
}
