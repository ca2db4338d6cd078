//! Figure 6: five slabs of equal albedo and falling translucency (section 8.2), designed, judged, sliced, and seen
//! under light.
//!
//! A translucent sample, mostly support under a little white, is predicted; white's own profile is scaled to the same
//! albedo; three profiles between the two are mixed evenly. Every one is matched and refined in the transport model,
//! and photons judge. The five slabs stand side by side in one job, which the slicer turns into slices and meshes.

use std::{fmt::Write, fs};

use lumislice::{
    colour::linear_to_byte,
    job::{self, Job, Prepared, RunOptions},
    optics::{ChannelPrediction, EdgeResponse, OpticsError},
    output::Existing,
    plot::{Axis, Figure, Panel, Raster, Rgb, Series, Shape, viridis},
    search::{Found, Matcher, SearchTarget, place_of},
    watch::Unwatched,
};

use super::{
    Options, Outcome,
    models::{Resins, rms},
};

/// The translucent sample, mm from the top: as near to the surface as support may lie; the job's core, black, lies
/// below.
const SAMPLE: [(&str, f64); 2] = [("white", 0.2), ("support", 4.8)];
const SLABS: usize = 5;
/// Size of a slab, and the distance between slabs, mm.
const SLAB_MM: [f64; 3] = [20.0, 20.0, 6.0];
const PITCH_MM: f64 = 26.0;

pub fn run(options: &Options) -> Outcome {
    let resins = Resins::synthetic()?;
    let targets = targets(&resins)?;
    let found = Matcher::new(&resins.set, &resins.options())?.match_targets(&targets, &Unwatched)?;
    println!(
        "| slab | layers, mm from the top | support, mm | albedo | asked | 50% within, mm | asked | KM's claim | \
            promised | photons see | rms |\n\
         | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |"
    );
    let mut seen = Vec::new();
    for (slab, (found, target)) in found.iter().zip(&targets).enumerate() {
        let photons = resins.by_photons(&found.stacking(), options.photons)?.light.remove(0);
        row(&resins, slab, found, target, &photons);
        seen.push((resins.by_transport(&found.stacking())?.light.remove(0), photons));
    }
    profiles(&resins, &targets, &seen).write(&options.folder.join("slabs-profiles.png"))?;
    profiles(&resins, &targets, &seen).write(&options.folder.join("slabs-profiles.svg"))?;
    pictures(&resins, &seen).write(&options.folder.join("slabs.png"))?;
    slice(options, &resins, &found)
}

/// The five profiles, from the most translucent to the least.
fn targets(resins: &Resins) -> Result<Vec<SearchTarget>, OpticsError> {
    let black = resins.id("black");
    let spectrum = |layers| {
        let stack = resins.stack(layers).over(black);
        Ok::<_, OpticsError>(resins.by_transport(&stack)?.light.remove(0).reflection_hankel)
    };
    let (sample, white) = (spectrum(&SAMPLE)?, spectrum(&[("white", 5.0)])?);
    let scale = sample[0] / white[0];
    let mix = |slab: usize| {
        let part = slab as f64 / (SLABS - 1) as f64;
        let channel = sample.iter().zip(&white).map(|(sample, white)| (1.0 - part) * sample + part * scale * white);
        SearchTarget { channels: vec![channel.collect()] }
    };
    Ok((0..SLABS).map(mix).collect())
}

fn row(resins: &Resins, slab: usize, found: &Found, target: &SearchTarget, photons: &ChannelPrediction) {
    let support = resins.id("support");
    let layers = found.stacking();
    let support: f64 = layers.pairs().map(|(mixture, mm)| mixture.share(support) * mm).sum();
    let radius = |spectrum: &[f64]| place_of(spectrum, &resins.set.grid).map_or(f64::NAN, |place| place[1]);
    let wanted = &target.channels[0];
    let off = rms(&photons.reflection_hankel, wanted);
    println!(
        "| {} | {} | {:.2} | {:.4} | {:.4} | {:.3} | {:.3} | {:.1e} | {:.1e} | {:.1e} | {off:.1e} |",
        slab + 1,
        resins.named(&found.stacking()),
        support.max(0.0),
        photons.reflection_hankel[0],
        wanted[0],
        radius(&photons.reflection_hankel),
        radius(wanted),
        found.search.as_ref().map_or(f64::NAN, |search| search.objective),
        found.objective(),
        off * off * wanted.len() as f64,
    );
}

fn colour(slab: usize) -> Rgb {
    viridis(0.85 * slab as f64 / (SLABS - 1) as f64)
}

