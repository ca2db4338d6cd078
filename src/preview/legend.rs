//! The foot of every picture: a scale bar, and what the colours mean.

use super::{
    PreviewMaterial,
    canvas::{Canvas, Rect},
    style::{FAINT, INK, Palette, encoded},
    text::Font,
};

/// Edge of a swatch, pixels.
const SWATCH: usize = 24;
/// Between a swatch and its words.
const SWATCH_GAP: usize = 10;
/// Between entries.
const ENTRY_GAP: usize = 40;
/// Height of a row of entries.
const ROW: usize = 36;
/// Most pixels of an entry's name, so that one long name cannot fill the picture.
const NAME_PIXELS: usize = 420;

/// Most entries; a printer holds eight resins.
const MAX_ENTRIES: usize = 24;

/// The materials of a job, with their volumes.
#[derive(Debug, Clone)]
pub(super) struct Legend {
    entries: Vec<Entry>,
}

#[derive(Debug, Clone)]
struct Entry {
    id: u8,
    name: String,
    volume: String,
}

/// Where the foot's parts go.
#[derive(Debug, Clone)]
pub(super) struct Foot {
    /// Height of the foot, pixels.
    pub height: usize,
    bar: Option<ScaleBar>,
    /// Offset of every entry.
    places: Vec<[usize; 2]>,
}

/// A bar of a round length.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct ScaleBar {
    /// Its length, mm: 1, 2 or 5 times a power of ten.
    pub mm: f64,
    /// Its length, pixels.
    pub pixels: usize,
}

impl Legend {
    /// `volumes` lists ids with their volume in mm³; `exact` tells whether these are counted rather than estimated.
    pub fn new(materials: &[PreviewMaterial], volumes: impl Iterator<Item = (u8, f64)>, exact: bool) -> Self {
        let entry = |(id, mm3)| {
            let material = materials.iter().find(|material| material.id.0 == id);
            let name = material.map_or_else(|| format!("material {id}"), |material| material.name.clone());
            let name = if material.is_some_and(PreviewMaterial::is_void) {
                format!("{} (printer fills it)", Font::Normal.fit(&name, NAME_PIXELS / 2))
            } else {
                Font::Normal.fit(&name, NAME_PIXELS)
            };
            Entry { id, name, volume: format!("{}{}", if exact { "" } else { "~" }, volume_text(mm3)) }
        };
        let mut entries: Vec<Entry> = volumes.map(entry).collect();
        if entries.len() > MAX_ENTRIES {
            let name = format!("and {} more", entries.len() - (MAX_ENTRIES - 1));
            entries.truncate(MAX_ENTRIES - 1);
            entries.push(Entry { id: 0, name, volume: String::new() });
        }
        Self { entries }
    }

    /// Lays the foot out for a picture of this width inside its margins.
    pub fn layout(&self, width: usize, pixels_per_mm: f64) -> Foot {
        let bar = ScaleBar::within((width as f64 * 0.22).clamp(60.0, 320.0), pixels_per_mm);
        let bar_width = bar.map_or(0, |bar| bar.pixels.max(Font::Normal.width(&bar.label())) + 2 * ENTRY_GAP);
        let widest = self.entries.iter().map(Entry::width).max().unwrap_or(0);
        // Beside the bar if the widest entry has room there, else below it.
        let (left, mut y) = if bar_width + widest <= width { (bar_width, 0) } else { (0, BAR_HEIGHT + 16) };
        let mut x = left;
        let mut places = Vec::new();
        for entry in &self.entries {
            if x > left && x + entry.width() > width {
                (x, y) = (left, y + ROW);
            }
            places.push([x, y]);
            x += entry.width() + ENTRY_GAP;
        }
        let height = places.last().map_or(0, |place| place[1] + ROW).max(BAR_HEIGHT);
        if places.last().is_some_and(|place| place[1] == 0) {
            // One row is centred on the bar.
            places.iter_mut().for_each(|place| place[1] += (BAR_HEIGHT - SWATCH) / 2);
        }
        Foot { height, bar, places }
    }

