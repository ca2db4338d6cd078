//! A drawing as SVG. Glyphs are defined once and used by name; a name always means the same outline, so that several
//! plots may stand in one page.

use std::{
    collections::BTreeSet,
    fmt::{Display, Formatter, Result, Write},
};

use super::{
    Rgb,
    colour::PAPER,
    drawing::{Drawing, Item, Point, Step},
    font::{Line, Weight, outline},
};
use crate::{
    page::base64,
    picture::{Pixels, png},
};

/// The text of the file.
pub(super) fn encode(drawing: &Drawing, title: &str) -> String {
    let (width, height) = (Number(drawing.width), Number(drawing.height));
    let mut out = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" viewBox=\"0 0 {width} \
            {height}\" \
         role=\"img\">\n<title>{}</title>\n<defs>\n",
        Escaped(title)
    );
    let used: BTreeSet<(Weight, u16)> = drawing
        .items
        .iter()
        .filter_map(|item| if let Item::Text { line, .. } = item { Some(line) } else { None })
        .flat_map(|line| line.glyphs.iter().map(|glyph| (line.weight, glyph.id)))
        .collect();
    for (weight, id) in used {
        let outline = outline(weight, id);
        if !outline.is_empty() {
            // Thousandths of an em are the font's own units.
            let steps = Steps { steps: &outline, scale: 1000.0 };
            line(&mut out, format_args!("<path id=\"{}{id}\" d=\"{steps}\"/>", letter(weight)));
        }
    }
    line(&mut out, format_args!("</defs>\n<rect width=\"100%\" height=\"100%\" fill=\"{}\"/>", Hex(PAPER)));
    for item in &drawing.items {
        push(&mut out, item);
    }
    out + "</svg>\n"
}

fn push(out: &mut String, item: &Item) {
    match item {
        Item::Fill { outline, colour, opacity } => {
            let (steps, fill) = (Steps { steps: outline, scale: 1.0 }, Hex(*colour));
            line(out, format_args!("<path d=\"{steps}\" fill=\"{fill}\"{}/>", Opacity("fill", *opacity)));
        }
        Item::Stroke { outline, colour, opacity, width, dash } => {
            let (steps, stroke) = (Steps { steps: outline, scale: 1.0 }, Hex(*colour));
            let dash = dash.map_or(String::new(), |[on, off]| format!(" stroke-dasharray=\"{on} {off}\""));
            line(
                out,
                format_args!(
                    "<path d=\"{steps}\" fill=\"none\" stroke=\"{stroke}\" stroke-width=\"{}\" \
                        stroke-linejoin=\"round\"{dash}{}/>",
                    Number(*width),
                    Opacity("stroke", *opacity),
                ),
            );
        }
        Item::Text { line: text, at, upright, colour } => push_text(out, text, *at, *upright, *colour),
        Item::Image { columns, pixels, at, size } => {
            let Ok(file) = png(*columns, Pixels::Rgb8(pixels)) else { return };
            let ([x, y], [width, height]) = (at.map(Number), size.map(Number));
            line(
                out,
                format_args!(
                    "<image x=\"{x}\" y=\"{y}\" width=\"{width}\" height=\"{height}\" preserveAspectRatio=\"none\" \
                     style=\"image-rendering:pixelated\" href=\"data:image/png;base64,{}\"/>",
                    base64(&file)
                ),
            );
        }
    }
}

fn push_text(out: &mut String, text: &Line, [x, y]: Point, upright: bool, colour: Rgb) {
    let turn = if upright { " rotate(-90)" } else { "" };
    let scale = 1e-3 * text.size;
    let place = format!("translate({} {}){turn} scale({})", Number(x), Number(y), Fine(scale));
    let (label, fill) = (Escaped(&text.text), Hex(colour));
    let mut uses = String::new();
    for glyph in text.glyphs.iter().filter(|glyph| !outline(text.weight, glyph.id).is_empty()) {
        let [x, y] = glyph.at.map(|along| along / scale);
        let up = if y == 0.0 { String::new() } else { format!(" y=\"{}\"", Number(y)) };
        let _ = write!(uses, "<use href=\"#{}{}\" x=\"{}\"{up}/>", letter(text.weight), glyph.id, Number(x));
    }
    line(out, format_args!("<g transform=\"{place}\" fill=\"{fill}\" role=\"text\" aria-label=\"{label}\">{uses}</g>"));
}

fn letter(weight: Weight) -> char {
    match weight {
        Weight::Regular => 'n',
        Weight::Bold => 'b',
    }
}

fn line(out: &mut String, text: std::fmt::Arguments<'_>) {
    // Writing to a string cannot fail.
    let _ = out.write_fmt(text);
    out.push('\n');
}

/// To a hundredth of a unit, without idle zeros.
struct Number(f64);

impl Display for Number {
    fn fmt(&self, f: &mut Formatter<'_>) -> Result {
        let hundredths = (self.0 * 100.0).round() as i64;
        write!(f, "{}", hundredths as f64 / 100.0)
    }
}

/// To a millionth.
struct Fine(f64);

impl Display for Fine {
    fn fmt(&self, f: &mut Formatter<'_>) -> Result {
        write!(f, "{}", (self.0 * 1e6).round() / 1e6)
    }
}

struct Hex(Rgb);

impl Display for Hex {
    fn fmt(&self, f: &mut Formatter<'_>) -> Result {
        let [r, g, b] = self.0;
        write!(f, "#{r:02x}{g:02x}{b:02x}")
    }
}

/// An attribute, left out where all is opaque.
struct Opacity(&'static str, f64);

impl Display for Opacity {
    fn fmt(&self, f: &mut Formatter<'_>) -> Result {
        if self.1 < 1.0 { write!(f, " {}-opacity=\"{}\"", self.0, Number(self.1)) } else { Ok(()) }
    }
}

struct Escaped<'a>(&'a str);

impl Display for Escaped<'_> {
    fn fmt(&self, f: &mut Formatter<'_>) -> Result {
        for c in self.0.chars() {
            match c {
                '&' => f.write_str("&amp;")?,
                '<' => f.write_str("&lt;")?,
                '>' => f.write_str("&gt;")?,
                '"' => f.write_str("&quot;")?,
                // XML 1.0 has no way to say most of these.
                c if c.is_control() => f.write_char(' ')?,
                c => f.write_char(c)?,
            }
        }
        Ok(())
    }
}

/// The `d` of a path.
struct Steps<'a> {
    steps: &'a [Step],
    scale: f64,
}

impl Display for Steps<'_> {
    fn fmt(&self, f: &mut Formatter<'_>) -> Result {
        let p = |[x, y]: Point| format!("{} {}", Number(x * self.scale), Number(y * self.scale));
        for step in self.steps {
            match *step {
                Step::Move(to) => write!(f, "M{}", p(to))?,
                Step::Line(to) => write!(f, "L{}", p(to))?,
                Step::Quad(by, to) => write!(f, "Q{} {}", p(by), p(to))?,
                Step::Cubic(from, by, to) => write!(f, "C{} {} {}", p(from), p(by), p(to))?,
                Step::Close => f.write_char('Z')?,
            }
        }
        Ok(())
    }
}
