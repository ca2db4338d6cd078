//! A finished folder without its job: what its slices show, with what else lies in it.
//!
//! | what | where from |
//! | --- | --- |
//! | voxels | the slices, as for a folder with its job |
//! | resins | the manifest's names, in its material set or in a file that is given |
//! | spots | those of `look.json`, with what was asked for and predicted there; without one, where lines at random meet the voxels |
//! | the surface | the voxels ([`crate::look::Scene::normal_near`]), for no mesh is there: nothing is mirrored or bent |
//!
//! Targets between those spots are not known, so pictures show the print alone.

use std::path::{Path, PathBuf};

use glam::DVec3;

use super::{
    About, Goal, LOOK, LOOK_VERSION, Look, LookError, LookOptions, PictureOptions, SpotRecord, finished_manifest,
    look_at_spots,
    mitsuba::{Print, write_scenes},
    pictures,
    surface::{Expected, SPOT_RADIUS_MM, SurfaceSpot, spot_around},
    voxels::read_slices,
};
use crate::{
    job::Manifest,
    look::{Scene, Site},
    optics::{MaterialFile, VolumeCoefficients},
    output::Existing,
    regular_file,
    voxel::MaterialId,
    watch::Watch,
};

/// What is printed by a finished job, of which nothing but its folder is at hand.
pub struct FinishedFolder {
    manifest: Manifest,
    channels: Vec<String>,
    coefficients: Vec<Vec<VolumeCoefficients>>,
    scene: Scene,
    recorded: Vec<SpotRecord>,
    warnings: Vec<String>,
}

/// How far above a spot's plane a line looks for the surface beside its middle, mm.
const ABOVE_MM: f64 = 0.5;

impl FinishedFolder {
    /// Reads the voxels of a folder; `materials` has the resins where they are of no built-in set. Opens a stage of
    /// slices.
    ///
    /// # Errors
    /// [`LookError`]: a folder without manifest or with damaged slices, resins without coefficients.
    pub fn read(folder: &Path, materials: Option<&MaterialFile>, watch: &dyn Watch) -> Result<Self, LookError> {
        let manifest = finished_manifest(folder)?;
        let materials = match materials {
            Some(file) => file.clone(),
            None => MaterialFile::builtin(&manifest.material_set.name)?,
        };
        let channels = materials.channels().to_vec();
        let mut coefficients = vec![vec![VolumeCoefficients::new(0.0, 0.0, 0.0)?]; channels.len()];
        let mut bends = false;
        for (number, material) in (1..).zip(&manifest.materials) {
            if material.id != number {
                let found = format!("resin {} as number {}", material.name, material.id);
                return Err(LookError::folder(folder, found, "resins in their order"));
            }
            let volume = materials.volume(&material.name).ok_or_else(|| {
                let found = format!("resin {} without coefficients in set {}", material.name, materials.name());
                LookError::folder(folder, found, "resins known by their coefficients")
            })?;
            bends |= volume.iter().any(|volume| volume.refractive_index != 1.0);
            coefficients.iter_mut().zip(volume).for_each(|(channel, volume)| channel.push(*volume));
        }
        let support =
            manifest.materials.iter().find(|material| material.rgba[3] == 0).map(|found| MaterialId(found.id));
        let volume = read_slices(folder, &manifest, &from_top(&manifest), support, watch)?;
        let scene = Scene::new(volume, &coefficients)?;
        let recorded = recorded(folder, channels.len());
        let mut warnings = vec![match recorded.len() {
            0 => "the job is not at hand, nor a look.json: what was asked for and predicted is not known".to_owned(),
            spots => format!(
                "the job is not at hand: what was asked for and predicted is known at the {spots} spots of look.json only"
            ),
        }];
        if !from_top(&manifest).is_empty() {
            warnings.push(
                "what is layered from its top stands free here, and its sides let light in: with its job at hand a box \
                 counts as a piece of a larger one"
                    .to_owned(),
            );
        }
        if bends {
            warnings.push("without the meshes' surfaces refractive indices are left out".to_owned());
        }
        Ok(Self { manifest, channels, coefficients, scene, recorded, warnings })
    }

