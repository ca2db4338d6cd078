//! A map wrapped on an object of any shape: what its print shows, beside what the map's profiles show on the same
//! surface.
//!
//! Pictures are a camera's, under the four lamps of a look. What lies on the surface is spread by equation 7 over the
//! mesh ([`crate::job::look`]); what is printed goes through the voxels by the walker of every look. The 4D data and
//! the profiles of single texels know a flat patch only and are left out.

use std::path::Path;

use super::{CompareError, Comparison, Lamp, Stage};
use crate::{
    job::{
        Prepared,
        file::TargetSpec,
        look::{ObjectLight, PictureOptions, object_light, scene_for},
    },
    look::LAMPS,
    optics::{Model, predict},
    parallel,
    watch::{Unwatched, Watch},
};

/// What to compare on objects.
pub struct ObjectRequest<'a> {
    /// Folder that `lumislice factor` wrote.
    pub map: &'a Path,
    /// The job, all of its objects with that map for their target.
    pub prepared: &'a Prepared,
    /// A finished folder of the job, whose slices are looked at; `None`: the job's own voxels.
    pub folder: Option<&'a Path>,
    /// The camera, and how many photons go from it: samples of every pixel.
    pub pictures: PictureOptions,
}

/// Names for headings and for keys of JSON, in the order of a look's lamps.
const OBJECT_LAMPS: [(&str, &str); LAMPS] =
    [("sky", "sky"), ("shadow edge", "edge"), ("light from behind", "behind"), ("projected spot", "spot")];

/// Compares what a job's objects show.
///
/// # Errors
/// [`CompareError`]: objects of another target, a folder of another job, nothing that shows; a stop.
pub fn compare_object(request: &ObjectRequest<'_>, watch: &dyn Watch) -> Result<Comparison, CompareError> {
    let ObjectRequest { map, prepared, .. } = request;
    let same = |a: &Path, b: &Path| match (a.canonicalize(), b.canonicalize()) {
        (Ok(a), Ok(b)) => a == b,
        _ => a == b,
    };
    for (number, object) in (1..).zip(&prepared.job.objects) {
        let found = match &object.target {
            TargetSpec::Bssrdf { map: own, .. } if same(own.as_ref(), map) => continue,
            TargetSpec::Bssrdf { map: own, .. } => format!("object {number} with map {}", own.path.display()),
            _ => format!("object {number} with another kind of target"),
        };
        let folder = prepared.job.path.clone();
        return Err(CompareError::Folder {
            folder,
            found,
            expected: "objects of kind = \"bssrdf\" with the map given",
        });
    }
    let scene = scene_for(prepared, request.folder, watch)?;
    watch.stage("equation 7", 0);
    let predicted = promised(prepared)?;
    let light = object_light(prepared, &scene, &predicted, &request.pictures, watch)?;
    let light = light.ok_or_else(|| {
        let (folder, found) = (prepared.job.path.clone(), "nothing that shows".to_owned());
        CompareError::Folder { folder, found, expected: "objects that are printed" }
    })?;
    let (clustered, mut promised, mut printed) = stages(&light, prepared.materials.channels.len());
    promised.compare_with_goal(&clustered);
    printed.compare_with_goal(&clustered);
    printed.compare_with(&promised);
    let size = request.pictures.size;
    Ok(Comparison {
        name: prepared.job.name.clone(),
        width: size,
        height: size,
        pitch_mm: light.pixel_mm,
        channels: prepared.materials.channels.clone(),
        lights: OBJECT_LAMPS.iter().map(|(_, key)| *key).collect(),
        stages: vec![clustered, promised, printed],
        jobs: Vec::new(),
        warnings: Vec::new(),
        view_deg: Some(request.pictures.view_deg),
        lamps: OBJECT_LAMPS.iter().map(|&(name, key)| Lamp { name, key, irradiance: Vec::new() }).collect(),
        surface: Some(light.surface),
    })
}

/// Hankel transforms of what the transport model says of every cluster's stacking, by object, cluster and channel.
fn promised(prepared: &Prepared) -> Result<Vec<Vec<Vec<Vec<f64>>>>, CompareError> {
    let set = &prepared.materials;
    let of_stack = |stack: &_| -> Result<Vec<Vec<f64>>, CompareError> {
        let found = predict(set, &set.mixed_stack(stack)?, &Model::REFLECTION, &Unwatched)?;
        Ok(found.light.into_iter().map(|light| light.reflection_hankel).collect())
    };
    let of_object = |object: &crate::job::PreparedObject| {
        let stacks: Vec<_> = object.stackings.stacks().collect();
        parallel::map_all(&stacks, of_stack).into_iter().collect()
    };
    prepared.objects.iter().map(of_object).collect()
}

/// Mean and variance of every pixel.
type Image = (Vec<f32>, Vec<f32>);

/// Clustered, predicted and printed; pixels without a surface are 0 and do not count.
fn stages(light: &ObjectLight, channels: usize) -> (Stage, Stage, Stage) {
    let shown: Vec<bool> = light.surface.iter().map(Option::is_some).collect();
    let spread = |pixels: &[Option<Vec<[f32; LAMPS]>>]| -> Vec<Vec<Vec<f32>>> {
        let value = |channel: usize, lamp: usize| {
            pixels.iter().map(|pixel| pixel.as_ref().map_or(0.0, |spread| spread[channel][lamp])).collect()
        };
        (0..channels).map(|channel| (0..LAMPS).map(|lamp| value(channel, lamp)).collect()).collect()
    };
    let counted = |of: &dyn Fn(&Image) -> Vec<f32>| -> Vec<Vec<Vec<f32>>> {
        let masked = |image: &Image| {
            of(image).iter().zip(&shown).map(|(value, shown)| if *shown { *value } else { 0.0 }).collect()
        };
        light.printed.iter().map(|lamps| lamps.iter().map(masked).collect()).collect()
    };
    let seen = counted(&|(mean, _)| mean.clone());
    let noise = counted(&|(_, variance)| variance.iter().map(|variance| variance.sqrt()).collect());
    (
        Stage::new("clustered", 1.0, spread(&light.asked), None).only(&shown),
        Stage::new("predicted", 1.0, spread(&light.predicted), None).only(&shown),
        Stage::new("printed", 1.0, seen, Some(noise)).only(&shown),
    )
}
