//! The same print, camera and lamps as a scene that Mitsuba 3 renders as it is.
//!
//! One scene for each channel: volumes of extinction, of albedo and of which phase function, as Mitsuba's grids, and
//! `scene_<channel>.xml` with `-Dlamp=sky|edge|behind|spot`. Mitsuba blends two phase functions, so a set of resins
//! with three different g in a channel is refused. Refractive indices are left out. Beside it lies what this program
//! sees of the scene, for Mitsuba's pictures to be held against: `film_<channel>.npy`, nothing smoothed.

use std::{
    fmt::Write,
    path::{Path, PathBuf},
    time::Instant,
};

use super::{LookError, PictureOptions, pictures::stage};
use crate::{
    appearance::bssrdf::write_npy,
    job::Prepared,
    look::{LAMPS, Lit, Scene, Stage},
    optics::VolumeCoefficients,
    output::{Existing, OutputFolder, Owner},
    voxel::Lattice,
    watch::Watch,
};

/// Orders of scattering: at 32 a white slab loses 38% of its light.
const MAX_DEPTH: u32 = 4000;
/// What `look --mitsuba` writes.
pub const OWNER: Owner = Owner {
    command: "look --mitsuba",
    names: &["sigma_t_*", "albedo_*", "phase_*", "scene_*", "lamp_*", "film_*", "sky.pfm"],
};

/// Most voxels of a grid: three of 4 bytes each.
const MAX_VOXELS: u64 = 1 << 30;
/// How far behind a face, in single precision, Mitsuba's rays go on: so much times 1 mm and the largest coordinate.
const RAY_EPSILON: f64 = 9e-5;
/// Half of the ground's edge, in distances of the camera.
const GROUND_HALF_EDGE: f64 = 100.0;

/// Writes the scenes and a film of each into `folder`. Opens stages of channels and of samples.
///
/// # Errors
/// [`LookError::Folder`] for what Mitsuba has no form for, [`LookError::Output`], [`LookError::Stopped`].
pub fn write_mitsuba(
    prepared: &Prepared,
    scene: &Scene,
    options: &PictureOptions,
    folder: &Path,
    existing: Existing,
    watch: &dyn Watch,
) -> Result<(), LookError> {
    let coefficients = super::voxels::coefficients(&prepared.materials)?;
    let print = Print { scene, channels: &prepared.materials.channels, coefficients: &coefficients };
    write_scenes(&print, &prepared.files(), options, folder, existing, watch)
}

/// A print, and what its resins do to light by channel and id.
pub(super) struct Print<'a> {
    pub scene: &'a Scene,
    pub channels: &'a [String],
    pub coefficients: &'a [Vec<VolumeCoefficients>],
}

/// [`write_mitsuba`] for voxels without a job; `inputs` are the files that were read.
pub(super) fn write_scenes(
    &Print { scene, channels, coefficients }: &Print<'_>,
    inputs: &[PathBuf],
    options: &PictureOptions,
    folder: &Path,
    existing: Existing,
    watch: &dyn Watch,
) -> Result<(), LookError> {
    let fault = |found: String, expected: &str| LookError::folder(folder, found, expected);
    let Some(stage) = stage(scene, options) else {
        return Err(fault("nothing that is printed".to_owned(), "some to look at"));
    };
    // Its grids have no refractive indices.
    let stage = Stage { surface: false, ..stage };
    let voxels = padded(scene.volume().lattice()).voxels();
    if voxels > MAX_VOXELS {
        return Err(fault(format!("{voxels} voxels, air around them too"), "at most 1 G for Mitsuba's grids"));
    }
    let output = OutputFolder::create(folder, &OWNER, existing, inputs)?;
    watch.stage("Mitsuba", channels.len() as u64);
    let present = scene.volume().present();
    for (name, media) in channels.iter().zip(coefficients) {
        let mut phases: Vec<f64> = (1..media.len()).filter(|&id| present[id]).map(|id| media[id].g).collect();
        phases.sort_by(f64::total_cmp);
        phases.dedup();
        if phases.len() > 2 {
            return Err(fault(format!("resins of g {phases:?}"), "two phase functions at most, as Mitsuba blends two"));
        }
        let last = phases.last().copied().unwrap_or(0.0);
        let of = |value: &dyn Fn(&VolumeCoefficients) -> f64| grid(scene, |id| value(&media[usize::from(id)]) as f32);
        output.write(&format!("sigma_t_{name}.vol"), &of(&VolumeCoefficients::sigma_t))?;
        output.write(&format!("albedo_{name}.vol"), &of(&VolumeCoefficients::albedo))?;
        output.write(&format!("phase_{name}.vol"), &of(&|volume| f64::from(u8::from(volume.g == last))))?;
        output.write(
            &format!("scene_{name}.xml"),
            xml(&stage, name, [phases.first().copied().unwrap_or(last), last]).as_bytes(),
        )?;
        watch.advance(1);
        watch.go_on()?;
    }
    output.write("sky.pfm", &sky())?;
    for (file, text) in lamps(&stage) {
        output.write(&file, text.as_bytes())?;
    }
    write_films(&output, &stage, channels, options, watch)?;
    Ok(output.finish_with_list(&OWNER, 1)?)
}

