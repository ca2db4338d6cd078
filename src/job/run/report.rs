//! A finished job for human eyes: its pictures, and the page that shows them.

use crate::{
    colour::linear_to_byte,
    job::{
        Manifest, RunError,
        manifest::{LatticeRecord, MaterialRecord, ObjectRecord, REPORT},
        record::{Differences, Fit, LookSummary, RoundRecord},
    },
    optics::{Mixture, ResinId, Stack},
    output::{MANIFEST, OutputFolder},
    preview::{
        self, FilmStrip, PreviewFile, PreviewMaterial, ReportData, ReportFilm, ReportHealth, ReportLabel,
        ReportMaterial, ReportPicture, ReportStacking, report_html,
    },
    voxel::{Lattice, MaterialId},
    watch::Watch,
    words::signed,
};
use glam::DVec3;

use super::labels::{self, LABELS, SurfaceLabel};

/// Writes pictures, labels of the surface and the page that shows them; the page is written whenever there are
/// pictures.
pub(super) fn write_pictures(
    output: &OutputFolder,
    manifest: &Manifest,
    pictures: &[PreviewFile],
    labels: &[SurfaceLabel],
) -> Result<(), RunError> {
    for picture in pictures {
        output.write(&picture.path, &picture.png)?;
    }
    if !labels.is_empty() {
        output.write(LABELS, labels::table(labels).as_bytes())?;
    }
    output.write(REPORT, report_html(&report_data(manifest, pictures, labels)).as_bytes())?;
    Ok(())
}

/// Draws the pictures of a finished job again from its slices.
///
/// # Errors
/// A slice that is missing or damaged.
pub(super) fn draw_again(
    folder: &std::path::Path,
    manifest: &Manifest,
    watch: &dyn Watch,
) -> Result<Vec<PreviewFile>, RunError> {
    let [first, end] = manifest.slices;
    Ok(preview::from_folder(folder, &manifest.lattice.lattice(), &preview_materials(manifest), first..end, watch)?)
}

fn preview_materials(manifest: &Manifest) -> Vec<PreviewMaterial> {
    let material = |material: &MaterialRecord| PreviewMaterial {
        id: MaterialId(material.id),
        name: material.name.clone(),
        rgba: material.rgba,
    };
    manifest.materials.iter().map(material).collect()
}

impl LatticeRecord {
    /// The lattice it records.
    pub fn lattice(&self) -> Lattice {
        Lattice { origin: DVec3::from(self.origin_mm), pitch: DVec3::from(self.pitch_mm), dims: self.dims }
    }
}

