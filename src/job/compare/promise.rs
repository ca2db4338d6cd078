//! What a job promises, and what its voxels do.

use serde::Serialize;

use super::{CompareError, CompareRequest, Comparison, Patch, Printed, Stage, printed::volume};
use crate::{
    look::{Pattern, Photons, Sides, TexelGrid, VoxelScene},
    optics::{ChannelId, Grains, Light, MaterialFile, MaterialSet, Mixture, Model, Stack, predict},
    watch::{StopOnly, Unwatched, Watch},
};

/// How well the stackings of a job fit the clusters they stand for. Objectives are the paper's, Σ (R̂ − R̂_t)² over
/// coefficients and channels, whatever the job itself minimised, so that jobs can be compared; a target is a cluster's
/// profile, scaled as its job scaled it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct JobFit {
    /// The job's name.
    pub name: String,
    /// By how much it scaled the target.
    pub scale: f64,
    /// By the transport model.
    pub transport: Spread,
    /// By Kubelka–Munk.
    pub kubelka_munk: Spread,
    /// Root mean square difference of the albedos, by the transport model, over all texels and channels.
    pub albedo_rms: f64,
}

/// An objective over the clusters.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct Spread {
    /// Mean over all texels.
    pub mean: f64,
    /// The cluster that is met worst.
    pub worst: f64,
}

/// A job, and the patch that it prints.
pub(super) struct Promise<'a> {
    pub patch: &'a Patch,
    pub file: &'a MaterialFile,
    /// What the file's resins are to Kubelka–Munk.
    pub set: &'a MaterialSet,
    pub job: &'a Printed,
    /// By how much the job scaled the target.
    pub scale: f64,
    /// Goes before the names of its stages.
    pub prefix: String,
}

/// Hankel transforms `[channel][cluster]`.
type Spectra = Vec<Vec<Vec<f64>>>;

