//! The table of stackings: each as a bar of its layers, to scale.

use std::fmt::{self, Write};

use super::{
    ReportData, ReportStacking,
    numbers::{decimals, number, significant},
};
use crate::{
    optics::{Mixture, ResinId},
    page::escape,
};

/// Width of the longest stacking's bar without its core, pixels.
pub(super) const BAR: f64 = 420.0;
/// Width of the core's part.
const CORE: f64 = 36.0;
/// Height of a bar.
const BAR_HEIGHT: f64 = 22.0;
/// Layers narrower than this carry no number.
const NUMBERED: f64 = 34.0;

/// More stackings than that are folded away.
const FOLDED: usize = 8;

pub(super) fn stackings(page: &mut String, data: &ReportData) -> fmt::Result {
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
pub(super) fn words_of(stacking: &ReportStacking, data: &ReportData) -> String {
    let name = |mixture: &Mixture| mixture.name(|resin| data.materials.get(resin.0).map_or("?", |found| &found.name));
    let stack = &stacking.stack;
    let mut words: Vec<String> =
        stack.pairs().map(|(layer, mm)| format!("{} {}", name(layer), number(mm, 3))).collect();
    words.extend(stack.core.as_ref().map(|core| format!("core {}", name(core))));
    words.join(", ")
}

pub(super) fn svg(page: &mut String, class: &str, [width, height]: [f64; 2], title: &str) -> fmt::Result {
    write!(page, "<svg class=\"{class}\" width=\"{width}\" height=\"{height}\" viewBox=\"0 0 {width} {height}\"")?;
    write!(page, " role=\"img\" aria-label=\"{}\">", escape(title))
}

/// A rectangle over the height of a bar: left edge and width.
pub(super) fn block(page: &mut String, [left, width]: [f64; 2], [r, g, b, a]: [u8; 4]) -> fmt::Result {
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

fn is_dark([r, g, b, a]: [u8; 4]) -> bool {
    a != 0 && 2 * u32::from(r) + 5 * u32::from(g) + u32::from(b) < 8 * 120
}
