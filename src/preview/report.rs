//! A page to read beside the print: one HTML file with its pictures in it, that can be mailed. It needs no script but
//! for leafing through slices and for turning the surface.

use std::fmt::{self, Write};

use super::{
    FilmStrip,
    whereabouts::{self, Known, ReportLabel},
};
use crate::{
    optics::{Mixture, ResinId, Stack},
    page::{escape, page, png_address},
    words::counted,
};

/// What the page says. All texts are plain; the page escapes them.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ReportData {
    /// Name of the job.
    pub job: String,
    /// What wrote it, such as `lumislice 0.1.0`.
    pub generator: String,
    /// Name of the printer or preset.
    pub printer: String,
    /// Voxels per axis.
    pub dims: [u32; 3],
    /// Edges of a voxel, mm.
    pub pitch_mm: [f64; 3],
    /// More lines for the head of the page: name, value.
    pub facts: Vec<(String, String)>,
    /// Materials in the order of their ids.
    pub materials: Vec<ReportMaterial>,
    /// A sentence under the materials, such as where their optics come from.
    pub materials_note: String,
    /// One stacking per cluster.
    pub stackings: Vec<ReportStacking>,
    /// What the predicted error measures, as a column heading; `error` if empty.
    pub error_name: String,
    /// Warnings of the job.
    pub warnings: Vec<String>,
    /// What was found in the meshes.
    pub health: Vec<ReportHealth>,
    /// What the job comes to, a sentence or two each, the most telling first: what the page opens with.
    pub verdict: Vec<String>,
    /// What the numbers of the look say, a sentence each.
    pub look: Vec<String>,
    /// Points of the surface, with the stackings there.
    pub labels: Vec<ReportLabel>,
    /// Area of the surface, mm².
    pub area_mm2: f64,
    /// Pictures in the order they are shown.
    pub pictures: Vec<ReportPicture>,
    /// Slices to leaf through.
    pub film: Option<ReportFilm>,
}

/// A row of the table of materials.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ReportMaterial {
    /// Its name.
    pub name: String,
    /// sRGB colour and alpha; alpha 0 is hatched: the printer fills it.
    pub rgba: [u8; 4],
    /// Voxels made of it.
    pub voxels: u64,
    /// Their volume, mm³.
    pub volume_mm3: f64,
    /// Their mass; `None` if the density is not known.
    pub grams: Option<f64>,
}

/// Layers of one cluster.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ReportStacking {
    /// What it is for, such as `cluster 3`.
    pub name: String,
    /// Its object and cluster, from 1 and from 0.
    pub origin: [usize; 2],
    /// Layers of the materials or of mixtures of them, over their core.
    pub stack: Stack<Mixture>,
    /// Part of the surface it is for, 0 to 1, if known.
    pub share: Option<f64>,
    /// The albedo that is asked for and the one that is predicted, as sRGB, if known.
    pub albedo: [Option<[u8; 3]>; 2],
    /// Predicted error, if known.
    pub error: Option<f64>,
}

/// What was found in one mesh.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ReportHealth {
    /// The object or its file.
    pub object: String,
    /// Finding, value.
    pub findings: Vec<(String, String)>,
}

/// A picture of the job.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ReportPicture {
    /// Path relative to the page, with forward slashes.
    pub path: String,
    /// A sentence below it.
    pub caption: String,
    /// The file; if it is empty, the page shows what lies at its path.
    pub png: Vec<u8>,
    /// What it shows side by side, by name, if it is to be shown one by one.
    pub panels: Vec<(&'static str, Vec<u8>)>,
}

/// Slices to leaf through.
#[derive(Debug, Clone, PartialEq)]
pub struct ReportFilm {
    /// How they lie in the picture.
    pub layout: FilmStrip,
    /// The picture.
    pub png: Vec<u8>,
}

/// Width of the longest stacking's bar without its core, pixels.
const BAR: f64 = 420.0;
/// Width of the core's part.
const CORE: f64 = 36.0;
/// Height of a bar.
const BAR_HEIGHT: f64 = 22.0;
/// Layers narrower than this carry no number.
const NUMBERED: f64 = 34.0;

