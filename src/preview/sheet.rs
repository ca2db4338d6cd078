//! Slices as pictures: many on one sheet, or one large.

use super::{
    canvas::{Canvas, Rect},
    legend::{Legend, millimetres},
    section::Section,
    style::{FAINT, INK, Linear, PAGE, PANEL, PANEL_EDGE, Palette, encoded, linear, mix},
    text::Font,
};
use crate::parallel;
use crate::voxel::Lattice;

/// Width and height that pictures stay within, pixels: a conference slide.
pub(super) const PICTURE: [usize; 2] = [1920, 1080];
/// Around everything.
pub(super) const MARGIN: usize = 44;
/// Between panels.
const GAP: usize = 28;
/// Between a title and what follows, and between that and the foot.
pub(super) const BLOCK_GAP: usize = 26;
/// Points per pixel and axis that colours are averaged over.
const POINTS: usize = 3;
/// Strength of the outline between solid and background.
const OUTLINE: f32 = 0.75;

/// All slices on one sheet, at one scale.
pub(super) fn contact_sheet(lattice: &Lattice, slices: &[Section], palette: &Palette, legend: &Legend) -> Canvas {
    let captions: Vec<[String; 2]> =
        slices.iter().map(|section| [height_text(lattice, section.index), format!("#{}", section.index)]).collect();
    let caption_width = captions
        .iter()
        .map(|[height, index]| Font::Strong.width(height) + 16 + Font::Small.width(index))
        .max()
        .unwrap_or(0);
    let caption = Font::Strong.height() + 4;
    let size = slices.first().map_or([1.0, 1.0], |section| section.size_mm);
    let top = MARGIN + Font::Title.height() + BLOCK_GAP;
    let foot_guess = legend.layout(PICTURE[0] - 2 * MARGIN, 1.0).height;
    let room = [PICTURE[0] - 2 * MARGIN, PICTURE[1].saturating_sub(top + BLOCK_GAP + foot_guess + MARGIN).max(400)];

    // The number of columns that makes slices largest.
    let count = slices.len().max(1);
    let scale_for = |columns: usize| {
        let rows = count.div_ceil(columns);
        let width = (room[0] + GAP) as f64 / columns as f64 - GAP as f64;
        let height = (room[1] + GAP) as f64 / rows as f64 - (GAP + caption) as f64;
        let fits = width >= caption_width as f64 && height >= 1.0;
        if fits { (width / size[0]).min(height / size[1]) } else { 0.0 }
    };
    let (columns, scale) = (1..=count)
        .map(|columns| (columns, scale_for(columns)))
        .reduce(|best, next| if next.1 > best.1 { next } else { best })
        .unwrap_or((1, 1.0));
    let [width, height] = pixels(size, scale);
    let pitch = [width.max(caption_width) + GAP, height + caption + GAP];
    let rows = count.div_ceil(columns);
    let title = format!("Slices 0 to {}", lattice.dims[2].saturating_sub(1));
    let content = (columns * pitch[0] - GAP).max(legend.min_width()).max(Font::Title.width(&title));
    let foot = legend.layout(content, scale);
    let foot_y = top + rows * pitch[1] - GAP + BLOCK_GAP;

    let mut canvas = Canvas::new(content + 2 * MARGIN, foot_y + foot.height + MARGIN, PAGE);
    Font::Title.draw(&mut canvas, [MARGIN, MARGIN], &title, INK);
    side_note(&mut canvas, &title, "seen from above, x to the right, y upwards");
    for (n, (section, [label, index])) in slices.iter().zip(&captions).enumerate() {
        let (x, y) = (MARGIN + n % columns * pitch[0], top + n / columns * pitch[1]);
        Font::Strong.draw(&mut canvas, [x, y], label, INK);
        Font::Small.draw(&mut canvas, [x + Font::Strong.width(label) + 16, y + 3], index, FAINT);
        draw_section(&mut canvas, Rect { x, y: y + caption, width, height }, section, palette);
    }
    legend.draw(&mut canvas, [MARGIN, foot_y], &foot, palette);
    canvas
}

