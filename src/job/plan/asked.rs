//! What an object asks for, before any search: targets, and where on its surface each is wanted.

use super::{
    appearance::Appearance, context::TargetContext, factored::FactoredMap, images::read_labels, on_surface::texel_mm,
};
use crate::{
    appearance::{
        self, AppearancePage, Atlas, ClusterId, LabelMap, LocalProfiles, NormalizedDiffusion, TexelRings, cluster,
        distinct_appearances,
    },
    job::{
        RunError,
        file::{InputPath, TargetSpec},
    },
    mesh::TriangleMesh,
    optics::{FrequencyGrid, ProfileFile},
    search::SearchTarget,
};

/// Texels of a sheet whose light goes from one to the other, mm.
const FINEST_TEXEL_MM: f64 = 0.01;
const COARSEST_TEXEL_MM: f64 = 10.0;
/// And pairs of them, some seconds of work.
const MOST_PAIRS: f64 = 2e10;

/// What an object asks for, before any search.
pub(super) struct Wanted {
    pub kind: &'static str,
    pub targets: Vec<SearchTarget>,
    /// Share of the surface that wants each.
    pub shares: Vec<f64>,
    /// How far the spectra of each cluster are from their mean; `None` where nothing was clustered.
    pub rms: Vec<Option<f64>>,
    pub surface: Surface,
    pub map: AskedMap,
}

/// What every texel asks for by itself, before anything was clustered; of nothing where targets say it all.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct AskedMap {
    /// Index of the appearance of every texel of all pages.
    of_texel: Vec<u32>,
    appearances: Vec<Asked>,
    /// What every texel is to show under even light over its label's albedo, by channel; none where that is 1.
    shown: Vec<Vec<f32>>,
    /// The target of every label.
    pub(in crate::job) targets: Vec<SearchTarget>,
}

/// What is asked for somewhere.
#[derive(Debug, Clone, PartialEq)]
pub struct Asked {
    /// Albedo per channel, 0 to 1.
    pub albedo: Vec<f64>,
    /// Mean free path, mm: one for all channels, or one for each.
    pub mean_free_path_mm: Vec<f64>,
}

impl AskedMap {
    /// Texels of all pages.
    pub fn texels(&self) -> usize {
        self.of_texel.len()
    }

    /// What a texel asks for, counted through all pages.
    pub fn of(&self, texel: usize) -> Option<&Asked> {
        self.appearances.get(*self.of_texel.get(texel)? as usize)
    }
}

impl AskedMap {
    /// Logarithms of the factors that a texel's own albedos are of those of its cluster, by channel, where albedos
    /// below `black` count as that; none where the cluster's is all that is asked for.
    pub(super) fn ln_own(&self, texel: usize, cluster: ClusterId, black: f64) -> Vec<f64> {
        let (Some(own), Some(target)) = (self.of(texel), self.targets.get(cluster.index())) else { return Vec::new() };
        let of_cluster = target.channels.iter().map(|channel| channel.first().copied().unwrap_or(0.0));
        own.albedo.iter().zip(of_cluster).map(|(own, of)| libm::log(own.max(black) / of.max(black))).collect()
    }

    /// What texel is to show under even light where its label asks for an `albedo` by channel: light comes from its
    /// neighbours too, whose labels may differ, where profiles are what was measured.
    pub fn shown(&self, texel: usize, albedo: &[f64]) -> Vec<f64> {
        let ratio = |channel: usize| self.shown.get(channel).and_then(|ratios| ratios.get(texel)).copied();
        albedo.iter().enumerate().map(|(channel, albedo)| albedo * f64::from(ratio(channel).unwrap_or(1.0))).collect()
    }

    /// Whether it is known what texels show beside each other.
    pub(super) fn is_shown(&self) -> bool {
        !self.shown.is_empty()
    }