/// Writes the page.
pub fn report_html(data: &ReportData) -> String {
    let mut body = String::new();
    // Writing to a string does not fail.
    let _ = write_body(&mut body, data);
    page(&data.job, include_str!("report.css"), &body)
}

fn write_body(page: &mut String, data: &ReportData) -> fmt::Result {
    let extent = std::array::from_fn::<_, 3, _>(|axis| f64::from(data.dims[axis]) * data.pitch_mm[axis]);
    writeln!(page, "<main>\n<header>\n<h1>{}</h1>", escape(&data.job))?;
    writeln!(page, "<p>{} mm{}</p>\n</header>", times(extent.map(|mm| number(mm, 2))), on(&data.printer))?;
    verdict(page, &data.verdict)?;
    // The look opens the page, or without one the first picture; the rest follow the tables.
    let looks = data.pictures.iter().take_while(|picture| picture.path.starts_with("look/")).count();
    let (first, rest) = data.pictures.split_at(looks.max(1).min(data.pictures.len()));
    let cutaway = rest.iter().find(|picture| looks > 0 && picture.path == CUTAWAY);
    for picture in first.iter().take(1) {
        figure(page, picture)?;
    }
    numbers_of_look(page, &data.look)?;
    cutaway.map_or(Ok(()), |picture| figure(page, picture))?;
    warnings(page, &data.warnings)?;
    if first.len() > 1 {
        writeln!(page, "<details open>\n<summary>More light</summary>")?;
        first[1..].iter().try_for_each(|picture| figure(page, picture))?;
        writeln!(page, "</details>")?;
    }
    data.film.as_ref().map_or(Ok(()), |slices| film(page, slices))?;
    let pictures = rest.iter().filter(|picture| cutaway.is_none() || picture.path != CUTAWAY);
    writeln!(page, "<h2>Job</h2>\n<dl>")?;
    let voxels: u64 = data.dims.iter().map(|&dim| u64::from(dim)).product();
    fact(page, "Size", &format!("{} mm", times(extent.map(|mm| number(mm, 3)))))?;
    let counts = times(data.dims.map(|dim| thousands(u64::from(dim))));
    fact(page, "Voxels", &format!("{counts} = {}", thousands(voxels)))?;
    fact(page, "Pitch", &format!("{} µm", times(data.pitch_mm.map(|mm| number(mm * 1000.0, 2)))))?;
    if !data.printer.is_empty() {
        fact(page, "Printer", &escape(&data.printer))?;
    }
    for (name, value) in &data.facts {
        fact(page, &escape(name), &escape(value))?;
    }
    writeln!(page, "</dl>")?;
    materials(page, data)?;
    stackings(page, data)?;
    let known: Vec<Known> = data.stackings.iter().map(|stacking| known(stacking, data)).collect();
    whereabouts::section(page, &data.labels, &known, data.area_mm2)?;
    for (n, picture) in pictures.enumerate() {
        if n == 0 {
            writeln!(page, "<h2>Pictures</h2>")?;
        }
        figure(page, picture)?;
    }
    health(page, &data.health)?;
    if !data.generator.is_empty() {
        writeln!(page, "<footer>Written by {}</footer>", escape(&data.generator))?;
    }
    writeln!(page, "</main>")
}

/// What it comes to: the first sentence large, the rest as a list.
fn verdict(page: &mut String, sentences: &[String]) -> fmt::Result {
    let Some((first, rest)) = sentences.split_first() else { return Ok(()) };
    writeln!(page, "<section class=\"verdict\">\n<p class=\"lead\">{}</p>\n<ul>", escape(first))?;
    for sentence in rest {
        writeln!(page, "<li>{}</li>", escape(sentence))?;
    }
    writeln!(page, "</ul>\n</section>")
}

/// The numbers behind the look, to be unfolded.
fn numbers_of_look(page: &mut String, sentences: &[String]) -> fmt::Result {
    if sentences.is_empty() {
        return Ok(());
    }
    writeln!(page, "<details class=\"numbers\">\n<summary>Numbers of the look</summary>\n<ul>")?;
    for sentence in sentences {
        writeln!(page, "<li>{}</li>", escape(sentence))?;
    }
    writeln!(page, "</ul>\n</details>")
}

