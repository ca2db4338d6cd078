//! What the user should know of a job that is otherwise in order.

use glam::DVec3;

use super::{arrange::places, object::PreparedObject};
use crate::job::{
    Job, JobError,
    file::{DepthFrom, OutputFormat, TargetSpec, VolumeValues},
};
use crate::{
    container::{bmp, gcvf},
    optics::Mixture,
    slice::Slicer,
    voxel::Lattice,
    words::{counted, dimensions, short},
};

/// Refuses formats that cannot hold this lattice, before anything slow; what only may be refused is told in `warnings`.
pub(super) fn formats(job: &Job, lattice: &Lattice, warnings: &mut Vec<String>) -> Result<(), JobError> {
    if !job.wants(OutputFormat::Gcvf) {
        return Ok(());
    }
    let refuse = |found, expected: &str| Err(job.refuse("output.formats", found, expected));
    match gcvf::fit(lattice) {
        Err(gcvf::Unfit::FewSlices(slices)) => {
            let found = format!("\"gcvf\" of {}", counted(slices as usize, "slice"));
            let least = gcvf::MIN_SLICES;
            let thick = f64::from(least) * lattice.pitch.z;
            refuse(
                found,
                &format!("at least {least}, as GrabCAD Voxel Print does: an object {thick:.2} mm high or more"),
            )
        }
        Err(gcvf::Unfit::Pitch) => {
            let expected =
                "whole dots per inch in x and y and whole nanometres in z: a printer preset, as \"j750-27um\"";
            refuse(format!("\"gcvf\" of voxels of {} mm", dimensions(lattice.pitch.to_array())), expected)
        }
        Ok(resolution) => {
            warnings.extend(resolution.warning());
            Ok(())
        }
    }
}

/// Names of the printed resins that a job may lay: those of its stacks, and where stackings are searched for all that
/// no limit keeps out. `resins` are those of its set, each with whether it is printed.
pub(super) fn requested<'a>(job: &Job, resins: &[(&'a str, bool)]) -> Vec<&'a str> {
    let given = |name: &str| {
        job.objects.iter().any(|object| match &object.target {
            TargetSpec::Stacking { stack } => stack.pairs().any(|(mixture, _)| {
                Mixture::parts_of_name(mixture).is_some_and(|parts| parts.iter().any(|part| part.0 == name))
            }),
            _ => false,
        })
    };
    let searches = job.searches();
    let printed = resins.iter().filter(|resin| resin.1).map(|resin| resin.0);
    let laid =
        |name: &&str| name == &job.stacking.core_name() || given(name) || (searches && !job.stacking.leaves_out(name));
    printed.filter(laid).collect()
}

/// Refuses printers and formats that cannot hold so many resins: those that the job may lay before anything slow, and
/// those that its stackings have once they are known.
pub(super) fn resins(job: &Job, names: &[&str]) -> Result<(), JobError> {
    let formats = [(OutputFormat::Bmp, bmp::MAX_MATERIALS), (OutputFormat::Gcvf, gcvf::MAX_COLORS)];
    let formats = formats.into_iter().filter(|(format, _)| job.wants(*format));
    let formats = formats.map(|(format, most)| ("output.formats", format!("\"{}\"", format.name()), most));
    let printer = job.printer.max_colors.map(|most| ("printer", job.printer.name.clone(), most));
    for (key, holder, most) in printer.into_iter().chain(formats) {
        if names.len() > most {
            let found = format!("{holder} of {}: {}", counted(names.len(), "resin"), names.join(", "));
            let cure = match job.searches() {
                true => format!(
                    "a material file without the others, or for each that is to be left out a [[stacking.limit]] with \
                     min-depth-mm = {}",
                    job.stacking.max_thickness_mm
                ),
                false => "stacks of fewer resins".to_owned(),
            };
            return Err(job.refuse(key, found, format!("at most {most}: {cure}")));
        }
    }
    Ok(())
}

/// Refuses objects that are shorter than a voxel along every axis, most likely for want of a unit: of such an object
/// next to nothing is printed. `objects` are their names and corners. Those that are so along some axis only are told
/// in `warnings`.
pub(super) fn tiny_objects(
    job: &Job,
    objects: &[(String, [DVec3; 2])],
    lattice: &Lattice,
    warnings: &mut Vec<String>,
) -> Result<(), JobError> {
    for (index, (mesh, bounds)) in objects.iter().enumerate() {
        let size = bounds[1] - bounds[0];
        let short: Vec<_> =
            (0..3).filter(|&axis| size[axis] < lattice.pitch[axis]).map(|axis| ["x", "y", "z"][axis]).collect();
        if short.len() == 3 {
            let found = format!("an object of {:.3e} × {:.3e} × {:.3e} mm", size.x, size.y, size.z);
            let expected = "one larger than a voxel; `unit`, `scale` or `height-mm` set its size";
            return Err(job.refuse(&format!("object[{index}].mesh"), found, expected));
        }
        if !short.is_empty() {
            warnings.push(format!("{mesh}: thinner than a voxel along {}; it may be lost", short.join(", ")));
        }
    }
    Ok(())
}

