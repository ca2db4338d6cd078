//! Pictures of a look side by side, and one by one again.

use super::{
    PreviewError, PreviewFile,
    canvas::{Canvas, Rect},
    sheet::{BLOCK_GAP, MARGIN, side_note},
    style::{INK, PAGE, PANEL_EDGE, Rgb},
    text::Font,
};
use crate::picture::{Pixels, png};

/// One picture of several.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct LookPanel {
    /// What it shows.
    pub name: String,
    /// Row 0 on top.
    pub pixels: Vec<Rgb>,
    /// What its colours mean, drawn into its head, over the object, where there is room.
    pub scale: Option<Scale>,
}

/// A scale of false colours with equal steps between its ticks.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Scale {
    /// Colours from the left end to the right one, as many as there are.
    pub colours: Vec<Rgb>,
    /// Words at equal distances, the first and the last at the ends.
    pub ticks: Vec<&'static str>,
}

impl Scale {
    fn draw(&self, canvas: &mut Canvas, panel: Rect) {
        let [left, width] = [panel.x + SCALE_MARGIN, panel.width.saturating_sub(2 * SCALE_MARGIN)];
        let top = panel.y + SCALE_TOP;
        for x in 0..width {
            let colour = self.colours[(x * self.colours.len() / width).min(self.colours.len() - 1)];
            canvas.fill(Rect { x: left + x, y: top, width: 1, height: SCALE_HEIGHT }, colour);
        }
        canvas.frame(Rect { x: left, y: top, width, height: SCALE_HEIGHT }, PANEL_EDGE);
        let last = self.ticks.len().max(2) - 1;
        for (n, tick) in self.ticks.iter().enumerate() {
            let at = left + n * width / last;
            canvas.fill(Rect { x: at.min(left + width - 1), y: top, width: 1, height: SCALE_HEIGHT + 4 }, INK);
            let wide = Font::Small.width(tick);
            let x = match n {
                0 => at,
                n if n == last => at.saturating_sub(wide),
                _ => at.saturating_sub(wide / 2),
            };
            Font::Small.draw(canvas, [x, top + SCALE_HEIGHT + 6], tick, INK);
        }
    }
}

/// A scale's distance from the sides of its panel and from its top, its height, and the narrowest panel that has room
/// for one.
const SCALE_MARGIN: usize = 20;
const SCALE_TOP: usize = 8;
const SCALE_HEIGHT: usize = 12;
const SCALE_ROOM: usize = 240;

/// Between panels.
const GAP: usize = 24;

/// Panels of the same size, named, under a title with a note beside it.
///
/// # Errors
/// [`PreviewError::Encode`].
pub(crate) fn look_sheet(
    path: String,
    title: &str,
    note: &str,
    [width, height]: [usize; 2],
    panels: &[LookPanel],
) -> Result<PreviewFile, PreviewError> {
    let content = panels.len() * (width + GAP) - GAP.min(panels.len() * GAP);
    let top = MARGIN + Font::Title.height() + BLOCK_GAP;
    let foot = 10 + Font::Strong.height();
    let mut canvas = Canvas::new(content + 2 * MARGIN, top + height + foot + MARGIN, PAGE);
    Font::Title.draw(&mut canvas, [MARGIN, MARGIN], title, INK);
    if Font::Title.width(title) + 24 + Font::Normal.width(note) <= content {
        side_note(&mut canvas, title, note);
    }
    for (n, panel) in panels.iter().enumerate() {
        let left = MARGIN + n * (width + GAP);
        canvas.frame(Rect { x: left, y: top, width, height }, PANEL_EDGE);
        canvas.lay([left, top], width, &panel.pixels);
        if let Some(scale) = panel.scale.as_ref().filter(|_| width.min(height) >= SCALE_ROOM) {
            scale.draw(&mut canvas, Rect { x: left, y: top, width, height });
        }
        let name = Font::Strong.fit(&panel.name, width);
        Font::Strong.draw(&mut canvas, [left, top + height + 10], &name, INK);
    }
    canvas.file(path)
}

/// The square panels of a picture that [`look_sheet`] has drawn, each as a file; `None` of any other picture.
pub(crate) fn look_panels(file: &[u8]) -> Option<Vec<Vec<u8>>> {
    let image = image::load_from_memory_with_format(file, image::ImageFormat::Png).ok()?.into_rgb8();
    let [width, height] = [image.width(), image.height()].map(|pixels| pixels as usize);
    let top = MARGIN + Font::Title.height() + BLOCK_GAP;
    let edge = height.checked_sub(top + 10 + Font::Strong.height() + MARGIN).filter(|edge| *edge > 0)?;
    let step = edge + GAP;
    let row = width.checked_sub(2 * MARGIN)? + GAP;
    if !row.is_multiple_of(step) {
        return None;
    }
    let panel = |n: usize| {
        let (left, pixels) = (MARGIN + n * step, image.as_raw().as_chunks::<3>().0);
        let rows = (top..top + edge).flat_map(|y| &pixels[y * width + left..][..edge]);
        png(edge, Pixels::Rgb8(&rows.copied().collect::<Vec<_>>())).ok()
    };
    (0..row / step).map(panel).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_scale_lies_in_the_head_of_its_panel_alone() {
        let scale = Scale { colours: vec![[9, 0, 0], [0, 9, 0]], ticks: vec!["0", "1"] };
        let panel = |scale| LookPanel { name: "a panel".into(), pixels: vec![[250; 3]; 300 * 300], scale };
        let sheet = look_sheet("look/x.png".into(), "Light", "", [300; 2], &[panel(None), panel(Some(scale))]).unwrap();
        let panels = look_panels(&sheet.png).unwrap();
        let read = |file: &Vec<u8>| image::load_from_memory(file).unwrap().into_rgb8();
        let [plain, scaled] = [0, 1].map(|n| read(&panels[n]));
        assert!(plain.pixels().all(|pixel| pixel.0 == [250; 3]));
        assert!((100..300).all(|y| (0..300).all(|x| scaled.get_pixel(x, y).0 == [250; 3])));
        let along = |x: u32| (0..100).any(|y| [[9, 0, 0], [0, 9, 0]].contains(&scaled.get_pixel(x, y).0));
        assert!(along(100) && along(200) && !along(5) && !along(295));
    }

    #[test]
    fn panels_come_back_as_they_were_laid() {
        let panel = |seed: u8| LookPanel {
            name: "a panel".into(),
            pixels: (0..32 * 32).map(|n| [n as u8, (n >> 5) as u8, seed]).collect(),
            scale: None,
        };
        for count in [1, 3] {
            let panels: Vec<_> = (0..count).map(panel).collect();
            let sheet = look_sheet("look/x.png".into(), "Light", "", [32; 2], &panels).unwrap();
            let found = look_panels(&sheet.png).unwrap();
            let read = |file: &Vec<u8>| image::load_from_memory(file).unwrap().into_rgb8().into_raw();
            let laid: Vec<Vec<u8>> = panels.iter().map(|panel| panel.pixels.as_flattened().to_vec()).collect();
            assert_eq!(found.iter().map(read).collect::<Vec<_>>(), laid);
        }
        assert_eq!(look_panels(b"no picture"), None);
        assert_eq!(look_panels(&png(5, Pixels::Rgb8(&[[0; 3]; 15])).unwrap()), None);
    }
}