/// What the page tells of a stacking where it is pointed at.
fn known(stacking: &ReportStacking, data: &ReportData) -> Known {
    let mut words = words_of(stacking, data);
    if let Some(share) = stacking.share {
        let _ = write!(words, "; {} % of the surface", number(100.0 * share, 1));
    }
    let colour = stacking.albedo[0].or(stacking.albedo[1]).unwrap_or([160; 3]);
    Known { name: stacking.name.clone(), origin: stacking.origin, words, colour }
}

/// The picture of the object cut open.
const CUTAWAY: &str = "preview/cutaway.png";

/// A picture of one slice, and a slider to choose it by.
fn film(page: &mut String, film: &ReportFilm) -> fmt::Result {
    let FilmStrip { frames, columns, rows, pixels: [width, height], size_mm, height_mm } = film.layout;
    if frames < 2 {
        return Ok(());
    }
    writeln!(page, "<h2>Slices</h2>\n<div class=\"film\">")?;
    write!(page, "<div id=\"frame\" role=\"img\" aria-label=\"One slice, seen from above\" style=\"")?;
    // As wide as the page has room for, and no higher than a window.
    let high = f64::from(width as u32) / f64::from((height as u32).max(1)) * 34.0;
    write!(
        page,
        "aspect-ratio:{width}/{height};max-width:min({}px,{}rem);",
        (3 * width).clamp(240, 760),
        number(high, 1)
    )?;
    write!(page, "background-size:{}% {}%;", 100 * columns, 100 * rows)?;
    writeln!(page, "background-image:url({})\"></div>", png_address(&film.png))?;
    let middle = frames / 2;
    writeln!(page, "<label for=\"slice\">Height <output id=\"height\"></output>")?;
    writeln!(
        page,
        "<input id=\"slice\" type=\"range\" min=\"0\" max=\"{}\" value=\"{middle}\"></label>\n</div>",
        frames - 1
    )?;
    let [across, along] = size_mm.map(|mm| number(mm, 1));
    writeln!(page, "<p class=\"note\">{across} × {along} mm seen from above, in the colours of the resins.</p>")?;
    writeln!(
        page,
        "<script>\n(() => {{\n  const slider = document.getElementById(\"slice\");\n  const show = () => {{\n    \
         const n = Number(slider.value);\n    document.getElementById(\"frame\").style.backgroundPosition =\n      \
         `${{100 * (n % {columns}) / {}}}% ${{100 * Math.floor(n / {columns}) / {}}}%`;\n    \
         document.getElementById(\"height\").textContent = ((n + 0.5) * {} / {frames}).toFixed(2) + \" mm\";\n  }};\n  \
         slider.addEventListener(\"input\", show);\n  show();\n}})();\n</script>",
        (columns - 1).max(1),
        rows.max(2) - 1,
        number(height_mm, 4),
    )
}

fn on(printer: &str) -> String {
    if printer.is_empty() { String::new() } else { format!(" on {}", escape(printer)) }
}

fn warnings(page: &mut String, warnings: &[String]) -> fmt::Result {
    if warnings.is_empty() {
        return Ok(());
    }
    let title = counted(warnings.len(), "warning");
    writeln!(page, "<section class=\"warnings\">\n<strong>{title}</strong>\n<ul>")?;
    for warning in warnings {
        writeln!(page, "<li>{}</li>", escape(warning))?;
    }
    writeln!(page, "</ul>\n</section>")
}

fn figure(page: &mut String, picture: &ReportPicture) -> fmt::Result {
    let caption = escape(&picture.caption);
    let shown = |png: &[u8]| if png.is_empty() { escape(&url(&picture.path)) } else { png_address(png) };
    if picture.panels.is_empty() {
        writeln!(page, "<figure class=\"drawn\">\n<img src=\"{}\" alt=\"{caption}\">", shown(&picture.png))?;
    } else {
        writeln!(page, "<figure class=\"panels n{}\">", picture.panels.len())?;
    }
    for (name, png) in &picture.panels {
        writeln!(page, "<div><img src=\"{}\" alt=\"{name}: {caption}\"><span>{name}</span></div>", shown(png))?;
    }
    if !caption.is_empty() {
        writeln!(page, "<figcaption>{caption}</figcaption>")?;
    }
    writeln!(page, "</figure>")
}