    /// Width a picture must have for the foot to fit, pixels.
    pub fn min_width(&self) -> usize {
        self.entries.iter().map(Entry::width).max().unwrap_or(0).max(160)
    }

    /// Draws the foot with its upper left corner at (x, y).
    pub fn draw(&self, canvas: &mut Canvas, [x, y]: [usize; 2], foot: &Foot, palette: &Palette) {
        if let Some(bar) = foot.bar {
            bar.draw(canvas, [x, y]);
        }
        for (entry, place) in self.entries.iter().zip(&foot.places) {
            entry.draw(canvas, [x + place[0], y + place[1]], palette);
        }
    }
}

impl Entry {
    fn width(&self) -> usize {
        SWATCH + SWATCH_GAP + Font::Strong.width(&self.name) + SWATCH_GAP + Font::Normal.width(&self.volume)
    }

    fn draw(&self, canvas: &mut Canvas, [x, y]: [usize; 2], palette: &Palette) {
        for dy in 0..SWATCH {
            for dx in 0..SWATCH {
                if let Some(colour) = palette.at(self.id, (dx + dy) as f32) {
                    canvas.blend(x + dx, y + dy, encoded(colour), 1.0);
                }
            }
        }
        if self.id != 0 {
            canvas.frame(Rect { x: x + 1, y: y + 1, width: SWATCH - 2, height: SWATCH - 2 }, FAINT);
        }
        let x = x + SWATCH + SWATCH_GAP;
        Font::Strong.draw(canvas, [x, y], &self.name, INK);
        let x = x + Font::Strong.width(&self.name) + SWATCH_GAP;
        Font::Normal.draw(canvas, [x, y], &self.volume, FAINT);
    }
}

/// Height of a scale bar with its label, pixels.
const BAR_HEIGHT: usize = 40;
/// Height of the bar's end marks.
const BAR_END: usize = 12;

impl ScaleBar {
    /// The longest bar of at most `pixels`; `None` where no length makes sense.
    pub fn within(pixels: f64, pixels_per_mm: f64) -> Option<Self> {
        let most = pixels / pixels_per_mm;
        if !(most.is_finite() && most > 0.0) {
            return None;
        }
        let decade = libm::pow(10_f64, libm::log10(most).floor());
        // 1e-9: a decade that rounds up must not lose its own length.
        let step = [5.0, 2.0, 1.0].into_iter().find(|step| step * decade <= most * (1.0 + 1e-9)).unwrap_or(0.5);
        let mm = step * decade;
        Some(Self { mm, pixels: (mm * pixels_per_mm).round() as usize })
    }

    /// Its length in words.
    pub fn label(&self) -> String {
        if self.mm >= 0.1 * (1.0 - 1e-9) {
            format!("{} mm", tidy(self.mm))
        } else {
            format!("{} µm", tidy(self.mm * 1000.0))
        }
    }

    fn draw(&self, canvas: &mut Canvas, [x, y]: [usize; 2]) {
        Font::Normal.draw(canvas, [x, y], &self.label(), INK);
        let width = self.pixels.max(1);
        let (top, end) = (y + BAR_HEIGHT - BAR_END, 3.min(width));
        canvas.fill(Rect { x, y: top + BAR_END / 2 - 2, width, height: 4 }, INK);
        canvas.fill(Rect { x, y: top, width: end, height: BAR_END }, INK);
        canvas.fill(Rect { x: x + width - end, y: top, width: end, height: BAR_END }, INK);
    }
}

/// A number that is 1, 2 or 5 times a power of ten, without noise digits.
fn tidy(value: f64) -> String {
    let digits = (-libm::log10(value).floor()).max(0.0) as usize;
    format!("{value:.digits$}")
}

/// A length with as many digits as make sense.
pub(super) fn millimetres(mm: f64) -> String {
    match mm.abs() {
        size if size >= 1000.0 => format!("{mm:.0} mm"),
        size if size >= 100.0 => format!("{mm:.1} mm"),
        size if size >= 1.0 || size == 0.0 => format!("{mm:.2} mm"),
        _ => format!("{mm:.3} mm"),
    }
}