impl Promise<'_> {
    /// Adds what the job promises, and what photons see of it.
    pub fn add_to(
        &self,
        comparison: &mut Comparison,
        request: &CompareRequest,
        watch: &dyn Watch,
    ) -> Result<(), CompareError> {
        let (prefix, scale) = (&self.prefix, self.scale);
        let goal = comparison.stages[0].rescaled(scale);
        let light = |spectra: &Spectra| spectra.iter().map(|spectra| self.patch.radiosity(spectra)).collect();
        let stacks = self.stacks()?;
        let (transport, scalar) = (self.by(&Model::REFLECTION, &stacks)?, self.by(&Model::KubelkaMunk, &stacks)?);
        comparison.jobs.push(self.fit(&transport, &scalar));
        let mut predicted = Stage::new(format!("{prefix}predicted"), scale, light(&transport), None);
        predicted.compare_with_goal(&goal);
        // In numbers only: what Kubelka–Munk gets wrong of thin layers.
        let scalar = Stage::new(format!("{prefix}predicted by Kubelka–Munk"), scale, light(&scalar), None);
        predicted.compare_with(&scalar);
        let printed = if request.photons == 0 { None } else { Some(self.printed(comparison, request, watch)?) };
        if let Some((seen, noise)) = printed {
            let mut printed = Stage::new(format!("{prefix}printed"), scale, seen, Some(noise));
            printed.compare_with_goal(&goal);
            printed.compare_with(&predicted);
            printed.compare_with(&scalar);
            comparison.stages.extend([predicted, printed]);
        } else {
            comparison.stages.push(predicted);
        }
        Ok(())
    }

    /// The stackings, one for every cluster, of resins with coefficients.
    fn stacks(&self) -> Result<Vec<Stack<String>>, CompareError> {
        let clusters = self.patch.map.profiles.len();
        let stacks = self.job.stacks()?;
        for stack in &stacks {
            for (name, _) in stack.pairs() {
                let parts = Mixture::parts_of_name(name).unwrap_or_default();
                parts.iter().try_for_each(|(resin, _)| volume(self.file, resin).map(drop))?;
            }
            stack.core.iter().try_for_each(|core| volume(self.file, core).map(drop))?;
        }
        if stacks.len() != clusters {
            let found = format!("{} stackings for {clusters} clusters", stacks.len());
            let (folder, expected) = (self.job.folder.clone(), "a job with kind = \"bssrdf\" and this map");
            return Err(CompareError::Folder { folder, found, expected });
        }
        Ok(stacks)
    }

    /// R̂ of every stacking by a model.
    fn by(&self, model: &Model, stacks: &[Stack<String>]) -> Result<Spectra, CompareError> {
        let grains = Grains::of_voxels(self.job.manifest.lattice.pitch_mm);
        let set = MaterialSet { grains, ..self.set.clone() };
        let mut spectra = vec![Vec::new(); set.channels.len()];
        for stack in stacks {
            let light = predict(&set, &set.mixed_stack(stack)?, model, &Unwatched)?.light;
            spectra.iter_mut().zip(light).for_each(|(spectra, light)| spectra.push(light.reflection_hankel));
        }
        Ok(spectra)
    }

    /// The stackings' spectra against the clusters', where a cluster is laid at all.
    fn fit(&self, transport: &Spectra, scalar: &Spectra) -> JobFit {
        let entries = self.job.manifest.stackings.first().map(|report| report.stackings.as_slice()).unwrap_or_default();
        let shares = || entries.iter().map(|entry| entry.share).enumerate().filter(|(_, share)| *share > 0.0);
        let over = |spectra: &Spectra, of: &dyn Fn(f64, f64, usize) -> f64| {
            let cluster = |cluster: usize| -> f64 {
                let channels = spectra.iter().zip(&self.patch.spectra[cluster]);
                let terms = channels.flat_map(|(found, target)| found[cluster].iter().zip(target).enumerate());
                terms.map(|(k, (found, target))| of(*found, self.scale * target, k)).sum()
            };
            shares().fold(Spread::default(), |spread, (index, share)| {
                let value = cluster(index);
                Spread { mean: spread.mean + share * value, worst: spread.worst.max(value) }
            })
        };
        let square = |found: f64, target: f64, _: usize| (found - target).powi(2);
        let albedo = |found: f64, target: f64, k: usize| if k == 0 { (found - target).powi(2) } else { 0.0 };
        JobFit {
            name: self.job.manifest.name.clone(),
            scale: self.scale,
            transport: over(transport, &square),
            kubelka_munk: over(scalar, &square),
            albedo_rms: (over(transport, &albedo).mean / transport.len() as f64).sqrt(),
        }
    }

    /// Radiosity by photons and one standard deviation of it, `[channel][light][texel]`.
    #[allow(clippy::type_complexity)] // named where they are used
    fn printed(
        &self,
        comparison: &Comparison,
        request: &CompareRequest,
        watch: &dyn Watch,
    ) -> Result<(Vec<Vec<Vec<f32>>>, Vec<Vec<Vec<f32>>>), CompareError> {
        let (channels, lamps) = (self.file.channels().len(), &comparison.lamps);
        let texels = TexelGrid {
            origin_mm: [0.0; 2],
            pitch_mm: [self.patch.map.pitch_mm; 2],
            dims: [comparison.width, comparison.height],
        };
        let from_top = |values: &[f64]| -> Vec<f32> {
            values.chunks(comparison.width).rev().flatten().map(|&value| value as f32).collect()
        };
        watch.stage("photons", (channels * lamps.len()) as u64);
        let (mut seen, mut noise) = (Vec::new(), Vec::new());
        for channel in 0..channels {
            let media = self.job.media(self.file, ChannelId(channel))?;
            let scene = VoxelScene::new(&self.job.grid, &media, Sides::Mirrored, None)?;
            let (mut by_lamp, mut noise_by_lamp) = (Vec::new(), Vec::new());
            for (index, lamp) in lamps.iter().enumerate() {
                let irradiance = lamp.irradiance.chunks(comparison.width).rev().flatten().copied().collect();
                let seed = request.seed.wrapping_add((channel * lamps.len() + index) as u64);
                let photons = Photons { light: Light::Diffuse, count: request.photons, seed };
                let image = scene.image(&Pattern::Image { texels, irradiance }, texels, photons, &StopOnly(watch))?;
                by_lamp.push(from_top(&image.radiosity));
                noise_by_lamp.push(from_top(&image.standard_error));
                watch.advance(1);
            }
            seen.push(by_lamp);
            noise.push(noise_by_lamp);
        }
        Ok((seen, noise))
    }
}
