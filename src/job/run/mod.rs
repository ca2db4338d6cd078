//! The main job: slab after slab into files, then the manifest.
//!
//! **In:** a [`Prepared`] job and a folder. **Out:** the folder, and a [`Finished`] run.

mod containers;
mod convert;
mod estimate;
mod heights;
mod labels;
mod redraw;
mod report;

use std::{
    collections::BTreeMap,
    ops::Range,
    path::{Path, PathBuf},
    time::Instant,
};

use rayon::prelude::*;
use serde_json::json;

pub(crate) use containers::export_path;
use containers::{Containers, write_texts};
pub use convert::{ConvertError, Converted, convert};
pub use estimate::{Estimate, ObjectPlace};
pub use redraw::{RedrawError, redraw};
use report::write_pictures;

use crate::look::Volume;
use crate::{
    container::{SliceImage, bmp},
    job::{
        Prepared, ROUNDS, RunError, StackingReport,
        file::{OutputFormat, Overlap},
        finished::read_manifest,
        look::{LOOK_VOXELS, Look, LookError, LookOptions, look_at},
        manifest::{LOOK, Manifest, MeshRecord, OWNER, Outcome, STACKINGS, json},
        printable::Printable,
    },
    output::{
        Existing, FileEntry, GENERATOR, MANIFEST, OutputError, OutputFolder, SliceCounts, TIMINGS, Task, is_plain,
        pretty,
    },
    preview::{PreviewBuilder, PreviewMaterial},
    slice::{
        RowBuffers, count_voxels, encode_mask, encode_rgba,
        meshes::{MaterialMesher, MaterialPart, MeshingError, write_3mf, write_stl},
    },
    voxel::{MaterialId, Slab},
    watch::Watch,
};

/// How to run a job.
#[derive(Debug, Clone, Default)]
pub struct RunOptions {
    /// What to do with a folder that holds something.
    pub existing: Existing,
    /// Slices to write, half-open; `None`: all.
    pub slices: Option<Range<u32>>,
}

/// A finished run.
#[derive(Debug, Clone, PartialEq)]
pub struct Finished {
    /// What is in the folder.
    pub manifest: Manifest,
    /// Slices that an interrupted run had written already.
    pub kept: u32,
}