/// Both arguments are escaped already.
fn fact(page: &mut String, name: &str, value: &str) -> fmt::Result {
    writeln!(page, "<dt>{name}</dt><dd>{value}</dd>")
}

fn materials(page: &mut String, data: &ReportData) -> fmt::Result {
    if data.materials.is_empty() {
        return Ok(());
    }
    writeln!(page, "<h2>Materials</h2>\n<div class=\"wide\"><table>\n<thead><tr><th></th><th>Material</th>")?;
    for heading in ["Voxels", "Volume, mm³", "Mass, g"] {
        writeln!(page, "<th class=\"number\">{heading}</th>")?;
    }
    writeln!(page, "</tr></thead>\n<tbody>")?;
    let row = |page: &mut String, swatch: &str, name: &str, voxels: u64, volume: f64, grams: Option<f64>| {
        let mass = grams.map_or_else(|| "–".to_owned(), |grams| decimals(grams, 2));
        writeln!(page, "<tr><td>{swatch}</td><td>{name}</td>")?;
        for value in [thousands(voxels), decimals(volume, 1), mass] {
            writeln!(page, "<td class=\"number\">{value}</td>")?;
        }
        writeln!(page, "</tr>")
    };
    for material in &data.materials {
        let mut swatch = String::new();
        svg(&mut swatch, "swatch", [26.0, 22.0], &material.name)?;
        block(&mut swatch, [0.0, 25.0], material.rgba)?;
        swatch.push_str("</svg>");
        let note = if material.rgba[3] == 0 { " <span class=\"words\">the printer fills it</span>" } else { "" };
        let name = format!("{}{note}", escape(&material.name));
        row(page, &swatch, &name, material.voxels, material.volume_mm3, material.grams)?;
    }
    writeln!(page, "</tbody>\n<tfoot>")?;
    let grams = data.materials.iter().map(|material| material.grams).sum::<Option<f64>>();
    let voxels = data.materials.iter().map(|material| material.voxels).sum();
    row(page, "", "Sum", voxels, data.materials.iter().map(|material| material.volume_mm3).sum(), grams)?;
    writeln!(page, "</tfoot>\n</table></div>")?;
    if !data.materials_note.is_empty() {
        writeln!(page, "<p class=\"note\">{}</p>", escape(&data.materials_note))?;
    }
    Ok(())
}

fn stackings(page: &mut String, data: &ReportData) -> fmt::Result {
    if data.stackings.is_empty() {
        return Ok(());
    }
    let thickness =
        |stacking: &ReportStacking| stacking.stack.pairs().map(|(_, mm)| mm.max(0.0)).fold(0.0, |sum, mm| sum + mm);
    let thickest = data.stackings.iter().map(thickness).fold(0.0, f64::max);
    let scale = if thickest.is_finite() && thickest > 0.0 { BAR / thickest } else { 0.0 };
    let shares = data.stackings.iter().any(|stacking| stacking.share.is_some());
    let errors = data.stackings.iter().any(|stacking| stacking.error.is_some());
    let error_name = if data.error_name.is_empty() { "Error" } else { &data.error_name };
    writeln!(page, "<h2>Stackings</h2>")?;
    write!(page, "<p class=\"note\">Layers from the surface (left) inwards, thickness in mm, all to one scale")?;
    let core = data.stackings.iter().any(|stacking| stacking.stack.core.is_some());
    writeln!(page, "{}.</p>", if core { "; the last block is the core, which goes on" } else { "" })?;
    let folded = data.stackings.len() > FOLDED;
    if folded {
        writeln!(page, "<details>\n<summary>All {} stackings</summary>", data.stackings.len())?;
    }
    let swatches = data.stackings.iter().any(|stacking| stacking.albedo != [None; 2]);
    writeln!(page, "<div class=\"wide\"><table class=\"stackings\">\n<thead><tr><th>Stacking</th>")?;
    if swatches {
        writeln!(page, "<th>Asked, predicted</th>")?;
    }
    writeln!(page, "<th>Layers</th>")?;
    let headings = [(shares, "Surface"), (true, "Thickness, mm"), (errors, error_name)];
    for (_, heading) in headings.iter().filter(|(shown, _)| *shown) {
        writeln!(page, "<th class=\"number\">{}</th>", escape(heading))?;
    }
    writeln!(page, "</tr></thead>\n<tbody>")?;
    for (n, stacking) in data.stackings.iter().enumerate() {
        let name = escape(&stacking.name);
        match data.labels.is_empty() {
            true => writeln!(page, "<tr><td>{name}</td>")?,
            false => {
                writeln!(page, "<tr><td><button class=\"find\" type=\"button\" value=\"{n}\">{name}</button></td>")?
            }
        }
        if swatches {
            writeln!(page, "<td class=\"pair\">")?;
            for (name, albedo) in ["asked", "predicted"].iter().zip(stacking.albedo) {
                if let Some([r, g, b]) = albedo {
                    let colour = format!("#{r:02x}{g:02x}{b:02x}");
                    svg(page, "swatch", [26.0, 22.0], &format!("{name} {colour}"))?;
                    writeln!(page, "<rect width=\"26\" height=\"22\" fill=\"{colour}\"/></svg>")?;
                }
            }
            writeln!(page, "</td>")?;
        }
        writeln!(page, "<td>")?;
        bar(page, stacking, data, scale)?;
        writeln!(page, "</td>")?;
        let share = stacking.share.map_or_else(|| "–".to_owned(), |share| format!("{} %", number(100.0 * share, 1)));
        let error = stacking.error.map_or_else(|| "–".to_owned(), significant);
        let values = [share, decimals(thickness(stacking), 3), error];
        for ((_, heading), value) in headings.iter().zip(values).filter(|((shown, _), _)| *shown) {
            writeln!(page, "<td class=\"number\" data-name=\"{}\">{value}</td>", escape(heading))?;
        }
        writeln!(page, "</tr>")?;
    }
    writeln!(page, "</tbody>\n</table></div>")?;
    if folded { writeln!(page, "</details>") } else { Ok(()) }
}