    /// What light goes through.
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// Looks at it: at up to `options.spots` spots of its `look.json`, or of its voxels' surface where there is none.
    ///
    /// # Errors
    /// [`LookError::Stopped`].
    pub fn look(&self, options: &LookOptions, watch: &dyn Watch) -> Result<Look, LookError> {
        let mut goals: Vec<Goal> =
            self.recorded.iter().take(options.spots).filter_map(|spot| self.again(spot)).collect();
        if self.recorded.is_empty() {
            let sites = self.scene.random_sites(options.spots, options.seed);
            goals.extend(sites.into_iter().filter_map(|site| self.unknown(site)));
        }
        let named = options.at.iter().filter_map(|at| self.unknown(self.scene.site_near(*at)?));
        goals.extend(named);
        watch.go_on()?;
        let about = About { job: &self.manifest.name, channels: &self.channels, warnings: self.warnings.clone() };
        let mut look = look_at_spots(about, &self.scene, &goals, options, watch)?;
        let pictures = options.pictures.map(|options| pictures::pictures(None, &self.scene, &options, watch));
        look.pictures = pictures.transpose()?.unwrap_or_default();
        Ok(look)
    }

    /// Writes the scenes for Mitsuba, see [`super::write_mitsuba`].
    ///
    /// # Errors
    /// As there.
    pub fn write_mitsuba(
        &self,
        options: &PictureOptions,
        folder: &Path,
        existing: Existing,
        inputs: &[PathBuf],
        watch: &dyn Watch,
    ) -> Result<(), LookError> {
        let print = Print { scene: &self.scene, channels: &self.channels, coefficients: &self.coefficients };
        write_scenes(&print, inputs, options, folder, existing, watch)
    }

    /// A spot of an earlier look, with what was expected there.
    fn again(&self, spot: &SpotRecord) -> Option<Goal> {
        let middle = Site { point: spot.position_mm.into(), normal: DVec3::from(spot.normal).try_normalize()? };
        let expected = Expected { asked: spot.asked.clone(), predicted: spot.predicted.clone() };
        Some(Goal { spot: self.around(spot.object, middle)?, expected, edge: None })
    }

    /// A spot of which nothing is known but where it is.
    fn unknown(&self, middle: Site) -> Option<Goal> {
        Some(Goal { spot: self.around(0, middle)?, expected: Expected::default(), edge: None })
    }

    fn around(&self, object: usize, middle: Site) -> Option<SurfaceSpot> {
        let beside = |aside: DVec3| self.scene.site_along(aside + middle.normal * ABOVE_MM, -middle.normal);
        spot_around(&self.scene, object, middle, SPOT_RADIUS_MM, beside)
    }
}

/// The spots of the folder's `look.json`; none where there is none, or one of another form.
fn recorded(folder: &Path, channels: usize) -> Vec<SpotRecord> {
    let text = regular_file::read(&folder.join(LOOK), regular_file::MAX_TEXT).unwrap_or_default();
    let look = serde_json::from_slice::<Look>(&text).ok().filter(|look| look.version == LOOK_VERSION);
    let finite = |numbers: &[f64]| numbers.iter().all(|number| number.is_finite());
    let sound = |spot: &SpotRecord| {
        let albedos = [Some(&spot.predicted), spot.asked.as_ref()];
        finite(&spot.position_mm)
            && finite(&spot.normal)
            && albedos.iter().flatten().all(|albedos| finite(albedos) && [0, channels].contains(&albedos.len()))
    };
    look.map_or_else(Vec::new, |look| look.spots.into_iter().filter(sound).collect())
}

/// Boxes of the objects whose depth is measured from the top, mm.
fn from_top(manifest: &Manifest) -> Vec<[DVec3; 2]> {
    let objects = manifest.objects.iter().enumerate();
    let is_from_top = |number: usize| manifest.job["object"][number]["depth-from"] == "top";
    objects.filter(|(number, _)| is_from_top(*number)).map(|(_, object)| object.bounds_mm.map(DVec3::from)).collect()
}