/// Slices a prepared job into `folder`.
///
/// With [`Existing::Resume`] the slices that an interrupted run of the same job left whole are kept; where pictures are
/// asked for, their voxels are computed again. A finished folder of the same job is left as it is.
///
/// # Errors
/// [`RunError::Output`] when the folder may not or cannot be written, [`RunError::Stopped`] when asked to stop; in both
/// cases files under final names are whole, and there is no manifest.
pub fn run(prepared: &Prepared, folder: &Path, options: &RunOptions, watch: &dyn Watch) -> Result<Finished, RunError> {
    let started = Instant::now();
    prepared.refuse_misfits()?;
    prepared.refuse_too_large()?;
    let slices = prepared.checked_slices(options.slices.clone())?;
    prepared.refuse_part(&slices)?;
    if options.existing == Existing::Resume
        && let Some(manifest) = prepared.finished(folder, &slices)?
    {
        return Ok(Finished { manifest, kept: slices.end - slices.start });
    }
    let stackings = prepared.stackings_json();
    let command = OWNER.command.to_owned();
    let task = Task {
        command,
        generator: GENERATOR.to_owned(),
        sha256: prepared.digest(),
        slices: [slices.start, slices.end],
    };
    let (output, recorded) = OutputFolder::begin(folder, &OWNER, options.existing, &task, &prepared.files())?;
    if !output.keep(STACKINGS) {
        output.write(STACKINGS, &stackings)?;
    }
    if let Some(rounds) = &prepared.rounds
        && !output.keep(ROUNDS)
    {
        output.write(ROUNDS, &pretty(rounds))?;
    }

    watch.stage("slices", u64::from(slices.end - slices.start));
    let kept: BTreeMap<u32, SliceCounts> =
        recorded.into_iter().filter(|&(k, _)| slices.contains(&k) && prepared.keep_slice(&output, k)).collect();
    watch.advance(kept.len() as u64);
    let mut counts = [0; 256];
    for (&id, &voxels) in kept.values().flatten() {
        counts[usize::from(id)] += voxels;
    }
    let sinks = Sinks { prepared, output: &output, kept: &kept, watch };
    let mut pictures = prepared.job.wants(OutputFormat::Preview).then(|| prepared.preview_builder());
    let mut volume = prepared.look_volume(&slices)?;
    let mut containers = Containers::open(&output, prepared.content(), &prepared.job.output.formats)?;
    let drawn = pictures.is_some() || !containers.is_empty();
    let missing = |mut held: Range<u32>| held.any(|k| slices.contains(&k) && !kept.contains_key(&k));
    prepared.slicer().for_each_wanted_slab(
        slices.clone(),
        |held| drawn || missing(held),
        |slab| {
            if let Some(builder) = &mut pictures {
                builder.observe(slab);
            }
            if let Some(volume) = &mut volume {
                volume.add(slab);
            }
            let images = sinks.take(slab, &slices, &mut counts, containers.want_images())?;
            containers.take(slab, &images, watch)
        },
    )?;
    let content = containers.finish(&counts, watch)?;
    // Their numbers are those of all slices, and a part has the same files as the whole.
    if slices == (0..prepared.lattice.dims[2]) {
        write_texts(&output, &content, &prepared.bitmap_materials(), &prepared.job.output.formats, &counts)?;
    }
    let sliced = started.elapsed();
    let meshes = prepared.write_meshes(&output, watch)?;
    if prepared.job.wants(OutputFormat::Heights) {
        heights::write(&output, prepared.objects.iter().map(|object| &object.stackings.maps))?;
    }
    let meshed = started.elapsed() - sliced;

    let mut warnings = prepared.warnings.clone();
    if counts[1..].iter().all(|&voxels| voxels == 0) {
        warnings.push("no voxel's centre lies inside an object: nothing will be printed".to_owned());
    }
    if slices == (0..prepared.lattice.dims[2]) {
        warnings.extend(prepared.lost_volume(counts[1..].iter().sum()));
    }
    // Pictures take longer than this; slices alone are not kept waiting.
    let checked = pictures.is_some().then(|| prepared.printable(watch)).transpose()?;
    warnings.extend(checked.iter().flat_map(Printable::warnings));
    let outcome = Outcome { slices: [slices.start, slices.end], counts, meshes, warnings };
    let mut manifest = Manifest::new(prepared, outcome);
    let mut looked = std::time::Duration::ZERO;
    if let Some(builder) = pictures {
        watch.stage("pictures", 0);
        let mut pictures = builder.finish(volume.as_ref())?;
        pictures.extend(prepared.tray_picture()?);
        pictures.extend(checked.map(|found| prepared.printable_picture(&found)).transpose()?.flatten());
        let volume = volume.filter(|_| prepared.materials.has_coefficients());
        let drawn = started.elapsed();
        if let Some(mut look) = volume.map(|volume| prepared.quick_look(volume, watch)).transpose()? {
            output.write(LOOK, &pretty(&look))?;
            pictures.splice(0..0, std::mem::take(&mut look.pictures));
            manifest.look = Some(look.summary());
        }
        looked = started.elapsed() - drawn;
        write_pictures(&output, &manifest, &pictures, &prepared.surface_labels())?;
    }
    manifest.files = output.files();
    let timings = json!({
        "slicing_s": sliced.as_secs_f64(),
        "meshes_s": meshed.as_secs_f64(),
        "look_s": looked.as_secs_f64(),
        "total_s": started.elapsed().as_secs_f64(),
    });
    output.write_unlisted(TIMINGS, &pretty(&timings))?;
    // Last: a folder with a manifest is a finished job.
    output.finish(&pretty(&manifest))?;
    Ok(Finished { manifest, kept: kept.len() as u32 })
}