/// What the page says.
fn report_data(manifest: &Manifest, pictures: &[PreviewFile], labels: &[SurfaceLabel]) -> ReportData {
    let id = |name: &str| manifest.materials.iter().position(|material| material.name == name).map(ResinId);
    let slices = manifest.slices[1] - manifest.slices[0];
    let mut stackings = Vec::new();
    for (number, object) in (1..).zip(&manifest.stackings) {
        for (cluster, entry) in (0..).zip(&object.stackings) {
            let mixture = |name: &str| {
                let parts = Mixture::parts_of_name(name)?.into_iter().map(|(resin, share)| Some((id(resin)?, share)));
                Mixture::new(parts.collect::<Option<Vec<_>>>()?)
            };
            let layers = entry.layers.iter().filter_map(|layer| Some((mixture(&layer.resin)?, layer.thickness_mm)));
            stackings.push(ReportStacking {
                name: match (manifest.stackings.len(), object.stackings.len()) {
                    (1, 1) => "stacking".to_owned(),
                    (_, 1) => format!("object {number}"),
                    (1, _) => format!("cluster {cluster}"),
                    _ => format!("object {number}, cluster {cluster}"),
                },
                origin: [number, cluster],
                stack: Stack::new(layers).over(id(&object.core).map(Mixture::from)),
                share: (object.stackings.len() > 1).then_some(entry.share),
                albedo: [entry.target_albedo.as_deref(), Some(&entry.predicted_albedo)].map(|albedo| albedo.map(shown)),
                error: entry
                    .search
                    .as_ref()
                    .map(|search| search.transport.as_ref().map_or(search.rms, |found| found.rms)),
            });
        }
    }
    ReportData {
        job: manifest.name.clone(),
        generator: manifest.generator.clone(),
        printer: manifest.job["printer"]["name"].as_str().unwrap_or("custom").to_owned(),
        dims: manifest.lattice.dims,
        pitch_mm: manifest.lattice.pitch_mm,
        facts: vec![
            ("slices written".to_owned(), format!("{slices} ({} to {})", manifest.slices[0], manifest.slices[1] - 1)),
            ("material set".to_owned(), manifest.material_set.name.clone()),
            ("manifest".to_owned(), MANIFEST.to_owned()),
        ],
        materials: manifest
            .materials
            .iter()
            .map(|material| ReportMaterial {
                name: material.name.clone(),
                rgba: material.rgba,
                voxels: material.voxels,
                volume_mm3: material.volume_mm3,
                grams: Some(material.mass_g),
            })
            .collect(),
        materials_note: manifest.material_set.provenance.clone(),
        stackings,
        error_name: "rms error of R\u{302}".to_owned(),
        warnings: manifest.warnings.clone(),
        health: manifest.objects.iter().map(health).collect(),
        verdict: manifest.verdict(),
        look: (manifest.look.iter().flat_map(|look| look_words(look, &manifest.material_set.channels)))
            .chain(rounds_words(&manifest.rounds, &manifest.material_set.channels))
            .collect(),
        labels: report_labels(manifest, labels),
        area_mm2: manifest.objects.iter().filter_map(|object| object.health["area_mm2"].as_f64()).sum(),
        pictures: pictures
            .iter()
            .filter(|picture| picture.path != preview::FILM_STRIP)
            .map(|picture| {
                let panels = panels(picture);
                let key = match (panels.len(), manifest.material_set.channels.len()) {
                    (0 | 1, _) => "",
                    (_, 3) => {
                        " The difference is one of colour, ΔE 2000: 1 is just visible side by side, 5 shows, 20 is \
                         another colour."
                    }
                    _ => " Red is printed too bright, blue too dark.",
                };
                ReportPicture {
                    path: picture.path.clone(),
                    caption: caption(&picture.path) + key,
                    png: picture.png.clone(),
                    panels,
                }
            })
            .collect(),
        film: pictures
            .iter()
            .find(|picture| picture.path == preview::FILM_STRIP)
            .map(|picture| ReportFilm { layout: FilmStrip::of(&manifest.lattice.lattice()), png: picture.png.clone() }),
    }
}

/// The labels with the stackings' places on the page; none where one has no stacking.
fn report_labels(manifest: &Manifest, labels: &[SurfaceLabel]) -> Vec<ReportLabel> {
    let first =
        |object: usize| manifest.stackings.iter().take(object).map(|report| report.stackings.len()).sum::<usize>();
    let label = |label: &SurfaceLabel| {
        let held = manifest.stackings.get(label.object)?.stackings.len();
        let cluster = usize::from(label.cluster);
        (cluster < held).then(|| ReportLabel {
            stacking: first(label.object) + cluster,
            point: label.point.to_array(),
            normal: label.normal.to_array(),
        })
    };
    labels.iter().map(label).collect::<Option<_>>().unwrap_or_default()
}

/// What a picture of a look shows side by side.
fn panels(picture: &PreviewFile) -> Vec<(&'static str, Vec<u8>)> {
    let names: [&[&str]; 2] = [&["printed"], &["asked", "printed", "difference"]];
    let found = picture.path.starts_with("look/").then(|| preview::look_panels(&picture.png)).flatten();
    let found = found.unwrap_or_default();
    let named = names.iter().find(|names| names.len() == found.len());
    named.map_or_else(Vec::new, |names| names.iter().copied().zip(found).collect())
}

/// An albedo as it is shown: three channels are a colour, of others the first is grey.
fn shown(albedo: &[f64]) -> [u8; 3] {
    let grey = albedo.first().copied().unwrap_or(0.0);
    let light = if let [r, g, b] = *albedo { [r, g, b] } else { [grey; 3] };
    light.map(linear_to_byte)
}