/// What this program sees: π times the radiance of every pixel and its standard error, as (2, lamps, rows, columns),
/// the lamps in the order sky, edge, behind, spot.
fn write_films(
    output: &OutputFolder,
    stage: &Stage<'_>,
    channels: &[String],
    options: &PictureOptions,
    watch: &dyn Watch,
) -> Result<(), LookError> {
    watch.stage("look", u64::from(options.samples));
    let began = Instant::now();
    let in_time = || options.time.is_none_or(|time| began.elapsed() < time);
    let mut film = stage.film();
    stage.expose(&mut film, options.samples, options.seed, watch, in_time)?;
    let [width, height] = film.size;
    for (name, &channel) in channels.iter().zip(stage.scene.distinct()) {
        let lamps: Vec<_> = (0..LAMPS).map(|lamp| film.image(channel, lamp)).collect();
        let mut values: Vec<f32> = lamps.iter().flat_map(|(mean, _)| mean.iter().copied()).collect();
        values.extend(lamps.iter().flat_map(|(_, variance)| variance).map(|variance| variance.sqrt()));
        output.write(&format!("film_{name}.npy"), &write_npy(&[2, LAMPS, height, width], &values))?;
    }
    Ok(())
}

/// The lattice with air around it: what comes in by a face of the medium's box goes on behind it, and a print that
/// begins at that face is entered too deep, which makes it 0.2% darker.
fn padded(lattice: &Lattice) -> Lattice {
    let reach = behind(lattice.origin, lattice.origin + size(lattice));
    let border = lattice.pitch.to_array().map(|pitch| (reach / pitch).ceil().max(1.0));
    Lattice {
        origin: lattice.origin - lattice.pitch * glam::DVec3::from(border),
        pitch: lattice.pitch,
        dims: std::array::from_fn(|axis| lattice.dims[axis] + 2 * border[axis] as u32),
    }
}

/// How far behind the faces of a box rays go on, mm.
fn behind(low: glam::DVec3, high: glam::DVec3) -> f64 {
    RAY_EPSILON * (1.0 + low.abs().max(high.abs()).max_element())
}

fn size(lattice: &Lattice) -> glam::DVec3 {
    lattice.pitch * glam::DVec3::from(lattice.dims.map(f64::from))
}

/// A grid of Mitsuba's format 3: single precision, one channel, x fastest; of the [`padded`] lattice.
fn grid(scene: &Scene, value: impl Fn(u8) -> f32) -> Vec<u8> {
    let dims = scene.volume().lattice().dims;
    let padded = padded(scene.volume().lattice()).dims;
    let present = scene.volume().present();
    let values: [[u8; 4]; 256] =
        std::array::from_fn(|id| if present[id] { value(id as u8).to_le_bytes() } else { [0; 4] });
    let mut out = Vec::with_capacity(48 + 4 * padded.iter().map(|n| *n as usize).product::<usize>());
    out.extend(b"VOL\x03");
    for number in [1, padded[0], padded[1], padded[2], 1] {
        out.extend(number.to_le_bytes());
    }
    for corner in [0.0_f32, 0.0, 0.0, 1.0, 1.0, 1.0] {
        out.extend(corner.to_le_bytes());
    }
    let [x, y, z] = std::array::from_fn(|axis| {
        let border = i64::from((padded[axis] - dims[axis]) / 2);
        -border..i64::from(dims[axis]) + border
    });
    for (k, j) in z.flat_map(|k| y.clone().map(move |j| (k, j))) {
        for i in x.clone() {
            out.extend(values[usize::from(scene.volume().voxel([i, j, k]).0)]);
        }
    }
    out
}