impl Prepared {
    /// An empty volume for the cut-away's surface and the look that a whole job shows with its pictures; `None` for a
    /// part of the slices and for a job too large for it.
    fn look_volume(&self, slices: &Range<u32>) -> Result<Option<Volume>, RunError> {
        let whole = *slices == (0..self.lattice.dims[2]) && self.lattice.voxels() <= LOOK_VOXELS;
        let shown = whole && self.job.wants(OutputFormat::Preview);
        Ok(shown.then(|| Volume::new(self.lattice)).transpose().map_err(LookError::from)?)
    }

    fn quick_look(&self, volume: Volume, watch: &dyn Watch) -> Result<Look, RunError> {
        let options = LookOptions::quick();
        Ok(look_at(self, &self.scene_of(volume)?, &options, watch)?)
    }
}

/// Path of the image of slice `k`.
pub(in crate::job) fn slice_path(k: u32) -> String {
    format!("slices/slice_{k}.png")
}

fn mask_path(resin: &str, k: u32) -> String {
    format!("masks/{resin}/slice_{k}.png")
}

/// Where slabs go.
struct Sinks<'a> {
    prepared: &'a Prepared,
    output: &'a OutputFolder,
    /// Slices that need no writing.
    kept: &'a BTreeMap<u32, SliceCounts>,
    watch: &'a dyn Watch,
}

/// Buffers of one worker.
#[derive(Default)]
struct Buffers {
    rows: RowBuffers,
    file: Vec<u8>,
    /// [`Prepared::bitmap_materials`], once they are asked for.
    bitmaps: Option<Vec<MaterialId>>,
}

impl Sinks<'_> {
    /// Writes the slices of `slab` that are in `slices`, adding their voxels to `counts`. Returns their images, kept
    /// ones' too, where those are wanted.
    fn take(
        &self,
        slab: &Slab,
        slices: &Range<u32>,
        counts: &mut [u64; 256],
        images: bool,
    ) -> Result<Vec<SliceImage>, RunError> {
        let held = slab.slices();
        let wanted = held.start.max(slices.start)..held.end.min(slices.end);
        let written: Vec<([u64; 256], Option<SliceImage>)> = wanted
            .into_par_iter()
            .filter(|k| images || !self.kept.contains_key(k))
            .map_init(Buffers::default, |buffers, slice| {
                let mut png = Vec::new();
                let counts = self.take_slice(slab, slice, buffers, images.then_some(&mut png))?;
                Ok((counts, images.then_some(SliceImage { slice, png })))
            })
            .collect::<Result<_, RunError>>()?;
        for (slice, _) in &written {
            counts.iter_mut().zip(slice).for_each(|(count, voxels)| *count += voxels);
        }
        Ok(written.into_iter().filter_map(|(_, image)| image).collect())
    }

    fn take_slice(
        &self,
        slab: &Slab,
        k: u32,
        buffers: &mut Buffers,
        image: Option<&mut Vec<u8>>,
    ) -> Result<[u64; 256], RunError> {
        self.watch.go_on()?;
        if self.kept.contains_key(&k) {
            // Its files are there and its voxels counted; only its image is wanted.
            self.prepared.encode_slice(slab, k, buffers, image, |_, _| Ok(()))?;
            return Ok([0; 256]);
        }
        let write = |path: &str, content: &[u8]| Ok(self.output.write(path, content)?);
        let counts = self.prepared.encode_slice(slab, k, buffers, image, write)?;
        let occurring = (0..=u8::MAX).map(|id| (id, counts[usize::from(id)])).filter(|&(_, voxels)| voxels > 0);
        self.output.finish_slice(k, occurring.collect())?;
        self.watch.advance(1);
        Ok(counts)
    }
}