/// What the rounds of correction saw.
fn rounds_words<'a>(rounds: &'a [RoundRecord], channels: &'a [String]) -> impl Iterator<Item = String> + 'a {
    (1..).zip(rounds).map(move |(number, round)| {
        let out = match round.out_of_reach {
            share if share < 0.005 => String::new(),
            share => format!(" At {:.0}% of them what the round before asked for was out of reach.", 100.0 * share),
        };
        let fits = fits_words(&round.fit, channels);
        let ended = round.ended.map(|ended| format!(" {}.", capitalized(ended.words()))).unwrap_or_default();
        format!("Round {number} of correction, {} points: printed less asked {fits}.{out}{ended}", round.points)
    })
}

fn capitalized(words: &str) -> String {
    let mut letters = words.chars();
    letters.next().map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect())
}

/// Bias and rms of every channel.
fn fits_words(fits: &[Fit], channels: &[String]) -> String {
    let one = |(channel, fit): (&String, &Fit)| {
        let channel = if channels.len() > 1 { format!("{channel} ") } else { String::new() };
        let bias = signed(fit.bias, 3);
        format!("{channel}{bias} on average, {:.3} rms ({:.0}%)", fit.rms, 100.0 * fit.relative_rms)
    };
    channels.iter().zip(fits).map(one).collect::<Vec<_>>().join("; ")
}

/// What the numbers of a look say.
fn look_words(look: &LookSummary, channels: &[String]) -> Vec<String> {
    let fit = |name: &str, fits: &[Fit]| {
        let fits = fits_words(fits, channels);
        format!("Printed albedo less the one that was {name}, over {} spots: {fits}.", look.spots)
    };
    let colour = look.delta_e_2000.map(|Differences { median, ninety_percent, worst, .. }| {
        format!(
            "Colour difference to what was asked for (CIEDE2000; 1 is just visible), over {} spots: {median:.1} in the \
             median, 90% below {ninety_percent:.1}, worst {worst:.1}.",
            look.spots
        )
    });
    let mut words: Vec<_> = colour.into_iter().collect();
    words.extend(look.against_asked.iter().map(|fits| fit("asked for", fits)));
    if !look.against_predicted.is_empty() {
        words.push(fit("predicted for a flat slab", &look.against_predicted));
    }
    if let Some(worst) = look.worst.first() {
        let [x, y, z] = worst.position_mm;
        let numbers = |values: &[f64]| values.iter().map(|v| format!("{v:.2}")).collect::<Vec<_>>().join(" ");
        let goal = worst.shows(worst.asked.as_ref().unwrap_or(&worst.predicted));
        words.push(format!(
            "{} at ({x:.1}, {y:.1}, {z:.1}) mm: {} in place of {}{}.",
            if worst.asked.is_some() { "Worst" } else { "Farthest apart" },
            numbers(&worst.printed),
            numbers(&goal),
            match worst.sky {
                sky if sky > 0.99 => String::new(),
                sky => format!(", as it shows in a hollow that sees {:.0}% of the sky", 100.0 * sky),
            }
        ));
    }
    words
}

fn health(object: &ObjectRecord) -> ReportHealth {
    let findings = object
        .health
        .as_object()
        .map(|findings| findings.iter().map(|(name, value)| (name.replace('_', " "), value.to_string())).collect());
    ReportHealth { object: object.mesh.clone(), findings: findings.unwrap_or_default() }
}

fn caption(path: &str) -> String {
    match path.trim_start_matches("preview/").trim_end_matches(".png") {
        "look/soft" => "Under the sky.".to_owned(),
        "look/edge" => "At the edge of a shadow.".to_owned(),
        "look/behind" => "Lit from behind.".to_owned(),
        "look/spot" => "Under a spot of light.".to_owned(),
        "cutaway" => "The object cut open: every layer in the colour that stands for its resin.".to_owned(),
        "checks" => "Where it will not print well: the notes above say why, and what cures it.".to_owned(),
        "tray" => "The tray, seen from above.".to_owned(),
        "cuts" => "Three cuts through the middle.".to_owned(),
        "slices" => "Slices from the lowest to the highest.".to_owned(),
        other => match other.strip_prefix("slice_") {
            Some(k) => format!("Slice {k}, seen from above."),
            None => other.to_owned(),
        },
    }
}