    /// Has texels, whose `labels` have the profiles of the targets over `grid`, show what equation 7 of Hašan et al.
    /// 2010 says of a flat sheet. Nothing is said of a texture that is not one sheet, its top, from edge to edge, or
    /// has so many texels in reach of each other that it would take minutes.
    pub(super) fn show_by_equation_7(
        &mut self,
        atlas: &Atlas,
        labels: &[LabelMap],
        mesh: &TriangleMesh,
        grid: &FrequencyGrid,
    ) {
        let ([page], [labels]) = (atlas.pages(), labels) else { return };
        let (width, pitch_mm) = (page.width as usize, texel_mm(mesh, atlas)[0]);
        let is_sheet =
            page.covered().count() == labels.0.len() && page.chart.iter().all(|chart| *chart == page.chart[0]);
        if !is_sheet || !(FINEST_TEXEL_MM..=COARSEST_TEXEL_MM).contains(&pitch_mm) {
            return;
        }
        let channels = self.targets.first().map_or(0, |target| target.channels.len());
        let rings = TexelRings::holding(pitch_mm, self.targets.iter().flat_map(|target| &target.channels), grid);
        if rings.texels() as f64 * labels.0.len() as f64 * channels as f64 > MOST_PAIRS {
            return;
        }
        let of_texel: Vec<u32> = labels.0.iter().map(|label| u32::from(label.0)).collect();
        let even = vec![1.0; of_texel.len()];
        let shown = |channel: usize| -> Vec<f32> {
            let spectra: Vec<_> = self.targets.iter().map(|target| target.channels[channel].clone()).collect();
            let profiles = LocalProfiles::from_spectra(&rings, &spectra, grid, of_texel.clone(), width);
            let mut shown = profiles.radiosity(std::slice::from_ref(&even)).remove(0);
            for (shown, label) in shown.iter_mut().zip(&of_texel) {
                let albedo = spectra[*label as usize][0] as f32;
                *shown = if albedo > 0.0 { *shown / albedo } else { 1.0 };
            }
            shown
        };
        self.shown = (0..channels).map(shown).collect();
    }

    /// Makes room for `texels` texels in all, those that are new asking for what the first does.
    pub(super) fn extend(&mut self, texels: usize) {
        self.shown.iter_mut().for_each(|shown| shown.resize(texels, 1.0));
        if !self.of_texel.is_empty() {
            self.of_texel.resize(texels, self.of_texel[0]);
        }
    }

    /// Has texel `to` ask for what texel `from` does.
    pub(super) fn copy(&mut self, from: usize, to: usize) {
        if let Some(&appearance) = self.of_texel.get(from) {
            self.of_texel[to] = appearance;
        }
        self.shown.iter_mut().for_each(|shown| shown[to] = shown[from]);
    }
}

/// Where which target is wanted.
pub(super) enum Surface {
    Uniform,
    Labelled { atlas: Atlas, labels: Vec<LabelMap> },
}