/// Printed and meshed volumes that differ by less are the same.
const VOLUME_ALIKE: f64 = 0.02;

impl Prepared {
    /// Every file that was read.
    pub fn files(&self) -> Vec<PathBuf> {
        self.inputs.iter().map(|input| input.file.clone()).chain([self.job.path.clone()]).collect()
    }

    /// Hands the files of slice `k` to `take`, copies its image into `image`, and counts its voxels.
    fn encode_slice(
        &self,
        slab: &Slab,
        k: u32,
        buffers: &mut Buffers,
        image: Option<&mut Vec<u8>>,
        mut take: impl FnMut(&str, &[u8]) -> Result<(), RunError>,
    ) -> Result<[u64; 256], RunError> {
        let encoding = |source: std::io::Error| OutputError::Io {
            action: "encoding",
            path: PathBuf::from(format!("slice {k}")),
            source,
        };
        let mut counts = [0; 256];
        let Buffers { rows, file, bitmaps } = buffers;
        file.clear();
        if self.job.wants(OutputFormat::Png) || image.is_some() {
            encode_rgba(slab, k, &self.palette, rows, &mut counts, file).map_err(encoding)?;
        } else {
            count_voxels(slab, k, rows, &mut counts);
        }
        if let Some(image) = image {
            image.extend_from_slice(file);
        }
        if self.job.wants(OutputFormat::Png) {
            take(&slice_path(k), file)?;
        }
        if self.job.wants(OutputFormat::Masks) {
            for (MaterialId(id), resin) in self.printed() {
                file.clear();
                encode_mask(slab, k, id, rows, file).map_err(encoding)?;
                take(&mask_path(&self.materials[resin].name, k), file)?;
            }
        }
        if self.job.wants(OutputFormat::Bmp) {
            let bitmaps = bitmaps.get_or_insert_with(|| self.bitmap_materials());
            for (number, MaterialId(id)) in (1..).zip(bitmaps) {
                file.clear();
                bmp::encode_bmp(slab, k, *id, &mut *file).map_err(encoding)?;
                take(&bmp::bitmap_path(number, k, self.lattice.dims[2]), file)?;
            }
        }
        Ok(counts)
    }

    /// Hands the files of `slices` to `take`, of those slabs that are `wanted`.
    pub(super) fn for_each_sliced_file(
        &self,
        slices: Range<u32>,
        wanted: impl Fn(Range<u32>) -> bool,
        watch: &dyn Watch,
        mut take: impl FnMut(&str, &[u8]),
    ) -> Result<(), RunError> {
        let mut buffers = Buffers::default();
        self.slicer().for_each_wanted_slab(slices.clone(), wanted, |slab| {
            for k in slab.slices().filter(|k| slices.contains(k)) {
                watch.go_on()?;
                self.encode_slice(slab, k, &mut buffers, None, |path, content| {
                    take(path, content);
                    Ok(())
                })?;
                watch.advance(1);
            }
            Ok(())
        })
    }

    /// What to say where `voxels` are not the volume of the objects: walls thinner than voxels are lost or thickened.
    pub(super) fn lost_volume(&self, voxels: u64) -> Option<String> {
        // Objects that share space count it twice.
        if self.job.overlap == Overlap::Union {
            return None;
        }
        let printed = voxels as f64 * self.lattice.pitch.element_product();
        let meshed: f64 = self.objects.iter().map(|object| object.health.volume_mm3).sum();
        let off = printed / meshed - 1.0;
        (off.abs() > VOLUME_ALIKE).then(|| {
            let names: Vec<_> = self.objects.iter().map(|object| object.mesh.as_str()).collect();
            format!(
                "{}: {printed:.2} mm³ are printed of {meshed:.2} mm³ of the mesh ({:+.1}%): parts thinner than a voxel \
                 are lost or come out thicker",
                names.join(", "),
                100.0 * off
            )
        })
    }

