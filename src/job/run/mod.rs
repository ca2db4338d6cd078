//! The main job: slab after slab into files, then the manifest.
//!
//! **In:** a [`Prepared`] job and a folder. **Out:** the folder, and a [`Finished`] run.

mod containers;
mod convert;
mod duration;
mod estimate;
mod heights;
mod labels;
mod meshes;
mod redraw;
mod report;
mod slices;
mod trees;

use std::{
    collections::BTreeMap,
    ops::Range,
    path::{Path, PathBuf},
    time::{Duration, Instant},
};

use serde_json::json;

use containers::{Containers, write_texts};
pub(crate) use containers::{export_path, fractions_path};
pub use convert::{ConvertError, Converted, convert};
pub use duration::Durations;
pub use estimate::{Estimate, ObjectPlace};
pub use redraw::{RedrawError, redraw};
use report::write_pictures;
use slices::Sinks;
pub(in crate::job) use slices::slice_path;

use crate::look::Volume;
use crate::{
    container::Drawn,
    job::{
        Job, Prepared, ROUNDS, RunError, StackingReport,
        file::{OutputFormat, Overlap, VolumeValues},
        finished::read_manifest,
        look::{LOOK_VOXELS, Look, LookError, LookOptions, look_at},
        manifest::{LOOK, Manifest, OWNER, Outcome, STACKINGS, json},
        printable::Printable,
    },
    output::{Existing, GENERATOR, MANIFEST, OutputError, OutputFolder, SliceCounts, TIMINGS, Task, is_plain, pretty},
    parallel,
    preview::{PreviewBuilder, PreviewMaterial},
    voxel::{FractionSlab, MaterialId, Slab},
    watch::Watch,
};

/// Refuses to go on in `folder` where another job is finished: one of other keys, which is known before anything slow.
///
/// # Errors
/// [`OutputError::AnotherJob`].
pub fn refuse_another(job: &Job, folder: &Path) -> Result<(), RunError> {
    // What cannot be read is told by who reads all of it.
    let Ok(Ok(manifest)) = read_manifest(folder) else { return Ok(()) };
    if manifest.generator == GENERATOR && manifest.job != json(&job.resolved()) {
        return Err(other_keys(folder));
    }
    Ok(())
}

fn other_keys(folder: &Path) -> RunError {
    let (path, found) = (folder.join(MANIFEST), "a finished job with other keys or inputs".to_owned());
    OutputError::AnotherJob { path, found, expected: "this one's".to_owned() }.into()
}

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
    let take = |slab: &Slab, fractions: Option<&FractionSlab>| {
        if let Some(builder) = &mut pictures {
            builder.observe(slab);
        }
        if let Some(volume) = &mut volume {
            volume.add(slab);
        }
        let images = sinks.take(slab, &slices, &mut counts, containers.want_images())?;
        match fractions {
            Some(fractions) => containers.take(&Drawn { slab, fractions }, &images, watch),
            None => containers.take(slab, &images, watch),
        }
    };
    let wanted = |held| drawn || missing(held);
    prepared.for_each_slab_drawn(slices.clone(), wanted, take)?;
    let content = containers.finish(&counts, watch)?;
    // Their numbers are those of all slices, and a part has the same files as the whole.
    if prepared.are_all(&slices) {
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
    let whole = prepared.are_all(&slices);
    if whole {
        warnings.extend(prepared.lost_volume(counts[1..].iter().sum()));
    }
    // Whatever is written will be printed; who slices by parts is told by one dry run.
    let checked = (whole || pictures.is_some()).then(|| prepared.printable(watch)).transpose()?;
    let print_warnings: Vec<String> = checked.iter().flat_map(Printable::warnings).collect();
    let counted = print_warnings.len();
    warnings.extend(print_warnings);
    let outcome = Outcome { slices: [slices.start, slices.end], counts, meshes, warnings, print_warnings: counted };
    let mut manifest = Manifest::new(prepared, outcome);
    let mut looked = Duration::ZERO;
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
        "preparing_s": prepared.took.whole.as_secs_f64(),
        "rounds_s": prepared.took.rounds.iter().map(Duration::as_secs_f64).collect::<Vec<_>>(),
        "slicing_s": sliced.as_secs_f64(),
        "meshes_s": meshed.as_secs_f64(),
        "look_s": looked.as_secs_f64(),
        "total_s": (prepared.took.whole + started.elapsed()).as_secs_f64(),
    });
    output.write_unlisted(TIMINGS, &pretty(&timings))?;
    // Last: a folder with a manifest is a finished job.
    output.finish(&pretty(&manifest))?;
    Ok(Finished { manifest, kept: kept.len() as u32 })
}

impl Prepared {
    /// Slices, with the fractions that voxels are drawn by where volumes are to hold them.
    fn for_each_slab_drawn(
        &self,
        slices: Range<u32>,
        wanted: impl Fn(Range<u32>) -> bool,
        mut take: impl FnMut(&Slab, Option<&FractionSlab>) -> Result<(), RunError>,
    ) -> Result<(), RunError> {
        match self.job.output.volumes {
            VolumeValues::Voxels => self.slicer().for_each_wanted_slab(slices, wanted, |slab| take(slab, None)),
            VolumeValues::Fractions => self.slicer().for_each_slab_with_fractions(slices, wanted, take),
        }
    }

    /// An empty volume for the cut-away's surface and the look that a whole job shows with its pictures; `None` for a
    /// part of the slices and for a job too large for it.
    fn look_volume(&self, slices: &Range<u32>) -> Result<Option<Volume>, RunError> {
        let whole = self.are_all(slices) && self.lattice.voxels() <= LOOK_VOXELS;
        let shown = whole && self.job.wants(OutputFormat::Preview);
        Ok(shown.then(|| Volume::new(self.lattice)).transpose().map_err(LookError::from)?)
    }

    fn quick_look(&self, volume: Volume, watch: &dyn Watch) -> Result<Look, RunError> {
        let options = LookOptions::quick();
        Ok(look_at(self, &self.scene_of(volume)?, &options, watch)?)
    }
}

/// Printed and meshed volumes that differ by less are the same.
const VOLUME_ALIKE: f64 = 0.02;

impl Prepared {
    /// Every file that was read.
    pub fn files(&self) -> Vec<PathBuf> {
        self.inputs.iter().map(|input| input.file.clone()).chain([self.job.path.clone()]).collect()
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
            return Err(other_keys(folder));
        }
        let whole = parallel::map_all(&manifest.files, |file| is_plain(&file.path) && file.is_whole(folder));
        if let Some((file, _)) = manifest.files.iter().zip(whole).find(|(_, whole)| !whole) {
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

    fn are_all(&self, slices: &Range<u32>) -> bool {
        *slices == (0..self.lattice.dims[2])
    }

    /// The slices asked for, or all.
    ///
    /// # Errors
    /// [`RunError::Slices`] where they are not among them.
    pub fn checked_slices(&self, slices: Option<Range<u32>>) -> Result<Range<u32>, RunError> {
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
            Some(format) if !self.are_all(slices) => {
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
