//! A page to read beside the print: one HTML file with its pictures in it, that can be mailed. It needs no script but
//! for leafing through slices and for turning the surface.

mod data;
mod numbers;
mod stackings;

use std::fmt::{self, Write};

pub use data::{ReportData, ReportFilm, ReportHealth, ReportMaterial, ReportPicture, ReportStacking};
use numbers::{decimals, number, thousands};
use stackings::{block, stackings, svg, words_of};

use super::{
    FilmStrip,
    whereabouts::{self, Known},
};
use crate::{
    page::{escape, page, png_address},
    words::counted,
};

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

#[cfg(test)]
mod tests {
    use super::{stackings::BAR, *};
    use crate::optics::{ResinId, Stack};

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
}
