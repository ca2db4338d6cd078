//! What prints a coupon: boxes side by side, each with layers of its own straight down, as a job for `slice`.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use super::Coupon;
use crate::words::toml_string;

/// A box of one stack.
struct Part {
    low_mm: [f64; 2],
    size_mm: [f64; 2],
    stack: String,
}

impl Coupon {
    /// The job, and the meshes it names: names relative to it with their contents. `materials` is the line that names
    /// the resins, `printer` that of the preset.
    pub fn job(&self, materials: &str) -> (String, BTreeMap<String, Vec<u8>>) {
        let mut meshes = BTreeMap::new();
        let mut job = format!(
            "# Written by `lumislice material coupon`: a test piece, its fields in coupon.json.\n\
             # Print it with a glossy top, and photograph it from above.\n\
             [printer]\npreset = {}\n\n[materials]\n{materials}\n\n\
             [target]\nkind = \"stacking\"\nstack = {}\n\n[stacking]\ncore = {}\n\n\
             [output]\nformats = [\"png\", \"preview\"]\n",
            toml_string(&self.printer),
            toml_string(&self.whole(self.rim)),
            toml_string(&self.resins[self.dark].name),
        );
        for part in self.parts() {
            let [width, depth] = part.size_mm;
            let name = format!("meshes/box-{width}x{depth}.obj");
            let _ = write!(
                job,
                "\n[[object]]\nmesh = {}\nunit = \"mm\"\nposition-mm = [{}, {}, 0]\ndepth-from = \"top\"\n\
                 [object.target]\nkind = \"stacking\"\nstack = {}\n",
                toml_string(&name),
                part.low_mm[0],
                part.low_mm[1],
                toml_string(&part.stack),
            );
            meshes.entry(name).or_insert_with(|| box_obj([width, depth, self.size_mm[2]]));
        }
        (job, meshes)
    }

    fn whole(&self, resin: usize) -> String {
        format!("{}:{}", self.resins[resin].name, self.size_mm[2])
    }

    /// Fields, marks, and what of the rim lies around them.
    fn parts(&self) -> Vec<Part> {
        let side = self.spacing_mm;
        let half = 0.5 * side;
        let around = |[x, y]: [f64; 2], size_mm: [f64; 2], stack: String| Part {
            low_mm: [x - 0.5 * size_mm[0], y - 0.5 * size_mm[1]],
            size_mm,
            stack,
        };
        let mut parts: Vec<Part> =
            self.fields.iter().map(|field| around(field.middle_mm, [side; 2], self.named(field))).collect();
        let rim = || self.whole(self.rim);
        let margin = 0.5 * (side - self.mark_mm);
        for [x, y] in self.marks {
            parts.push(around([x, y], [self.mark_mm; 2], self.whole(self.dark)));
            for by in [-1.0, 1.0] {
                let aside = by * 0.5 * (self.mark_mm + margin);
                parts.push(around([x + aside, y], [margin, side], rim()));
                parts.push(around([x, y + aside], [self.mark_mm, margin], rim()));
            }
        }
        // The rim between the squares of the marks.
        let [width, height, _] = self.size_mm;
        let [long, tall] = [width - 2.0 * side, height - 2.0 * side];
        for (at, size) in [
            ([0.5 * width, half], [long, side]),
            ([0.5 * (width + side), height - half], [long - side, side]),
            ([half, 0.5 * height], [side, tall]),
            ([width - half, 0.5 * height], [side, tall]),
        ] {
            parts.push(around(at, size, rim()));
        }
        parts
    }
}

/// A box from the origin on, its faces outwards.
fn box_obj([x, y, z]: [f64; 3]) -> Vec<u8> {
    let mut text = String::new();
    for corner in 0..8 {
        let pick = |bit: usize, size: f64| if corner >> bit & 1 == 1 { size } else { 0.0 };
        let _ = writeln!(text, "v {} {} {}", pick(0, x), pick(1, y), pick(2, z));
    }
    text.push_str("f 1 3 4 2\nf 5 6 8 7\nf 1 2 6 5\nf 3 7 8 4\nf 1 5 7 3\nf 2 4 8 6\n");
    text.into_bytes()
}