/// What `target` asks for; nothing where it gives a stacking.
pub(super) fn wanted(
    context: &TargetContext<'_>,
    target: &TargetSpec,
    warnings: &mut Vec<String>,
) -> Result<Wanted, RunError> {
    match target {
        TargetSpec::Stacking { .. } => Ok(Wanted {
            kind: "stacking",
            targets: Vec::new(),
            shares: Vec::new(),
            rms: Vec::new(),
            surface: Surface::Uniform,
            map: AskedMap::default(),
        }),
        TargetSpec::Profile { paths } => Ok(Wanted {
            kind: "profile",
            targets: vec![context.profile_target("target.profile", paths)?],
            shares: vec![1.0],
            rms: vec![None],
            surface: Surface::Uniform,
            map: AskedMap::default(),
        }),
        TargetSpec::Clusters { labels, profiles } => {
            let (width, height, labels_of) =
                read_labels(labels.as_ref()).map_err(|error| context.job.image_fault("target.labels", error))?;
            if let Some(odd) = labels_of.iter().find(|label| label.index() >= profiles.len()) {
                return Err(RunError::Texture {
                    path: labels.path.clone(),
                    found: format!("label {} with {} profiles", odd.0, profiles.len()),
                    expected: "labels from 0 to one less than the number of profiles",
                });
            }
            context.require_uvs("target.labels")?;
            let targets = profiles.iter().map(|paths| context.profile_target("target.profiles", paths));
            let targets = targets.collect::<Result<Vec<_>, _>>()?;
            Ok(labelled(context, "clusters", (width, height), labels_of, targets, None))
        }
        TargetSpec::Texture(texture) => {
            let appearance = context.appearance(texture, warnings)?;
            if appearance.loses_colour {
                warnings.push(format!(
                    "object {}: colours are asked for, and the resins ({}) have one channel: only lightness is matched. \
                     Resins with three channels, such as set = \"inks-rgb-7\", print colours",
                    context.object + 1,
                    context.materials.name
                ));
            }
            texture_wanted(context, appearance, texture.max_albedo, warnings)
        }
        TargetSpec::Bssrdf { map, max_albedo } => {
            context.require_uvs("target.map")?;
            let map = FactoredMap::read(map.as_ref())?;
            let channels = &context.materials.channels;
            let targets = map.spectra(channels, &context.materials.grid)?;
            let targets = targets.into_iter().map(|channels| SearchTarget { channels }).collect();
            Ok(labelled(context, "bssrdf", (map.width, map.height), map.labels, targets, *max_albedo))
        }
    }
}

/// `targets`, wanted where `labels` name them; `max_albedo` rescales them all as [`rescale`] says.
fn labelled(
    context: &TargetContext<'_>,
    kind: &'static str,
    size: (u32, u32),
    labels: Vec<ClusterId>,
    mut targets: Vec<SearchTarget>,
    max_albedo: Option<f64>,
) -> Wanted {
    let atlas = Atlas::new(&context.solid.mesh, &[size], &[]);
    let mut areas = vec![0.0; targets.len()];
    let area_of = &atlas.areas(&context.solid.mesh)[0];
    for texel in atlas.pages()[0].covered() {
        areas[labels[texel].index()] += area_of[texel];
    }
    if let Some(most) = max_albedo {
        rescale(&mut targets, &areas, most);
    }
    let total: f64 = areas.iter().sum();
    Wanted {
        kind,
        shares: areas.iter().map(|area| area / total.max(f64::MIN_POSITIVE)).collect(),
        rms: vec![None; targets.len()],
        targets,
        surface: Surface::Labelled { atlas, labels: vec![LabelMap(labels)] },
        map: AskedMap::default(),
    }
}

/// Scales all profiles by one factor, so that the largest albedo of any that is laid somewhere becomes `most`.
fn rescale(targets: &mut [SearchTarget], areas: &[f64], most: f64) {
    let laid = targets.iter().zip(areas).filter(|(_, area)| **area > 0.0);
    let brightest = laid.flat_map(|(target, _)| &target.channels).map(|spectrum| spectrum[0]).fold(0.0, f64::max);
    let scale = most / brightest.max(f64::MIN_POSITIVE);
    for spectrum in targets.iter_mut().flat_map(|target| &mut target.channels) {
        spectrum.iter_mut().for_each(|value| *value *= scale);
    }
}