/// More stackings than that are folded away.
const FOLDED: usize = 8;

/// A stacking's layers side by side, to scale, and what they are in words.
fn bar(page: &mut String, stacking: &ReportStacking, data: &ReportData, scale: f64) -> fmt::Result {
    let colour_of = |resin: ResinId| data.materials.get(resin.0).map_or([128, 128, 128, 255], |found| found.rgba);
    let colour = |mixture: &Mixture| -> [u8; 4] {
        let parts =
            mixture.parts().iter().map(|&(resin, share)| colour_of(resin).map(|value| share * f64::from(value)));
        let mean = parts.fold([0.0; 4], |sum, part| std::array::from_fn(|n| sum[n] + part[n]));
        mean.map(|value| value.round() as u8)
    };
    let stack = &stacking.stack;
    let words = words_of(stacking, data);
    svg(page, "bar", [BAR + CORE, BAR_HEIGHT], &words)?;
    let mut left = 0.0;
    for layer in &stack.layers {
        let width = layer.thickness_mm.max(0.0) * scale;
        block(page, [left, width], colour(&layer.resin))?;
        if width >= NUMBERED {
            let ink = if is_dark(colour(&layer.resin)) { "#fff" } else { "#1f2630" };
            let (x, text) = (left + 0.5 * width, number(layer.thickness_mm, 2));
            // On the hatch a number needs a ground of its own.
            let halo = if colour(&layer.resin)[3] == 0 {
                " paint-order=\"stroke\" stroke=\"#f1dfb6\" stroke-width=\"4\""
            } else {
                ""
            };
            write!(page, "<text x=\"{x:.2}\" y=\"15.5\" text-anchor=\"middle\" font-size=\"12\"")?;
            write!(page, " fill=\"{ink}\"{halo}>{text}</text>")?;
        }
        left += width;
    }
    if let Some(core) = &stack.core {
        // A torn end: the core goes on.
        let [r, g, b, a] = colour(core);
        let fill = if a == 0 { "#f1dfb6".to_owned() } else { format!("#{r:02x}{g:02x}{b:02x}") };
        let (tooth, width) = ((BAR_HEIGHT - 1.0) / 4.0, CORE - 8.0);
        write!(page, "<path d=\"M{:.2} 0.5h{width}", left + 0.5)?;
        write!(page, "l-5 {tooth}l5 {tooth}l-5 {tooth}l5 {tooth}h-{width}z\"")?;
        write!(page, " fill=\"{fill}\" stroke=\"#5b6674\" stroke-width=\"0.75\"/>")?;
    }
    writeln!(page, "</svg><span class=\"words\">{}</span>", escape(&words))
}

