//! A drawing as PNG, two pixels to a unit.

use tiny_skia::{
    Color, FillRule, FilterQuality, LineJoin, Paint, Path, PathBuilder, Pixmap, PixmapPaint, Shader, Stroke,
    StrokeDash, Transform,
};

use super::{
    PlotError, Rgb,
    colour::PAPER,
    drawing::{Drawing, Item, Point, Step},
    font::outline,
};
use crate::picture::{Pixels, png};

/// Pixels per unit: a figure of one panel fills a screen.
const SCALE: f32 = 2.0;
/// A side of a picture, pixels.
const LIMIT: u32 = 16_384;

/// The bytes of the file.
pub(super) fn encode(drawing: &Drawing) -> Result<Vec<u8>, PlotError> {
    let [width, height] = [drawing.width, drawing.height].map(|side| (side * f64::from(SCALE)).ceil() as u32);
    let size = PlotError::Size { width, height, limit: LIMIT };
    if width.max(height) > LIMIT {
        return Err(size);
    }
    let Some(mut page) = Pixmap::new(width, height) else { return Err(size) };
    page.fill(colour(PAPER, 1.0));
    for item in &drawing.items {
        paint(&mut page, item);
    }
    // The page is opaque, so what is premultiplied is what is seen.
    let rgb: Vec<Rgb> = page.pixels().iter().map(|pixel| [pixel.red(), pixel.green(), pixel.blue()]).collect();
    Ok(png(width as usize, Pixels::Rgb8(&rgb))?)
}

fn colour([r, g, b]: Rgb, opacity: f64) -> Color {
    Color::from_rgba8(r, g, b, (255.0 * opacity.clamp(0.0, 1.0)).round() as u8)
}

fn ink(rgb: Rgb, opacity: f64) -> Paint<'static> {
    Paint { shader: Shader::SolidColor(colour(rgb, opacity)), anti_alias: true, ..Paint::default() }
}

fn paint(page: &mut Pixmap, item: &Item) {
    let units = Transform::from_scale(SCALE, SCALE);
    match item {
        Item::Fill { outline, colour, opacity } => {
            if let Some(path) = path(outline) {
                page.fill_path(&path, &ink(*colour, *opacity), FillRule::Winding, units, None);
            }
        }
        Item::Stroke { outline, colour, opacity, width, dash } => {
            let dash = dash.and_then(|lengths| StrokeDash::new(lengths.map(|length| length as f32).to_vec(), 0.0));
            let stroke = Stroke { width: *width as f32, line_join: LineJoin::Round, dash, ..Stroke::default() };
            if let Some(path) = path(outline) {
                page.stroke_path(&path, &ink(*colour, *opacity), &stroke, units, None);
            }
        }
        Item::Text { line, at: [x, y], upright, colour } => {
            let turn = if *upright { Transform::from_rotate(-90.0) } else { Transform::identity() };
            let start = units.pre_translate(*x as f32, *y as f32).pre_concat(turn);
            for glyph in &line.glyphs {
                let [x, y] = glyph.at.map(|along| along as f32);
                let place = start.pre_translate(x, y).pre_scale(line.size as f32, line.size as f32);
                if let Some(path) = path(&outline(line.weight, glyph.id)) {
                    page.fill_path(&path, &ink(*colour, 1.0), FillRule::Winding, place, None);
                }
            }
        }
        Item::Image { columns, pixels, at, size } => {
            let rows = pixels.len() / (*columns).max(1);
            let Some(mut cells) = Pixmap::new(*columns as u32, rows as u32) else { return };
            for (cell, [r, g, b]) in cells.pixels_mut().iter_mut().zip(pixels) {
                *cell = tiny_skia::ColorU8::from_rgba(*r, *g, *b, 255).premultiply();
            }
            let stretch = [size[0] / *columns as f64, size[1] / rows as f64].map(|part| part as f32);
            let place = units.pre_translate(at[0] as f32, at[1] as f32).pre_scale(stretch[0], stretch[1]);
            let nearest = PixmapPaint { quality: FilterQuality::Nearest, ..PixmapPaint::default() };
            page.draw_pixmap(0, 0, cells.as_ref(), &nearest, place, None);
        }
    }
}

pub(super) fn path(outline: &[Step]) -> Option<Path> {
    let mut builder = PathBuilder::new();
    let f = |[x, y]: Point| (x as f32, y as f32);
    for step in outline {
        match *step {
            Step::Move(to) => builder.move_to(f(to).0, f(to).1),
            Step::Line(to) => builder.line_to(f(to).0, f(to).1),
            Step::Quad(by, to) => builder.quad_to(f(by).0, f(by).1, f(to).0, f(to).1),
            Step::Cubic(from, by, to) => builder.cubic_to(f(from).0, f(from).1, f(by).0, f(by).1, f(to).0, f(to).1),
            Step::Close => builder.close(),
        }
    }
    builder.finish()
}