fn volume_text(mm3: f64) -> String {
    match mm3 {
        v if v >= 100_000.0 => format!("{:.0} cm³", v / 1000.0),
        v if v >= 1000.0 => format!("{:.1} cm³", v / 1000.0),
        v if v >= 10.0 => format!("{v:.0} mm³"),
        v if v >= 0.01 || v == 0.0 => format!("{v:.2} mm³"),
        v => format!("{v:.1e} mm³"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{preview::style::PAGE, voxel::MaterialId};

    #[test]
    fn bars_are_round_and_as_long_as_they_say() {
        for scale in [0.013, 0.7, 1.0, 3.3, 20.0, 999.0, 1e6] {
            let bar = ScaleBar::within(300.0, scale).unwrap();
            assert!(bar.pixels <= 300 && bar.pixels >= 119, "{bar:?}");
            assert!((bar.mm * scale - bar.pixels as f64).abs() <= 0.5, "{bar:?}");
            let mantissa = bar.mm / 10_f64.powf(bar.mm.log10().floor());
            assert!([1.0, 2.0, 5.0, 10.0].iter().any(|round| (mantissa - round).abs() < 1e-9), "{bar:?}");
        }
        assert_eq!(ScaleBar::within(100.0, 10.0).unwrap(), ScaleBar { mm: 10.0, pixels: 100 });
        assert_eq!(ScaleBar::within(100.0, 0.0), None);
        let label = |mm| ScaleBar { mm, pixels: 1 }.label();
        assert_eq!([0.1, 0.05, 0.0005, 20.0, 0.5].map(label), ["0.1 mm", "50 µm", "0.5 µm", "20 mm", "0.5 mm"]);
    }

    #[test]
    fn the_bar_drawn_is_as_long_as_the_bar_computed() {
        let bar = ScaleBar::within(200.0, 7.3).unwrap();
        let mut canvas = Canvas::new(300, 60, PAGE);
        bar.draw(&mut canvas, [10, 5]);
        let row = 5 + BAR_HEIGHT - BAR_END / 2;
        let inked: Vec<usize> = (0..300).filter(|&x| canvas.pixel(x, row) == INK).collect();
        assert_eq!(inked, (10..10 + bar.pixels).collect::<Vec<_>>());
        assert_eq!(bar.pixels, (7.3 * bar.mm).round() as usize);
    }

    #[test]
    fn entries_stay_inside_the_picture() {
        let materials: Vec<_> = (1..=200_u8)
            .map(|id| PreviewMaterial {
                id: MaterialId(id),
                name: "a resin with a name ".repeat(usize::from(id % 7) * 4),
                rgba: [id, 0, 0, id % 3],
            })
            .collect();
        let legend = Legend::new(&materials, (1..=200).map(|id| (id, 1234.5)), true);
        for width in [legend.min_width(), 900, 1800] {
            let foot = legend.layout(width, 5.0);
            assert_eq!(foot.places.len(), MAX_ENTRIES);
            for (entry, place) in legend.entries.iter().zip(&foot.places) {
                assert!(place[0] + entry.width() <= width && place[1] + SWATCH <= foot.height, "{entry:?} {place:?}");
            }
        }
        assert_eq!(legend.entries[MAX_ENTRIES - 1].name, "and 177 more");
    }

    #[test]
    fn long_words_are_cut_to_fit() {
        let text = "transparent urethane acrylate";
        for pixels in 0..500 {
            let cut = Font::Normal.fit(text, pixels);
            assert!(Font::Normal.width(&cut) <= pixels && (cut == text || cut.is_empty() || cut.ends_with('…')));
        }
    }

    #[test]
    fn volumes_read_well() {
        let texts = [0.0, 0.5, 12.4, 999.0, 24_567.0, 3.4e6, 1e-5].map(volume_text);
        assert_eq!(texts, ["0.00 mm³", "0.50 mm³", "12 mm³", "999 mm³", "24.6 cm³", "3400 cm³", "1.0e-5 mm³"]);
    }
}