/// The layers of a stacking and its core.
fn words_of(stacking: &ReportStacking, data: &ReportData) -> String {
    let name = |mixture: &Mixture| mixture.name(|resin| data.materials.get(resin.0).map_or("?", |found| &found.name));
    let stack = &stacking.stack;
    let mut words: Vec<String> =
        stack.pairs().map(|(layer, mm)| format!("{} {}", name(layer), number(mm, 3))).collect();
    words.extend(stack.core.as_ref().map(|core| format!("core {}", name(core))));
    words.join(", ")
}

fn svg(page: &mut String, class: &str, [width, height]: [f64; 2], title: &str) -> fmt::Result {
    write!(page, "<svg class=\"{class}\" width=\"{width}\" height=\"{height}\" viewBox=\"0 0 {width} {height}\"")?;
    write!(page, " role=\"img\" aria-label=\"{}\">", escape(title))
}

/// A rectangle over the height of a bar: left edge and width.
fn block(page: &mut String, [left, width]: [f64; 2], [r, g, b, a]: [u8; 4]) -> fmt::Result {
    let (top, height) = (0.5, BAR_HEIGHT - 1.0);
    let fill = if a == 0 { "#f1dfb6".to_owned() } else { format!("#{r:02x}{g:02x}{b:02x}") };
    if a == 0 {
        // Hatch lines, clipped by hand: no ids that a page could hold twice.
        write!(page, "<path fill=\"{fill}\" d=\"M{left:.2} {top}h{width:.2}v{height}h-{width:.2}z\"/>")?;
        let mut at = left - height + 3.0;
        write!(page, "<path stroke=\"#cfa85c\" stroke-width=\"1.2\" d=\"")?;
        while at < left + width {
            let (from, to) = (at.max(left), (at + height).min(left + width));
            if to > from {
                let y = |x: f64| top + height - (x - at);
                write!(page, "M{from:.2} {:.2}L{to:.2} {:.2}", y(from), y(to))?;
            }
            at += 7.0;
        }
        write!(page, "\"/>")?;
    }
    let fill = if a == 0 { "none" } else { &fill };
    write!(page, "<rect x=\"{:.2}\" y=\"{top}\" width=\"{width:.2}\" height=\"{height}\"", left + 0.5)?;
    write!(page, " fill=\"{fill}\" stroke=\"#5b6674\" stroke-width=\"0.75\"/>")
}

fn health(page: &mut String, health: &[ReportHealth]) -> fmt::Result {
    if health.is_empty() {
        return Ok(());
    }
    writeln!(page, "<h2>Meshes</h2>")?;
    for mesh in health {
        writeln!(page, "<h3>{}</h3>\n<dl>", escape(&mesh.object))?;
        for (name, value) in &mesh.findings {
            fact(page, &escape(name), &escape(value))?;
        }
        writeln!(page, "</dl>")?;
    }
    Ok(())
}

fn is_dark([r, g, b, a]: [u8; 4]) -> bool {
    a != 0 && 2 * u32::from(r) + 5 * u32::from(g) + u32::from(b) < 8 * 120
}

/// A relative path as a URL that stays relative: bytes beyond the unreserved ones are percent-encoded.
fn url(path: &str) -> String {
    let mut out = String::new();
    for byte in path.trim_start_matches('/').bytes() {
        if byte.is_ascii_alphanumeric() || b"-._~/".contains(&byte) {
            out.push(char::from(byte));
        } else {
            let _ = write!(out, "%{byte:02X}");
        }
    }
    out
}

fn times(parts: [String; 3]) -> String {
    parts.join(" × ")
}