    /// Lists the files of slice `k` as written if an interrupted run left all of them whole.
    fn keep_slice(&self, output: &OutputFolder, k: u32) -> bool {
        let slice = self.job.wants(OutputFormat::Png).then(|| slice_path(k));
        let masks = self.printed().filter(|_| self.job.wants(OutputFormat::Masks));
        let masks = masks.map(|(_, resin)| mask_path(&self.materials[resin].name, k));
        let bitmaps = if self.job.wants(OutputFormat::Bmp) { self.bitmap_materials().len() } else { 0 };
        let bitmaps = (1..=bitmaps).map(|number| bmp::bitmap_path(number, k, self.lattice.dims[2]));
        slice.into_iter().chain(masks).chain(bitmaps).all(|path| output.keep(&path))
    }

    /// The manifest in `folder` if this very job is finished there.
    fn finished(&self, folder: &Path, slices: &Range<u32>) -> Result<Option<Manifest>, RunError> {
        let path = folder.join(MANIFEST);
        if !path.exists() {
            return Ok(None);
        }
        let another = |found: &str, expected: String| OutputError::AnotherJob {
            path: path.clone(),
            found: found.to_owned(),
            expected,
        };
        let unreadable = |reason: String| OutputError::BadManifest { path: path.clone(), reason };
        let manifest = read_manifest(folder)
            .map_err(|error| unreadable(error.to_string()))?
            .map_err(|finding| unreadable(finding.problem))?;
        if manifest.generator != GENERATOR {
            return Err(another(&manifest.generator, GENERATOR.to_owned()).into());
        }
        if manifest.slices != [slices.start, slices.end] {
            let [first, end] = manifest.slices;
            return Err(another(&format!("slices {first}..{end}"), format!("{}..{}", slices.start, slices.end)).into());
        }
        let inputs: Vec<_> = self.inputs.iter().map(json).collect();
        if (&manifest.job, &manifest.inputs) != (&json(&self.job.resolved()), &inputs) {
            return Err(another("a finished job with other keys or inputs", "this one's".to_owned()).into());
        }
        let damaged = |file: &&FileEntry| !(is_plain(&file.path) && file.is_whole(folder));
        if let Some(file) = manifest.files.par_iter().find_first(damaged) {
            return Err(OutputError::Changed { path: folder.join(&file.path) }.into());
        }
        Ok(Some(manifest))
    }

    fn preview_builder(&self) -> PreviewBuilder {
        let material = |(index, resin): (usize, &crate::optics::Resin)| {
            let id = MaterialId::from_resin(index);
            PreviewMaterial { id, name: resin.name.clone(), rgba: self.palette[usize::from(id.0)] }
        };
        let materials: Vec<_> = self.materials.resins.iter().enumerate().map(material).collect();
        PreviewBuilder::new(&self.lattice, &materials)
    }

    /// Writes the material meshes the job asks for. They are of the whole job, whatever slices are written.
    fn write_meshes(&self, output: &OutputFolder, watch: &dyn Watch) -> Result<Vec<MeshRecord>, RunError> {
        let (stl, assembly) = (self.job.wants(OutputFormat::Stl), self.job.wants(OutputFormat::ThreeMf));
        if !stl && !assembly {
            return Ok(Vec::new());
        }
        let mesher = self.mesher();
        let resins: Vec<_> = self.printed().map(|(id, resin)| (id, self.materials[resin].name.clone())).collect();
        watch.stage("meshes", 0);
        let meshes = mesher.mesh(self.slicer().objects(), &resins, watch)?;
        let encoding = |error: std::io::Error| OutputError::Io {
            action: "encoding",
            path: output.root().join("meshes"),
            source: error,
        };
        let parts = || meshes.parts.iter().filter(|part| !part.triangles.is_empty());
        if stl {
            for part in parts() {
                let mut file = Vec::new();
                write_stl(&meshes, part, &mut file).map_err(encoding)?;
                output.write(&format!("meshes/{}.stl", part.name), &file)?;
            }
        }
        if assembly {
            let mut file = std::io::Cursor::new(Vec::new());
            write_3mf(&meshes, &self.palette, &mut file).map_err(encoding)?;
            output.write(&format!("meshes/{}.3mf", self.job.name), file.get_ref())?;
        }
        let record = |part: &MaterialPart| MeshRecord {
            material: part.name.clone(),
            triangles: part.triangles.len() as u64,
            volume_mm3: part.volume_mm3,
            pitch_mm: mesher.pitch_mm,
        };
        Ok(parts().map(record).collect())
    }

