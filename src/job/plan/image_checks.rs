//! What is wrong with the images of a job, told by their headers before anything slow: files that are no images, numbers
//! of another kind than their key takes, and sizes that do not go together.

use super::images::{Coding, Picture, picture_size, read_picture};
use crate::{
    job::{
        Job, RunError,
        file::{AlbedoSource, InputPath, TargetSpec},
    },
    words::counted,
};

/// Keys of the images of a texture.
pub(super) const ALBEDO: &str = "target.albedo";
pub(super) const PATH: &str = "target.mean-free-path";

impl Job {
    /// An error of an image as one of the key that names it.
    pub(super) fn image_fault(&self, key: &str, error: RunError) -> RunError {
        match error {
            RunError::Texture { path, found, expected } => {
                self.refuse(key, format!("{}: {found}", path.display()), expected).into()
            }
            other => other,
        }
    }

    /// Reads the image of `key`; what no one sees of it is told in `warnings`.
    pub(super) fn picture(&self, key: &str, path: &InputPath, warnings: &mut Vec<String>) -> Result<Picture, RunError> {
        let picture = read_picture(path.as_ref()).map_err(|error| self.image_fault(key, error))?;
        let name = path.shown();
        let texels = u64::from(picture.width) * u64::from(picture.height);
        match picture.unseen {
            0 => {}
            all if all as u64 == texels => {
                tell(warnings, format!("{key}: {name} is wholly transparent; its values are taken all the same"))
            }
            some => tell(
                warnings,
                format!(
                    "{key}: {} of {name} {} wholly transparent: they take the values of the nearest texel left",
                    counted(some, "texel"),
                    if some == 1 { "is" } else { "are" }
                ),
            ),
        }
        Ok(picture)
    }
}

/// Tells what was not told before, of another object of the same target.
pub(super) fn tell(warnings: &mut Vec<String>, words: String) {
    if !warnings.contains(&words) {
        warnings.push(words);
    }
}

/// Looks at the headers of all images of `job`.
///
/// # Errors
/// A file that is no image, or too large a one.
pub(super) fn images(job: &Job, warnings: &mut Vec<String>) -> Result<(), RunError> {
    for object in &job.objects {
        let (albedo, path) = match &object.target {
            TargetSpec::Texture(texture) => match &texture.albedo {
                AlbedoSource::Texture(albedo) => (Some(albedo), texture.mean_free_path.as_ref()),
                _ => (None, texture.mean_free_path.as_ref()),
            },
            TargetSpec::Clusters { labels, .. } => {
                picture_size(labels.as_ref()).map_err(|error| job.image_fault("target.labels", error))?;
                continue;
            }
            _ => continue,
        };
        let size =
            |key: &str, path: &InputPath| picture_size(path.as_ref()).map_err(|error| job.image_fault(key, error));
        let albedo_size = albedo.map(|albedo| size(ALBEDO, albedo)).transpose()?;
        let path_size = path.map(|path| size(PATH, path)).transpose()?;
        if let Some(albedo) = albedo {
            let coding = Coding::of(albedo.as_ref());
            let taken = match coding {
                Coding::Profile => Some("expected sRGB, which it is taken for"),
                Coding::Gamma(_) => Some("in place of sRGB: they are read as marked"),
                Coding::Srgb | Coding::Unsaid => None,
            };
            if let Some(taken) = taken {
                tell(warnings, format!("{ALBEDO}: {}: found {}, {taken}", albedo.shown(), coding.words()));
            }
        }
        if let Some(path) = path {
            let coding = Coding::of(path.as_ref());
            if !coding.may_be_linear() {
                tell(
                    warnings,
                    format!(
                        "{PATH}: {}: found {}, expected linear factors, which they are taken for; save it without that \
                         mark, or its numbers as linear ones",
                        path.shown(),
                        coding.words()
                    ),
                );
            }
        }
        for (key, key_of_one, image, size) in
            [(ALBEDO, "albedo-colour", albedo, albedo_size), (PATH, "mean-free-path-mm", path, path_size)]
        {
            if let (Some(image), Some((1, 1))) = (image, size) {
                tell(
                    warnings,
                    format!(
                        "{key}: {}: found 1 × 1 texels, expected a texture: it is the same everywhere, which {key_of_one} \
                         says too",
                        image.shown()
                    ),
                );
            }
        }
        if let (Some((albedo, (aw, ah))), Some((path, (pw, ph)))) = (albedo.zip(albedo_size), path.zip(path_size))
            && [(aw, ah), (pw, ph)].iter().all(|size| *size != (1, 1))
            && u64::from(aw) * u64::from(ph) != u64::from(pw) * u64::from(ah)
        {
            tell(
                warnings,
                format!(
                    "{PATH}: {}: found {pw} × {ph} texels, expected the proportions of {}, {aw} × {ah}: both are \
                     stretched over the same texture coordinates",
                    path.shown(),
                    albedo.shown()
                ),
            );
        }
    }
    Ok(())
}