/// At most `digits` decimals, without trailing zeros.
fn number(value: f64, digits: usize) -> String {
    let text = format!("{value:.digits$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

/// Exactly `digits` decimals, for columns; thousands grouped.
fn decimals(value: f64, digits: usize) -> String {
    let text = format!("{value:.digits$}");
    let (whole, part) = text.split_once('.').unwrap_or((&text, ""));
    whole.parse().map_or_else(|_| text.clone(), |whole| format!("{}.{part}", thousands(whole)))
}

fn significant(value: f64) -> String {
    let size = value.abs();
    if value == 0.0 || (0.001..1000.0).contains(&size) { number(value, 4) } else { format!("{value:.2e}") }
}

/// Digits in groups of three, with narrow no-break spaces.
fn thousands(value: u64) -> String {
    let digits = value.to_string();
    let mut out = String::new();
    for (n, digit) in digits.chars().enumerate() {
        if n > 0 && (digits.len() - n).is_multiple_of(3) {
            out.push('\u{202f}');
        }
        out.push(digit);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    fn data() -> ReportData {
        ReportData {
            job: "<b>\"rabbit\" & co</b>".into(),
            dims: [1420, 700, 2222],
            pitch_mm: [0.0423, 0.0847, 0.027],
            materials: vec![
                ReportMaterial { name: "white".into(), rgba: [255; 4], voxels: 1_234_567, ..Default::default() },
                ReportMaterial { name: "sup<port".into(), rgba: [0; 4], grams: Some(1.0), ..Default::default() },
            ],
            stackings: vec![ReportStacking {
                name: "all".into(),
                stack: Stack::new([(ResinId(0), 0.5), (ResinId(1), 2.0)]).over(ResinId(7)).into(),
                ..Default::default()
            }],
            warnings: vec!["x < y".into()],
            pictures: vec![ReportPicture {
                path: "preview/a b\".png".into(),
                caption: "it's".into(),
                ..Default::default()
            }],
            ..Default::default()
        }
    }

    #[test]
    fn whatever_the_texts_hold_stays_text() {
        let page = report_html(&data());
        assert!(page.contains("<h1>&lt;b&gt;&quot;rabbit&quot; &amp; co&lt;/b&gt;</h1>"));
        assert!(page.contains("src=\"preview/a%20b%22.png\""));
        assert!(!page.contains("<b>") && !page.contains("sup<port") && !page.contains("x < y"));
        assert!(!page.contains("<script") && !page.contains("http"));
    }

    #[test]
    fn tags_are_balanced() {
        let page = report_html(&data());
        let body = &page[page.find("<body>").unwrap()..];
        let mut open: Vec<&str> = Vec::new();
        for tag in body.split('<').skip(1).map(|rest| &rest[..rest.find('>').unwrap()]) {
            let name = tag.split([' ', '\n']).next().unwrap();
            if let Some(name) = name.strip_prefix('/') {
                if name != "html" {
                    assert_eq!(open.pop(), Some(name));
                }
            } else if !tag.ends_with('/') && name != "img" {
                open.push(name);
            }
        }
        assert_eq!(open, [""; 0]);
    }

    #[test]
    fn bars_are_to_scale() {
        let page = report_html(&data());
        let bar = &page[page.find("class=\"bar\"").unwrap()..];
        let widths: Vec<f64> = bar
            .split("<rect ")
            .skip(1)
            .take(2)
            .map(|rect| rect.split("width=\"").nth(1).unwrap().split('"').next().unwrap().parse().unwrap())
            .collect();
        assert!((widths[1] / widths[0] - 4.0).abs() < 1e-3 && (widths[0] + widths[1] - BAR).abs() < 0.02, "{widths:?}");
    }

    #[test]
    fn an_empty_report_is_a_page() {
        let page = report_html(&ReportData::default());
        assert!(page.starts_with("<!DOCTYPE html>") && page.trim_end().ends_with("</html>"));
        assert!(!page.contains("NaN") && !page.contains("inf"));
    }

    #[test]
    fn numbers_read_well() {
        assert_eq!(thousands(1_234_567), "1\u{202f}234\u{202f}567");
        assert_eq!([number(2.0, 3), number(0.25, 3), number(100.0, 0)], ["2", "0.25", "100"]);
        assert_eq!([decimals(24502.41, 1), decimals(0.0, 2), decimals(-1.5, 1)], ["24\u{202f}502.4", "0.00", "-1.5"]);
        assert_eq!([significant(8e-15), significant(0.0123), significant(0.0)], ["8.00e-15", "0.0123", "0"]);
    }
}