fn texture_wanted(
    context: &TargetContext<'_>,
    appearance: Appearance,
    max_albedo: Option<f64>,
    warnings: &mut Vec<String>,
) -> Result<Wanted, RunError> {
    let channels = context.materials.channels.len();
    let unit_mm = &appearance.unit_mm;
    context.watch.stage("clusters", 0);
    let sizes: Vec<_> = appearance.pages.iter().map(|page| (page.width, page.height)).collect();
    let atlas = Atlas::new(&context.solid.mesh, &sizes, &appearance.page_of);
    let scale =
        max_albedo.map_or(1.0, |most| most / brightest(&atlas, &appearance.pages, channels).max(f64::MIN_POSITIVE));
    let areas = atlas.areas(&context.solid.mesh);
    let appearances = distinct_appearances(&atlas, &appearance.pages, &areas, channels, scale);
    let coefficients = context.materials.grid.len();
    let mut spectra = Vec::with_capacity(appearances.distinct.len() * channels * coefficients);
    for appearance in &appearances.distinct {
        for (channel, &albedo) in appearance.albedo.iter().enumerate() {
            let path = channel.min(unit_mm.len() - 1);
            let model = NormalizedDiffusion::new(albedo, appearance.mean_free_path[path] * unit_mm[path])
                .map_err(|error| context.refuse("target", error, "an albedo and a mean free path"))?;
            spectra.extend(model.spectrum(&context.materials.grid));
        }
    }
    let weights: Vec<_> = appearances.distinct.iter().map(|appearance| appearance.area_mm2).collect();
    let options = appearance::ClusterOptions {
        k: context.job.clusters.k,
        seed: context.job.clusters.seed,
        coefficients,
        objective: context.job.stacking.objective,
        ..Default::default()
    };
    let clusters = cluster(&spectra, &weights, &options)
        .map_err(|error| context.refuse("clusters", error, "profiles that can be grouped"))?;
    context.watch.go_on()?;
    let count = clusters.centroids.len();
    // As many clusters as appearances lack nothing.
    if count < clusters.requested.min(appearances.distinct.len()) {
        warnings.push(format!(
            "object {}: its {} distinct appearances make {count} clusters, not the {} asked for",
            context.object + 1,
            appearances.distinct.len(),
            clusters.requested,
        ));
    }
    let target =
        |centroid: &Vec<f64>| SearchTarget { channels: centroid.chunks(coefficients).map(<[f64]>::to_vec).collect() };
    let total: f64 = weights.iter().sum();
    let rms = |fit: &appearance::ClusterFit| Some(fit.rms / ((channels * coefficients) as f64).sqrt());
    let label = |&appearance: &u32| clusters.labels[appearance as usize];
    let labels = appearances.index.iter().map(|page| LabelMap(page.iter().map(label).collect())).collect();
    let texels = atlas.pages().iter().zip(&appearances.index);
    let map = AskedMap {
        targets: Vec::new(),
        shown: Vec::new(),
        of_texel: texels.flat_map(|(page, index)| page.source.iter().map(|&source| index[source as usize])).collect(),
        appearances: appearances
            .distinct
            .into_iter()
            .map(|it| Asked {
                mean_free_path_mm: it.mean_free_path.iter().zip(unit_mm).map(|(path, unit)| path * unit).collect(),
                albedo: it.albedo,
            })
            .collect(),
    };
    Ok(Wanted {
        kind: "texture",
        targets: clusters.centroids.iter().map(target).collect(),
        shares: clusters.fits.iter().map(|fit| fit.weight / total).collect(),
        rms: clusters.fits.iter().map(rms).collect(),
        surface: Surface::Labelled { atlas, labels },
        map,
    })
}

/// The largest albedo of any covered texel and channel.
fn brightest(atlas: &Atlas, pages: &[AppearancePage], channels: usize) -> f64 {
    let texels = atlas.pages().iter().zip(pages).flat_map(|(map, page)| {
        map.covered().flat_map(move |texel| &page.albedo[texel * channels..(texel + 1) * channels])
    });
    f64::from(texels.copied().fold(0.0, f32::max))
}

