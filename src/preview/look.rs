//! Pictures of a look side by side.

use super::{
    PreviewError, PreviewFile,
    canvas::{Canvas, Rect},
    sheet::{BLOCK_GAP, MARGIN, side_note},
    style::{INK, PAGE, PANEL_EDGE, Rgb},
    text::Font,
};

/// One picture of several.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct LookPanel {
    /// What it shows.
    pub name: String,
    /// Row 0 on top.
    pub pixels: Vec<Rgb>,
}

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
        let name = Font::Strong.fit(&panel.name, width);
        Font::Strong.draw(&mut canvas, [left, top + height + 10], &name, INK);
    }
    canvas.file(path)
}