/// The sky as an environment map: a portable float map, whose rows run upwards, of what Mitsuba has y up for.
fn sky() -> Vec<u8> {
    const SIZE: [usize; 2] = [4, 512];
    let mut out = format!("Pf\n{} {}\n-1.0\n", SIZE[0], SIZE[1]).into_bytes();
    for row in 0..SIZE[1] {
        let polar = std::f64::consts::PI * (1.0 - (row as f64 + 0.5) / SIZE[1] as f64);
        let up = libm::cos(polar);
        let radiance = if up > 0.0 { crate::look::Lamps::sky(glam::DVec3::new(0.0, 0.0, up)) as f32 } else { 0.0 };
        (0..SIZE[0]).for_each(|_| out.extend(radiance.to_le_bytes()));
    }
    out
}

fn xml(stage: &Stage<'_>, channel: &str, [first, last]: [f64; 2]) -> String {
    let lattice = padded(stage.scene.volume().lattice());
    let size = size(&lattice);
    let (low, camera) = (lattice.origin, &stage.camera);
    // So far below what it carries that light from it begins in the air.
    let gap = 2.0 * behind(low, low + size);
    let vector = |v: glam::DVec3| format!("{}, {}, {}", v.x, v.y, v.z);
    let spaced = |v: glam::DVec3| format!("{} {} {}", v.x, v.y, v.z);
    let [_, up, toward] = camera.axes;
    let far = 4.0 * camera.pixel_mm * camera.size[0] as f64;
    let half = 0.5 * camera.pixel_mm * camera.size[0] as f64;
    let place = format!(
        "<transform name=\"to_world\"><scale value=\"{}\"/><translate value=\"{}\"/></transform>",
        spaced(size),
        spaced(low)
    );
    let volume = |name: &str, file: &str| {
        format!(
            "<volume type=\"gridvolume\" name=\"{name}\"><string name=\"filename\" value=\"{file}_{channel}.vol\"/>\
             <string name=\"filter_type\" value=\"nearest\"/><boolean name=\"raw\" value=\"true\"/>{place}</volume>"
        )
    };
    let mut text = String::new();
    // Writing to a string does not fail.
    let _ = write!(
        text,
        "<?xml version=\"1.0\"?>\n<!-- mitsuba -m scalar_rgb -Dlamp=sky -Dspp=64 scene_{channel}.xml -->\n\
         <scene version=\"3.0.0\">\n<default name=\"lamp\" value=\"sky\"/>\n<default name=\"spp\" value=\"64\"/>\n\
         <integrator type=\"volpath\"><integer name=\"max_depth\" value=\"{MAX_DEPTH}\"/>\
         <integer name=\"rr_depth\" value=\"200\"/></integrator>\n\
         <sensor type=\"orthographic\"><transform name=\"to_world\"><scale x=\"{half}\" y=\"{half}\"/>\
         <lookat origin=\"{}\" target=\"{}\" up=\"{}\"/></transform>\
         <float name=\"near_clip\" value=\"0.01\"/><float name=\"far_clip\" value=\"{}\"/>\n\
         <sampler type=\"independent\"><integer name=\"sample_count\" value=\"$spp\"/></sampler>\
         <film type=\"hdrfilm\"><integer name=\"width\" value=\"{}\"/><integer name=\"height\" value=\"{}\"/>\
         <string name=\"pixel_format\" value=\"luminance\"/><rfilter type=\"box\"/></film></sensor>\n",
        vector(camera.middle + toward * far),
        vector(camera.middle),
        vector(up),
        8.0 * far,
        camera.size[0],
        camera.size[1],
    );
    let _ = write!(
        text,
        "<medium type=\"heterogeneous\" id=\"print\">\n{}\n{}\n<phase type=\"blendphase\">{}\
         <phase type=\"hg\"><float name=\"g\" value=\"{first}\"/></phase>\
         <phase type=\"hg\"><float name=\"g\" value=\"{last}\"/></phase></phase></medium>\n\
         <shape type=\"cube\"><bsdf type=\"null\"/><ref name=\"interior\" id=\"print\"/><transform name=\"to_world\">\
         <translate value=\"1 1 1\"/><scale value=\"{}\"/><translate value=\"{}\"/></transform></shape>\n\
         <shape type=\"rectangle\"><bsdf type=\"diffuse\"><rgb name=\"reflectance\" value=\"{}\"/></bsdf>\
         <transform name=\"to_world\"><scale value=\"{}\"/><translate value=\"{}\"/></transform></shape>\n",
        volume("sigma_t", "sigma_t"),
        volume("albedo", "albedo"),
        volume("weight", "phase"),
        spaced(size * 0.5),
        spaced(low),
        stage.ground.albedo,
        GROUND_HALF_EDGE * far,
        spaced(glam::DVec3::new(camera.middle.x, camera.middle.y, stage.ground.z - gap)),
    );
    text += "<include filename=\"lamp_$lamp.xml\"/>\n</scene>\n";
    text
}