impl TargetContext<'_> {
    pub(super) fn require_uvs(&self, key: &str) -> Result<(), RunError> {
        if !self.has_uvs {
            let mesh = self.job.objects[self.object].mesh.shown();
            return Err(self.refuse(key, format!("{mesh} without texture coordinates"), "a mesh that has them"));
        }
        Ok(())
    }

    fn profile_target(&self, key: &str, paths: &[InputPath]) -> Result<SearchTarget, RunError> {
        let channels = self.materials.channels.len();
        if paths.len() != 1 && paths.len() != channels {
            let expected = format!("one path, or one for each of {channels} channels");
            return Err(self.refuse(key, format!("{} paths", paths.len()), &expected));
        }
        let spectrum = |path: &InputPath| -> Result<Vec<f64>, RunError> {
            let Some(reflection) = ProfileFile::read(path.as_ref())?.reflection else {
                let found = format!("{} without reflection_per_mm2", path.path.display());
                return Err(self.refuse(key, found, "a profile with a column of reflection"));
            };
            Ok(reflection.hankel(&self.materials.grid).values)
        };
        let spectra = paths.iter().map(spectrum).collect::<Result<Vec<_>, _>>()?;
        Ok(SearchTarget { channels: (0..channels).map(|c| spectra[c.min(spectra.len() - 1)].clone()).collect() })
    }
}

#[cfg(test)]
mod tests {
    use glam::{DVec3, Vec2};

    use super::*;

    /// A rectangle from the origin to `size`, under the texture from `from` to `to` in both directions.
    fn sheet(size: DVec3, [from, to]: [f32; 2]) -> TriangleMesh {
        let [a, b, c, d] = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
        let uv = |at: [f64; 2]| Vec2::new(from, from) + (to - from) * Vec2::new(at[0] as f32, at[1] as f32);
        TriangleMesh {
            positions: [a, b, c, d].map(|[x, y]| size * DVec3::new(x, y, 0.0)).to_vec(),
            triangles: vec![[0, 1, 2], [0, 2, 3]],
            uvs: vec![[a, b, c].map(uv), [a, c, d].map(uv)],
            ..TriangleMesh::default()
        }
    }

    /// Across a border of two halves light goes over; far from it each shows its own albedo.
    #[test]
    fn neighbours_share_their_light() {
        let grid = FrequencyGrid::default();
        let target = |albedo: f64| {
            let spectrum = NormalizedDiffusion::new(albedo, 0.3).unwrap().spectrum(&grid);
            SearchTarget { channels: vec![spectrum] }
        };
        let (width, albedo) = (60, [0.6, 0.1]);
        let mut map = AskedMap { targets: albedo.map(target).to_vec(), ..AskedMap::default() };
        let labels: Vec<_> = (0..width * 20).map(|texel| ClusterId(u16::from(texel % width >= 30))).collect();
        let labels = [LabelMap(labels)];
        let size = (width as u32, 20);
        let mesh = sheet(DVec3::new(12.0, 4.0, 0.0), [0.0, 1.0]);
        map.show_by_equation_7(&Atlas::new(&mesh, &[size], &[]), &labels, &mesh, &grid);
        let shown = |x: usize, side: usize| map.shown(x + 10 * width, &albedo[side..=side])[0] / albedo[side];
        assert!((shown(0, 0) - 1.0).abs() < 0.01 && (shown(59, 1) - 1.0).abs() < 0.02);
        assert!(shown(29, 0) < 0.9 && shown(30, 1) > 1.1, "{} {}", shown(29, 0), shown(30, 1));
        // Half of the texture belongs to nothing, or all of it lies in one point.
        for uvs in [[0.0, 0.5], [0.3, 0.3]] {
            let mesh = sheet(DVec3::new(12.0, 4.0, 0.0), uvs);
            let mut map = AskedMap { targets: map.targets.clone(), ..AskedMap::default() };
            map.show_by_equation_7(&Atlas::new(&mesh, &[size], &[]), &labels, &mesh, &grid);
            assert!(!map.is_shown() && map.shown(7, &[0.2]) == [0.2]);
        }
        // Where nothing is known of neighbours an albedo is what it is.
        assert_eq!(AskedMap::default().shown(3, &[0.2, 0.4]), [0.2, 0.4]);
    }
}