/// One slice, as large as a slide.
pub(super) fn single_slice(lattice: &Lattice, section: &Section, palette: &Palette, legend: &Legend) -> Canvas {
    let title = format!("Slice {}", section.index);
    let note = format!("{}   of {} slices", height_text(lattice, section.index), lattice.dims[2]);
    let top = MARGIN + Font::Title.height() + BLOCK_GAP;
    let foot_guess = legend.layout(PICTURE[0] - 2 * MARGIN, 1.0).height;
    let room = [PICTURE[0] - 2 * MARGIN, PICTURE[1].saturating_sub(top + BLOCK_GAP + foot_guess + MARGIN).max(400)];
    let scale = (room[0] as f64 / section.size_mm[0]).min(room[1] as f64 / section.size_mm[1]);
    let [width, height] = pixels(section.size_mm, scale);
    let words = Font::Title.width(&title) + 24 + Font::Normal.width(&note);
    let content = width.max(legend.min_width()).max(words);
    let foot = legend.layout(content, scale);
    let foot_y = top + height + BLOCK_GAP;
    let mut canvas = Canvas::new(content + 2 * MARGIN, foot_y + foot.height + MARGIN, PAGE);
    Font::Title.draw(&mut canvas, [MARGIN, MARGIN], &title, INK);
    side_note(&mut canvas, &title, &note);
    draw_section(&mut canvas, Rect { x: MARGIN + (content - width) / 2, y: top, width, height }, section, palette);
    legend.draw(&mut canvas, [MARGIN, foot_y], &foot, palette);
    canvas
}

/// Words beside the title, if there is room.
pub(super) fn side_note(canvas: &mut Canvas, title: &str, note: &str) {
    let x = MARGIN + Font::Title.width(title) + 24;
    if x + Font::Normal.width(note) + MARGIN <= canvas.width {
        Font::Normal.draw(canvas, [x, MARGIN + 6], note, FAINT);
    }
}

/// Pixels of an extent, at least 1 each.
pub(super) fn pixels(size_mm: [f64; 2], scale: f64) -> [usize; 2] {
    size_mm.map(|length| ((length * scale) as usize).clamp(1, 4 * PICTURE[0]))
}

/// Height of a slice's centre above the build plate's lattice origin.
fn height_text(lattice: &Lattice, k: u32) -> String {
    format!("z {}", millimetres(lattice.coordinate(2, k)))
}

/// Fills `rect` with a section: colours averaged in linear light, a thin outline around what is solid.
pub(super) fn draw_section(canvas: &mut Canvas, rect: Rect, section: &Section, palette: &Palette) {
    canvas.frame(rect, PANEL_EDGE);
    let mut colours: Vec<(Linear, f32)> = vec![([0.0; 3], 0.0); rect.width * rect.height];
    let panel = linear(PANEL);
    let [w, h] = section.pixels;
    // The source pixel under a point; POINTS points per pixel.
    let place = |n: usize, length: usize, of: usize| {
        (((n as f64 + 0.5) / (length * POINTS) as f64 * of as f64) as usize).min(of - 1)
    };
    let columns: Vec<usize> = (0..rect.width * POINTS).map(|n| place(n, rect.width, w)).collect();
    parallel::rows(&mut colours, rect.width, |y, row| {
        let rows: [&[u8]; POINTS] = std::array::from_fn(|n| {
            let y = place(y * POINTS + n, rect.height, h);
            &section.ids[y * w..(y + 1) * w]
        });
        for (x, ((colour, solid), columns)) in row.iter_mut().zip(columns.chunks_exact(POINTS)).enumerate() {
            let along = (x + y) as f32;
            let (mut sum, mut filled) = ([0.0; 3], 0);
            for row in rows {
                for &column in columns {
                    let point = palette.at(row[column], along);
                    filled += u32::from(point.is_some());
                    let point = point.unwrap_or(panel);
                    sum = std::array::from_fn(|c| sum[c] + point[c]);
                }
            }
            let points = (POINTS * POINTS) as f32;
            *colour = sum.map(|v| v / points);
            *solid = filled as f32 / points;
        }
    });
    let solid = |x: usize, y: usize| {
        // Outside of the panel wraps to a huge index and counts as background.
        if x < rect.width && y < rect.height { colours[x + rect.width * y].1 } else { 0.0 }
    };
    let ink = linear(INK);
    for y in 0..rect.height {
        for x in 0..rect.width {
            let (colour, own) = colours[x + rect.width * y];
            let beside =
                [(x.wrapping_sub(1), y), (x + 1, y), (x, y.wrapping_sub(1)), (x, y + 1)].map(|(x, y)| solid(x, y));
            let least = beside.into_iter().fold(1.0, f32::min);
            let edge = own * (1.0 - least.min(own));
            canvas.blend(rect.x + x, rect.y + y, encoded(mix(colour, ink, OUTLINE * edge)), 1.0);
        }
    }
}