/// The lamps as files that a scene includes.
fn lamps(stage: &Stage<'_>) -> Vec<(String, String)> {
    let far = 4.0 * stage.camera.pixel_mm * stage.camera.size[0] as f64;
    let mut files = vec![(
        "lamp_sky.xml".to_owned(),
        "<scene version=\"3.0.0\"><emitter type=\"envmap\"><string name=\"filename\" value=\"sky.pfm\"/>\
         <transform name=\"to_world\"><rotate x=\"1\" angle=\"90\"/></transform>\
         </emitter></scene>\n"
            .to_owned(),
    )];
    for (name, beam) in ["edge", "behind", "spot"].iter().zip(&stage.lamps.beams) {
        let at = |v: glam::DVec3| format!("{}, {}, {}", v.x, v.y, v.z);
        let parallel = format!(
            "<emitter type=\"directional\"><vector name=\"direction\" value=\"{}\"/>\
             <rgb name=\"irradiance\" value=\"1\"/></emitter>",
            at(-beam.toward)
        );
        let lamp = match beam.lit {
            Lit::Everything => parallel,
            // A black plate over the dark side, beyond the camera, as wide as the ground: lit ground beyond the shadow
            // of one as wide as the picture made the dark side of a cube four times as light.
            Lit::Side { point, normal } => {
                let wide = GROUND_HALF_EDGE * far;
                let middle = point - normal * wide + beam.toward * 3.0 * far;
                format!(
                    "{parallel}<shape type=\"rectangle\"><transform name=\"to_world\">\
                     <scale x=\"{wide}\" y=\"{wide}\"/><lookat origin=\"{}\" target=\"{}\" up=\"{}\"/></transform>\
                     <bsdf type=\"twosided\"><bsdf type=\"diffuse\"><rgb name=\"reflectance\" value=\"0\"/></bsdf>\
                     </bsdf></shape>",
                    at(middle),
                    at(middle - beam.toward),
                    at(normal)
                )
            }
            // From so far that its light is parallel.
            Lit::Round { point, radius } => {
                let distance = 1000.0 * radius;
                let angle = libm::atan(radius / distance).to_degrees();
                format!(
                    "<emitter type=\"spot\"><transform name=\"to_world\">\
                     <lookat origin=\"{}\" target=\"{}\" up=\"{}\"/></transform>\
                     <rgb name=\"intensity\" value=\"{}\"/><float name=\"cutoff_angle\" value=\"{angle}\"/>\
                     <float name=\"beam_width\" value=\"{}\"/></emitter>",
                    at(point + beam.toward * distance),
                    at(point),
                    at(beam.toward.any_orthonormal_vector()),
                    distance * distance,
                    0.999 * angle
                )
            }
        };
        files.push((format!("lamp_{name}.xml"), format!("<scene version=\"3.0.0\">{lamp}</scene>\n")));
    }
    files
}
