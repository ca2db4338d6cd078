//! Where each stacking lies, on the report page: the surface as points with their labels, to be turned and asked, and
//! to be taken along as a table. All of it is in the page.

use std::fmt::{self, Write};

use serde_json::json;

use crate::page::escape;

/// A point of the surface, and which stacking lies there.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ReportLabel {
    /// Index of the stacking among all of the page.
    pub stacking: usize,
    /// Where, mm.
    pub point: [f64; 3],
    /// Outward unit normal.
    pub normal: [f64; 3],
}

/// What the page knows of a stacking.
pub(super) struct Known {
    pub name: String,
    /// Object and cluster, from 1 and from 0.
    pub origin: [usize; 2],
    /// What it is made of and how close it comes, in words.
    pub words: String,
    /// The albedo asked for, as sRGB.
    pub colour: [u8; 3],
}

/// Unit of positions, mm.
const UNIT_MM: f64 = 0.01;
/// Steps of a folded normal along each side of its square.
const FOLDED: f64 = 63.0;

/// Writes the section; nothing without points.
pub(super) fn section(page: &mut String, labels: &[ReportLabel], known: &[Known], area_mm2: f64) -> fmt::Result {
    if labels.is_empty() || labels.iter().any(|label| label.stacking >= known.len()) {
        return Ok(());
    }
    let all = format!("{} points spread evenly over the surface, in the albedo asked for.", labels.len());
    writeln!(page, "<h2>Where each stacking lies</h2>\n<div class=\"where\">")?;
    write!(page, "<canvas id=\"where\" width=\"720\" height=\"720\" tabindex=\"0\" role=\"img\" ")?;
    writeln!(page, "aria-label=\"The surface with its stackings. Arrow keys turn it.\"></canvas>\n<div>")?;
    writeln!(page, "<label>Stacking <select id=\"which\"><option value=\"-1\">all, as asked for</option>")?;
    for (n, stacking) in known.iter().enumerate() {
        writeln!(page, "<option value=\"{n}\">{}</option>", escape(&stacking.name))?;
    }
    writeln!(page, "</select></label>")?;
    writeln!(page, "<p id=\"told\" aria-live=\"polite\" data-all=\"{all}\">{all}</p>")?;
    writeln!(
        page,
        "<p class=\"note\">Drag it, or turn it with the arrow keys; point at a place to see what lies there."
    )?;
    writeln!(page, "Where a part is thin or bends, its stacking is a variant of its cluster's.</p>")?;
    writeln!(page, "<button id=\"save\" type=\"button\">Save the labels as CSV</button>\n</div>\n</div>")?;
    let points: Vec<i64> = labels.iter().flat_map(numbers).collect();
    let data = json!({
        "unit_mm": UNIT_MM,
        "columns": ["x", "y", "z", "normal", "stacking"],
        "area_mm2": area_mm2,
        "view_deg": [-62, 16],
        "origin": known.iter().map(|stacking| stacking.origin).collect::<Vec<_>>(),
        "words": known.iter().map(|stacking| format!("{}: {}", stacking.name, stacking.words)).collect::<Vec<_>>(),
        "colours": known.iter().map(|stacking| stacking.colour).collect::<Vec<_>>(),
        "points": points,
    });
    let data = data.to_string().replace('<', "\\u003c");
    writeln!(page, "<script type=\"application/json\" id=\"labels\">{data}</script>")?;
    writeln!(page, "<script>\n{}</script>", include_str!("where.js"))
}

/// A point as whole numbers: position, folded normal, stacking.
fn numbers(label: &ReportLabel) -> [i64; 5] {
    let [x, y, z] = label.point.map(|at| (at / UNIT_MM).round() as i64);
    [x, y, z, folded(label.normal), label.stacking as i64]
}

/// A unit vector on an octahedron, folded flat (Meyer et al. 2010).
fn folded([x, y, z]: [f64; 3]) -> i64 {
    let sum = (x.abs() + y.abs() + z.abs()).max(f64::MIN_POSITIVE);
    let (mut u, mut v) = (x / sum, y / sum);
    if z < 0.0 {
        (u, v) = ((1.0 - v.abs()).copysign(u), (1.0 - u.abs()).copysign(v));
    }
    let step = |at: f64| ((at + 1.0) / 2.0 * FOLDED).round() as i64;
    (step(u) << 6) + step(v)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// As `where.js` unfolds them.
    fn unfolded(code: i64) -> [f64; 3] {
        let (mut x, mut y) = ((code >> 6) as f64 / 31.5 - 1.0, (code & 63) as f64 / 31.5 - 1.0);
        let z = 1.0 - x.abs() - y.abs();
        if z < 0.0 {
            (x, y) = ((1.0 - y.abs()).copysign(x), (1.0 - x.abs()).copysign(y));
        }
        let length = (x * x + y * y + z * z).sqrt();
        [x, y, z].map(|v| v / length)
    }

    #[test]
    fn normals_come_back_within_a_few_degrees() {
        for n in 0..500 {
            let (turn, z) = (2.399_963 * f64::from(n), 1.0 - (f64::from(n) + 0.5) / 250.0);
            let flat = (1.0 - z * z).sqrt();
            let normal = [flat * turn.cos(), flat * turn.sin(), z];
            let back = unfolded(folded(normal));
            let cosine: f64 = normal.iter().zip(back).map(|(a, b)| a * b).sum();
            // Half a step along both sides of the square, 2/63 each, moves a point of the octahedron by (1, 1, −2)/63
            // at most, 0.577 from its middle where it is nearest: 3.9°.
            assert!(cosine > 0.9976, "{normal:?} came back as {back:?}");
        }
    }

    #[test]
    fn words_cannot_end_the_data() {
        let known =
            Known { name: "</script>".into(), origin: [1, 0], words: "<!-- & </script>".into(), colour: [1, 2, 3] };
        let label = ReportLabel { stacking: 0, point: [1.0, 2.0, -3.006], normal: [0.0, 0.0, 1.0] };
        let mut page = String::new();
        section(&mut page, &[label], &[known], 9.0).unwrap();
        assert_eq!(page.matches("</script>").count(), 2);
        let data = page.split("id=\"labels\">").nth(1).unwrap().split("</script>").next().unwrap();
        let data: serde_json::Value = serde_json::from_str(data).unwrap();
        assert_eq!(data["points"], json!([100, 200, -301, (32 << 6) + 32, 0]));
        assert_eq!(data["words"][0], "</script>: <!-- & </script>");
        let mut none = String::new();
        section(&mut none, &[ReportLabel { stacking: 1, ..label }], &[], 9.0).unwrap();
        assert!(none.is_empty(), "a label of no stacking");
    }
}