    fn mesher(&self) -> MaterialMesher {
        let layers = self.objects.iter().flat_map(|object| &object.stackings.stackings).flat_map(|entry| &entry.layers);
        let thinnest = layers.map(|layer| layer.thickness_mm).reduce(f64::min);
        let default = MaterialMesher::default_pitch_mm(thinnest, self.lattice.pitch);
        MaterialMesher { pitch_mm: self.job.output.mesh_pitch_mm.unwrap_or(default) }
    }

    /// Refuses what would make the material meshes fail once all slices are written.
    pub(super) fn check_meshes(&self) -> Result<(), RunError> {
        if self.job.wants(OutputFormat::Stl) || self.job.wants(OutputFormat::ThreeMf) {
            self.mesher().check(self.slicer().objects()).map_err(|error| match error {
                MeshingError::TooFine { pitch_mm, axis, nodes, max } => {
                    let found = format!("{pitch_mm} mm, which makes {nodes:.0} nodes along {axis}");
                    self.job.refuse("output.mesh-pitch-mm", found, format!("at most {max} nodes")).into()
                }
                other => RunError::from(other),
            })?;
        }
        Ok(())
    }

    fn refuse_misfits(&self) -> Result<(), RunError> {
        match self.misfits().into_iter().next() {
            Some(misfit) => Err(self.job.refuse("printer", misfit, "objects that fit the tray").into()),
            None => Ok(()),
        }
    }

    fn checked_slices(&self, slices: Option<Range<u32>>) -> Result<Range<u32>, RunError> {
        let all = 0..self.lattice.dims[2];
        match slices {
            None => Ok(all),
            Some(slices) if slices.start < slices.end && slices.end <= all.end => Ok(slices),
            Some(slices) => Err(RunError::Slices { found: slices, slices: all.end }),
        }
    }

    /// Refuses a part of the slices in formats that hold a whole job.
    fn refuse_part(&self, slices: &Range<u32>) -> Result<(), RunError> {
        let whole = self.job.output.formats.iter().find(|format| format.holds_whole_jobs());
        match whole {
            Some(format) if *slices != (0..self.lattice.dims[2]) => {
                let found = format!("\"{}\" of slices {}..{}", format.name(), slices.start, slices.end);
                let expected =
                    format!("all {} slices, or formats that part by part make a whole", self.lattice.dims[2]);
                Err(self.job.refuse("output.formats", found, expected).into())
            }
            _ => Ok(()),
        }
    }

    /// The content of `stackings.json`: the stackings of every object, and a digest of what they were made from.
    pub fn stackings_json(&self) -> Vec<u8> {
        pretty(&json!({ "sha256": self.digest(), "objects": self.stackings() }))
    }

    /// Digest of the job, its inputs and its stackings.
    pub(super) fn digest(&self) -> String {
        use sha2::{Digest, Sha256};
        let content = json!({ "job": self.job.resolved(), "inputs": self.inputs, "objects": self.stackings() });
        crate::words::hex(&Sha256::digest(content.to_string().as_bytes()))
    }

    fn stackings(&self) -> Vec<&StackingReport> {
        self.objects.iter().map(|object| &object.stackings).collect()
    }
}
