//! A finished job in other formats, from its slices.
//!
//! Slices show support on the inside as background. Containers for printers want them so; for the others support is
//! found again as what no path leads to from the outside, and held against the manifest's count.

use std::{io::Cursor, ops::Range, path::Path};

use super::{
    RunError,
    containers::{Containers, write_texts},
    redraw::{RedrawError, check as check_lattice, list_written, reopened},
};
use crate::{
    blame::{Blame, Blamed, Remedy},
    container::{Content, SliceBatch, SliceImage, VolumeLayer, Voxels, bmp, gcvf},
    job::{Manifest, file::OutputFormat, look::LookError},
    look::Volume,
    output::{FileEntry, OutputError, OutputFolder},
    parallel,
    preview::{SliceColours, decode_slice},
    voxel::{BRICK, MaterialId},
    watch::Watch,
    words::dimensions,
};

/// Why a finished job is not converted.
#[derive(Debug, thiserror::Error)]
pub enum ConvertError {
    /// The folder cannot be read or written.
    #[error(transparent)]
    Folder(#[from] RedrawError),
    /// The job is none that the format holds.
    #[error("{}: found {found}, expected {expected}", folder.display())]
    Unfit {
        /// The folder.
        folder: std::path::PathBuf,
        /// What is in the way.
        found: String,
        /// What would do.
        expected: String,
    },
}

impl<E: Into<RunError>> From<E> for ConvertError {
    fn from(error: E) -> Self {
        Self::Folder(RedrawError::Run(error.into()))
    }
}

impl Blamed for ConvertError {
    fn blame(&self) -> Blame {
        match self {
            Self::Folder(error) => error.blame(),
            Self::Unfit { .. } => Blame::Input,
        }
    }

    fn remedy(&self) -> Option<Remedy> {
        None
    }
}

/// What was written.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Converted {
    /// Paths relative to the folder.
    pub files: Vec<String>,
    /// What the user should know.
    pub warnings: Vec<String>,
}

/// Longest image of a slice that is read, bytes.
const MAX_SLICE_BYTES: u64 = 1 << 30;

/// Writes the finished job in `folder` in `format` too, and lists the new files in its manifest.
///
/// # Errors
/// [`ConvertError`]: a folder that is no whole finished job with slices, a format that cannot hold it, before anything
/// is written.
pub fn convert(folder: &Path, format: OutputFormat, watch: &dyn Watch) -> Result<Converted, ConvertError> {
    let (mut manifest, output) = reopened(folder)?;
    check_lattice(&manifest)?;
    let source = Source { folder, manifest: &manifest, output: &output, content: manifest.content() };
    let images = source.images()?;
    let mut warnings = source.fits(format)?;
    source.write(format, &images, &mut warnings, watch)?;
    Ok(Converted { files: list_written(&output, &mut manifest)?, warnings })
}

/// A finished folder being read.
struct Source<'a> {
    folder: &'a Path,
    manifest: &'a Manifest,
    output: &'a OutputFolder,
    content: Content,
}