/// What of objects, names and corners, does not fit the printer, a sentence each; those that the job has arranged and
/// that fit by themselves are told of together.
pub(super) fn misfits(job: &Job, objects: &[(String, [DVec3; 2])]) -> Vec<String> {
    let Some(tray) = job.printer.tray_mm else { return Vec::new() };
    let beyond = |high: DVec3| high.cmpgt(tray * (1.0 + 1e-9));
    let is_beyond = |high: DVec3| beyond(high).any();
    let size = |[low, high]: &[DVec3; 2]| *high - *low;
    let mut found = Vec::new();
    let mut told: Vec<&str> = Vec::new();
    let mut crowded = 0;
    for (mesh, corners) in objects.iter().filter(|(_, corners)| is_beyond(corners[1])) {
        let high = match job.arrange_gap_mm {
            None => corners[1],
            Some(_) if !is_beyond(size(corners)) => {
                crowded += 1;
                continue;
            }
            // Copies are alike, and none would fit anywhere.
            Some(_) if told.contains(&mesh.as_str()) => continue,
            Some(_) => size(corners),
        };
        told.push(mesh);
        for (axis, name) in ['x', 'y', 'z'].into_iter().enumerate().filter(|(axis, _)| beyond(high).test(*axis)) {
            found.push(format!(
                "{mesh} reaches {:.3} mm in {name}, the tray of {} ends at {} mm",
                high[axis],
                job.printer.name,
                short(tray[axis])
            ));
        }
    }
    if let (Some(gap_mm), true) = (job.arrange_gap_mm, crowded > 0) {
        let sizes: Vec<_> = objects.iter().map(|(_, corners)| size(corners)).filter(|size| !is_beyond(*size)).collect();
        let fits = |gap_mm: &f64| {
            let places = places(job, *gap_mm, &sizes);
            places.iter().zip(&sizes).all(|(place, size)| !is_beyond(*place + *size))
        };
        // From what the job has downwards, in tenths of a millimetre.
        let gaps = (0..(10.0 * gap_mm).ceil() as u32).rev().map(|tenths| f64::from(tenths) / 10.0);
        let cure = gaps.into_iter().find(fits).map(|gap| format!(", or gap-mm = {}", short(gap)));
        found.push(format!(
            "{} of {} arranged {} mm apart fit the tray of {}, {} × {} mm: {} fewer would{}",
            sizes.len() - crowded,
            counted(sizes.len(), "object"),
            short(gap_mm),
            job.printer.name,
            short(tray.x),
            short(tray.y),
            crowded,
            cure.unwrap_or_default()
        ));
    }
    found
}

/// Refuses the first of what does not fit.
pub(super) fn refuse_misfits(job: &Job, misfits: &[String]) -> Result<(), JobError> {
    match misfits.first() {
        Some(misfit) => Err(job.refuse("printer", misfit, "objects that fit the tray")),
        None => Ok(()),
    }
}

/// Counts layers thinner than a voxel is long along an axis: on faces that look along it such a layer comes out thicker
/// than it should be, or not at all. Layers laid from the top look along z only. `None` if there are none.
pub(super) fn thin_layers(job: &Job, objects: &[PreparedObject], lattice: &Lattice) -> Option<String> {
    let axes = ['x', 'y', 'z'].into_iter().zip(lattice.pitch.to_array());
    let mut pitches: Vec<f64> = axes.clone().map(|(_, pitch)| pitch).collect();
    pitches.sort_by(|a, b| b.total_cmp(a));
    pitches.dedup();
    let mut parts = Vec::new();
    for pitch in pitches {
        let here = || axes.clone().filter(|(_, along)| *along == pitch);
        let layered = |from: DepthFrom| from == DepthFrom::Surface || here().any(|(axis, _)| axis == 'z');
        // Dithered boundaries resolve layers of any thickness.
        let staircase = (0..).zip(&job.objects).zip(objects).filter(|((index, _), _)| !job.dithers(*index));
        let looked_at = staircase.filter(|((_, object), _)| layered(object.depth_from));
        let layers = looked_at.flat_map(|(_, object)| &object.stackings.stackings).flat_map(|found| &found.layers);
        let thin = layers.filter(|layer| layer.thickness_mm < pitch - ROUNDING_MM).count();
        if thin > 0 {
            let names: Vec<_> = here().map(|(axis, _)| axis.to_string()).collect();
            parts.push(format!("{thin} along {} ({pitch:.4} mm)", names.join(", ")));
        }
    }
    let stackings = || objects.iter().flat_map(|object| &object.stackings.stackings);
    let layers = stackings().flat_map(|stacking| &stacking.layers).count();
    (!parts.is_empty()).then(|| {
        let (parts, stackings) = (parts.join(", "), counted(stackings().count(), "stacking"));
        format!(
            "layers thinner than a voxel, not resolved on faces that look along it: {parts} of {layers} in \
            {stackings}"
        )
    })
}

/// Fractions that are printed voxels once more: no voxel of `slicer` is drawn by lot.
pub(super) fn whole_fractions(job: &Job, slicer: &Slicer) -> Option<String> {
    (job.output.volumes == VolumeValues::Fractions && !slicer.draws_by_lot()).then(|| {
        "output.volumes = \"fractions\": no layer is a mixture and no boundary is dithered, so all fractions are 0 or 1"
            .to_owned()
    })
}

/// Fewer slices than the printer takes.
pub(super) fn few_slices(job: &Job, lattice: &Lattice) -> Option<String> {
    let slices = lattice.dims[2] as usize;
    let least = job.printer.min_slices.filter(|&least| slices < least)?;
    Some(format!("{}, fewer than the {least} that {} takes", counted(slices, "slice"), job.printer.name))
}

/// Thicknesses are no better than this.
const ROUNDING_MM: f64 = 1e-9;