/// What was asked for and what photons see, over r; and the light across a shadow's edge.
fn profiles(resins: &Resins, targets: &[SearchTarget], seen: &[(ChannelPrediction, ChannelPrediction)]) -> Figure {
    let top = 2.0;
    let mut profiles = Panel::new(Axis::linear("r [mm]").range(0.0, 12.0), Axis::log("R(r) [mm⁻²]").range(1e-6, top))
        .title("Profiles");
    let mut edges = Panel::new(Axis::linear("distance from the shadow's edge [mm]"), Axis::linear("light that leaves"))
        .title("Across a sharp shadow's edge");
    for (slab, (target, (transport, photons))) in targets.iter().zip(seen).enumerate() {
        let dark = vec![0.0; resins.set.grid.len()];
        let asked = ChannelPrediction::from_spectra(target.channels[0].clone(), dark, &resins.set.grid);
        let curve = |light: &ChannelPrediction| -> Vec<[f64; 2]> {
            light.rings().iter().map(|ring| [ring.r_mm, ring.reflection_per_mm2]).collect()
        };
        profiles = profiles.with(Series::line(format!("slab {} asked", slab + 1), curve(&asked)).colour(colour(slab)));
        let rings = curve(photons).into_iter().filter(|point| point[1] > 0.0).step_by(8);
        profiles = profiles.with(Series::points("", rings).shape(Shape::Ring).size(5.0).colour(colour(slab)));
        let edge = EdgeResponse::new(&transport.reflection_hankel, &resins.set.grid);
        let across = (-80..=80).map(|n| 0.1 * f64::from(n)).map(|x| [x, edge.at(x)]);
        edges = edges.with(Series::line(format!("slab {}", slab + 1), across).colour(colour(slab)));
    }
    Figure::new("Five slabs of one albedo: profiles asked for (lines) and seen by photons (rings)")
        .columns(2)
        .caption(resins.set.provenance.clone())
        .with(profiles)
        .with(edges)
}

/// Photographs to be: room light above, a sharp shadow's edge below.
fn pictures(resins: &Resins, seen: &[(ChannelPrediction, ChannelPrediction)]) -> Figure {
    const CELLS: usize = 160;
    let half = 0.5 * SLAB_MM[0];
    // So exposed that a white sheet would be twice as bright as the picture can show; the slabs use the upper half of
    // its range.
    let grey = |light: f64| -> Rgb { [linear_to_byte(1.6 * light); 3] };
    let frame = |label: &str| {
        let axis = |label: &str| Axis::linear(label).range(-half, half);
        Panel::new(axis("mm"), axis(label))
    };
    let mut figure = Figure::new("Five slabs of one albedo, room light above, a sharp shadow's edge below")
        .columns(SLABS)
        .panel_size(200.0, 200.0)
        .caption(format!(
            "Light that leaves, predicted by transport; a slab taken as endless. {}",
            resins.set.provenance
        ));
    for (slab, (light, _)) in seen.iter().enumerate() {
        let even = vec![grey(light.reflection_hankel[0]); 4];
        let label = if slab == 0 { "room light" } else { "" };
        let panel = frame(label).title(format!("slab {}", slab + 1));
        figure.panels.push(panel.raster(Raster::picture(2, even, [-half, half], [-half, half])));
    }
    for (slab, (light, _)) in seen.iter().enumerate() {
        let edge = EdgeResponse::new(&light.reflection_hankel, &resins.set.grid);
        let at = |cell: usize| ((cell as f64 + 0.5) / CELLS as f64 - 0.5) * SLAB_MM[0];
        let across: Vec<Rgb> = (0..CELLS).map(|cell| grey(edge.at(-at(cell)))).collect();
        let label = if slab == 0 { "shadow at the right" } else { "" };
        figure.panels.push(frame(label).raster(Raster::picture(CELLS, across, [-half, half], [-half, half])));
    }
    figure
}

/// All five through the slicer: a job, its mesh, and `slabs-job/out`.
fn slice(options: &Options, resins: &Resins, found: &[Found]) -> Outcome {
    let folder = options.folder.join("slabs-job");
    fs::create_dir_all(&folder)?;
    fs::write(folder.join("slab.stl"), box_stl(SLAB_MM))?;
    let mut text =
        "[printer]\npitch-mm = [0.1, 0.1, 0.05]\n[materials]\nset = \"synthetic\"\n[stacking]\ncore = \"black\"\n\
                    [output]\nformats = [\"png\", \"stl\", \"preview\"]\nmesh-pitch-mm = 0.1\n"
            .to_owned();
    for (slab, found) in found.iter().enumerate() {
        write!(
            text,
            "[[object]]\nmesh = \"slab.stl\"\nposition-mm = [{}, 0, 0]\n[object.target]\nkind = \"stacking\"\nstack \
                = \"{}\"\n",
            slab as f64 * PITCH_MM,
            resins.set.named(&found.stacking()),
        )?;
    }
    let path = folder.join("slabs.toml");
    fs::write(&path, &text)?;
    let prepared = Prepared::new(Job::load(&path)?, &Unwatched)?;
    let run = RunOptions { existing: Existing::Overwrite, slices: None };
    let manifest = job::run(&prepared, &folder.join("out"), &run, &Unwatched)?.manifest;
    println!(
        "\nsliced: {} × {} × {} voxels",
        prepared.lattice.dims[0], prepared.lattice.dims[1], prepared.lattice.dims[2]
    );
    for material in &manifest.materials {
        println!("{}: {} voxels, {:.1} mm³", material.name, material.voxels, material.volume_mm3);
    }
    Ok(())
}

/// A box from the origin, as ASCII STL.
fn box_stl(size: [f64; 3]) -> String {
    let corner =
        |bits: usize| -> [f64; 3] { std::array::from_fn(|axis| if bits >> axis & 1 == 1 { size[axis] } else { 0.0 }) };
    // Outwards by the right-hand rule; a corner's bits are x, y, z.
    const FACES: [[usize; 4]; 6] = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let mut text = "solid slab\n".to_owned();
    for [a, b, c, d] in FACES {
        for triangle in [[a, b, c], [a, c, d]] {
            text += "facet normal 0 0 0\nouter loop\n";
            for [x, y, z] in triangle.map(corner) {
                text += &format!("vertex {x} {y} {z}\n");
            }
            text += "endloop\nendfacet\n";
        }
    }
    text + "endsolid slab\n"
}