impl Source<'_> {
    fn unfit(&self, found: impl Into<String>, expected: impl Into<String>) -> ConvertError {
        ConvertError::Unfit { folder: self.folder.to_owned(), found: found.into(), expected: expected.into() }
    }

    /// The entries of all slices, in their order.
    fn images(&self) -> Result<Vec<&FileEntry>, ConvertError> {
        let slices = self.content.lattice.dims[2];
        let [first, end] = self.manifest.slices;
        if [first, end] != [0, slices] {
            return Err(self.unfit(format!("slices {first}..{end}"), format!("all {slices} of the job")));
        }
        let listed: std::collections::HashMap<&str, &FileEntry> =
            self.manifest.files.iter().map(|file| (file.path.as_str(), file)).collect();
        let entry = |k| listed.get(super::slice_path(k).as_str()).copied();
        (0..slices).map(entry).collect::<Option<_>>().ok_or_else(|| {
            self.unfit("a job without images of all its slices", "one that was made with format \"png\"")
        })
    }

    /// Refuses what `format` cannot hold; tells what software may refuse.
    fn fits(&self, format: OutputFormat) -> Result<Vec<String>, ConvertError> {
        if format.is_volume() && self.content.fractions {
            return Err(self.unfit(
                format!("a job of volumes = \"fractions\", and slices of printed voxels for {}", format.name()),
                format!(
                    "one of volumes = \"voxels\", or the job sliced again with \"{}\" among its formats",
                    format.name()
                ),
            ));
        }
        let counts = self.manifest.counts();
        let used: Vec<_> = self.content.occurring(&counts).map(|(resin, _)| resin.name.as_str()).collect();
        let many = |most: usize| {
            let found = format!("{} resins: {}", used.len(), used.join(", "));
            Err(self.unfit(found, format!("at most {most} for {}", format.name())))
        };
        let mut warnings = Vec::new();
        match format {
            OutputFormat::Gcvf => {
                let most = self.content.max_colors.unwrap_or(gcvf::MAX_COLORS).min(gcvf::MAX_COLORS);
                if used.len() > most {
                    return many(most);
                }
                match gcvf::fit(&self.content.lattice) {
                    Err(gcvf::Unfit::FewSlices(slices)) => {
                        let expected = format!("at least {} for gcvf", gcvf::MIN_SLICES);
                        return Err(self.unfit(format!("{slices} slices"), expected));
                    }
                    Err(gcvf::Unfit::Pitch) => {
                        let found = format!("voxels of {} mm", dimensions(self.content.lattice.pitch.to_array()));
                        return Err(self.unfit(found, "whole dots per inch and nanometres for gcvf"));
                    }
                    Ok(resolution) => warnings.extend(resolution.warning()),
                }
            }
            OutputFormat::Bmp if used.len() > bmp::MAX_MATERIALS => return many(bmp::MAX_MATERIALS),
            _ => {}
        }
        Ok(warnings)
    }

    fn write(
        &self,
        format: OutputFormat,
        images: &[&FileEntry],
        warnings: &mut Vec<String>,
        watch: &dyn Watch,
    ) -> Result<(), ConvertError> {
        let counts = self.manifest.counts();
        let materials: Vec<MaterialId> = self.content.occurring(&counts).map(|(resin, _)| resin.id).collect();
        let mut containers = Containers::open(self.output, self.content.clone(), &[format])?;
        watch.stage("slices", images.len() as u64);
        match self.hidden().filter(|_| format.is_volume()) {
            Some((support, voxels)) => {
                let volume = self.volume(images, support, watch)?;
                let found = volume.count(support);
                if found != voxels {
                    warnings.push(format!(
                        "support is background in slices, and was found again as what is enclosed: {found} voxels, the \
                         job laid {voxels}"
                    ));
                }
                for layer in 0..volume.lattice().dims[2].div_ceil(BRICK as u32) {
                    containers.take(&VolumeLayer { volume: &volume, layer }, &[], watch)?;
                }
            }
            None => self.for_each_batch(images, watch, |batch, images| {
                if format == OutputFormat::Bmp {
                    self.write_bitmaps(batch, &materials)?;
                }
                containers.take(batch, images, watch)
            })?,
        }
        let content = containers.finish(&counts, watch)?;
        Ok(write_texts(self.output, &content, &materials, &[format], &counts)?)
    }

    /// The resin that slices show as background, where the job laid any, and its voxels.
    fn hidden(&self) -> Option<(MaterialId, u64)> {
        let hidden = self.manifest.materials.iter().find(|material| material.rgba[3] == 0 && material.voxels > 0);
        hidden.map(|material| (MaterialId(material.id), material.voxels))
    }

    /// All voxels, with `support` where background is enclosed.
    fn volume(&self, images: &[&FileEntry], support: MaterialId, watch: &dyn Watch) -> Result<Volume, RunError> {
        let mut volume = Volume::new(self.content.lattice).map_err(LookError::from)?;
        self.for_each_batch(images, watch, |batch, _| {
            let slices = batch.first..batch.first + batch.images.len() as u32;
            volume.add_slices(slices, |j, k, row| batch.read_row(j, k, row));
            Ok(())
        })?;
        volume.fill_enclosed(support);
        Ok(volume)
    }

    /// Hands on eight slices at a time, with their images, bottom up.
    fn for_each_batch(
        &self,
        images: &[&FileEntry],
        watch: &dyn Watch,
        mut take: impl FnMut(&SliceBatch, &[SliceImage]) -> Result<(), RunError>,
    ) -> Result<(), RunError> {
        let lattice = self.content.lattice;
        let colours = SliceColours::new(self.content.resins.iter().map(|resin| (resin.rgba, resin.id.0)));
        for (first, entries) in (0..).step_by(BRICK).zip(images.chunks(BRICK)) {
            let read = |n: usize| {
                let entry = entries[n];
                let path = self.folder.join(&entry.path);
                let png = self.output.read(entry, MAX_SLICE_BYTES);
                let png = png.ok_or_else(|| OutputError::Changed { path: path.clone() })?;
                let ids = decode_slice(&path, Cursor::new(&png), &lattice, &colours)?;
                Ok::<_, RunError>((SliceImage { slice: first + n as u32, png }, ids))
            };
            // Gathered before the first error is looked for, so that it is always the same one.
            let read: Vec<Result<_, RunError>> = parallel::map(entries.len(), read);
            let read = read.into_iter().collect::<Result<Vec<_>, _>>()?;
            let (images, ids): (Vec<SliceImage>, Vec<Vec<u8>>) = read.into_iter().unzip();
            watch.go_on()?;
            take(&SliceBatch { lattice, first, images: ids }, &images)?;
            watch.advance(entries.len() as u64);
        }
        Ok(())
    }

    fn write_bitmaps(&self, batch: &SliceBatch, materials: &[MaterialId]) -> Result<(), RunError> {
        let slices: Range<u32> = batch.first..batch.first + batch.images.len() as u32;
        let write = |n: usize| {
            let (k, mut file) = (slices.start + n as u32, Vec::new());
            for (number, id) in (1..).zip(materials) {
                file.clear();
                let path = bmp::bitmap_path(number, k, batch.lattice.dims[2]);
                bmp::encode_bmp(batch, k, id.0, &mut file).map_err(|source| OutputError::Io {
                    action: "encoding",
                    path: self.folder.join(&path),
                    source,
                })?;
                self.output.write(&path, &file)?;
            }
            Ok(())
        };
        parallel::map(slices.len(), write).into_iter().collect()
    }
}
