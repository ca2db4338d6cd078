//! The files of a job that hold all of it: opened before its first slice, fed slab after slab, put in their places when
//! all is done.

use std::{collections::BTreeSet, io};

use super::RunError;
use crate::{
    container::{
        Container, ContainerError, Content, ContentResin, Counts, SliceImage, Voxels, bmp,
        gcvf::{Gcvf, Resolution},
        mapping_text,
        nrrd::{self, Nrrd},
        vdb::Vdb,
        vti::Vti,
    },
    job::{
        Manifest, Prepared,
        file::{OutputFormat, VolumeValues},
        manifest::{MAPPING, MaterialRecord},
    },
    output::{Growing, OutputError, OutputFolder},
    voxel::MaterialId,
    watch::Watch,
};

/// Folder of files that hold a whole job.
pub(super) const EXPORTS: &str = "exports";

/// Path of the file that holds the whole job in `format`.
pub(crate) fn export_path(job: &str, format: OutputFormat) -> String {
    format!("{EXPORTS}/{job}.{}", format.name())
}

/// Path of the volume that holds the fractions of resins where ids fill another.
pub(crate) fn fractions_path(job: &str) -> String {
    format!("{EXPORTS}/{job}-fractions.{}", OutputFormat::Nrrd.name())
}

/// The containers of a run.
pub(super) struct Containers<'a> {
    output: &'a OutputFolder,
    content: Content,
    open: Vec<(Growing, Box<dyn Container>)>,
}

impl<'a> Containers<'a> {
    /// Opens those of `formats` that are single files. The rest is passed over.
    pub(super) fn open(output: &'a OutputFolder, content: Content, formats: &[OutputFormat]) -> Result<Self, RunError> {
        let mut open = Vec::new();
        let name = &content.name;
        let mut files = Vec::new();
        for &format in formats.iter().filter(|format| format.is_one_file()) {
            files.push((export_path(name, format), format, nrrd::Values::Ids));
            if format == OutputFormat::Nrrd && content.fractions {
                files.push((fractions_path(name), format, nrrd::Values::Fractions));
            }
        }
        for (path, format, values) in files {
            let (growing, file) = output.grow(&path)?;
            let container: io::Result<Box<dyn Container>> = match format {
                OutputFormat::Vti => Vti::new(file, &content, || output.aside()).map(|vti| Box::new(vti) as _),
                OutputFormat::Nrrd => Nrrd::new(file, &content, values).map(|nrrd| Box::new(nrrd) as _),
                OutputFormat::Vdb => Vdb::new(file, content.clone()).map(|vdb| Box::new(vdb) as _),
                _ => match Resolution::of(&content.lattice) {
                    Some(resolution) => Ok(Box::new(Gcvf::new(file, content.clone(), resolution))),
                    None => Err(io::Error::other("a lattice that is checked before")),
                },
            };
            let container = container.map_err(|error| failed(output, &growing, error.into()))?;
            open.push((growing, container));
        }
        Ok(Self { output, content, open })
    }

    /// Whether there is none.
    pub(super) fn is_empty(&self) -> bool {
        self.open.is_empty()
    }

    /// Whether one of them wants the images of slices.
    pub(super) fn want_images(&self) -> bool {
        self.open.iter().any(|(_, container)| container.wants_images())
    }

    /// Hands on voxels, bottom up, with the images of their slices.
    pub(super) fn take(
        &mut self,
        voxels: &dyn Voxels,
        images: &[SliceImage],
        watch: &dyn Watch,
    ) -> Result<(), RunError> {
        for (growing, container) in &mut self.open {
            container.take(voxels, images, watch).map_err(|error| failed(self.output, growing, error))?;
        }
        Ok(())
    }

    /// Ends all files and puts them under their names.
    pub(super) fn finish(self, counts: &Counts, watch: &dyn Watch) -> Result<Content, RunError> {
        for (growing, container) in self.open {
            container.finish(counts, watch).map_err(|error| failed(self.output, &growing, error))?;
            self.output.place(growing)?;
        }
        Ok(self.content)
    }
}

fn failed(output: &OutputFolder, growing: &Growing, error: ContainerError) -> RunError {
    match error {
        ContainerError::Stopped(stopped) => stopped.into(),
        ContainerError::Io(source) => {
            OutputError::Io { action: "writing", path: output.root().join(growing.relative()), source }.into()
        }
    }
}

/// Writes the small texts that go with the formats of a whole job: the mapping of colours, the list of bitmaps.
pub(super) fn write_texts(
    output: &OutputFolder,
    content: &Content,
    bitmaps: &[MaterialId],
    formats: &[OutputFormat],
    counts: &Counts,
) -> Result<(), OutputError> {
    let wants = |format| formats.contains(&format);
    if wants(OutputFormat::Png) || wants(OutputFormat::Gcvf) {
        output.write(MAPPING, mapping_text(content, counts).as_bytes())?;
    }
    if wants(OutputFormat::Bmp) {
        let materials: Vec<_> = content.resins.iter().filter(|resin| bitmaps.contains(&resin.id)).collect();
        output.write(&bmp::text_path(&content.name), bmp::text(content, &materials).as_bytes())?;
    }
    Ok(())
}

impl Prepared {
    /// What containers say of the job.
    pub(in crate::job) fn content(&self) -> Content {
        let resin = |(index, resin): (usize, &crate::optics::Resin)| {
            let id = MaterialId::from_resin(index);
            ContentResin { id, name: resin.name.clone(), rgba: self.palette[usize::from(id.0)] }
        };
        Content {
            name: self.job.name.clone(),
            lattice: self.lattice,
            resins: self.materials.resins.iter().enumerate().map(resin).collect(),
            max_colors: self.job.printer.max_colors,
            fractions: self.job.output.volumes == VolumeValues::Fractions,
        }
    }

    /// The printed resins that may occur in stackings, by id: those that have bitmaps.
    pub(in crate::job) fn bitmap_materials(&self) -> Vec<MaterialId> {
        let used: BTreeSet<_> = self.objects.iter().flat_map(|object| object.stackings.materials()).collect();
        used.into_iter().filter(|id| self.palette[usize::from(id.0)][3] != 0).collect()
    }
}

impl Manifest {
    /// What containers say of the job.
    pub(in crate::job) fn content(&self) -> Content {
        let resin = |record: &MaterialRecord| ContentResin {
            id: MaterialId(record.id),
            name: record.name.clone(),
            rgba: record.rgba,
        };
        let most = self.job.pointer("/printer/max-colors").and_then(serde_json::Value::as_u64);
        Content {
            name: self.name.clone(),
            lattice: self.lattice.lattice(),
            resins: self.materials.iter().map(resin).collect(),
            max_colors: most.map(|most| most as usize),
            fractions: self.job.pointer("/output/volumes").is_some_and(|values| values == "fractions"),
        }
    }

    /// Voxels by material id; the background is not counted.
    pub(in crate::job) fn counts(&self) -> Counts {
        let mut counts = [0; 256];
        self.materials.iter().for_each(|material| counts[usize::from(material.id)] = material.voxels);
        counts
    }
}
