//! `mapping.txt`: which colour of the slices is which resin. GrabCAD's voxel utility knows colours only, and asks its
//! user for a resin to each of them.

use std::fmt::Write;

use super::{Content, Counts};

/// The text of the mapping.
pub fn mapping_text(content: &Content, counts: &Counts) -> String {
    let width = content.printed().map(|resin| resin.name.chars().count()).max().unwrap_or(0);
    let mut text = format!(
        "Colours of the slices of {}.\n\
         GrabCAD Voxel Print asks for a resin to each colour. Assign the resins in this table.\n\n\
         {:width$}  colour    red green  blue alpha         voxels\n",
        content.name, "resin"
    );
    for (resin, voxels) in content.occurring(counts) {
        let [r, g, b, a] = resin.rgba;
        // Writing to a string cannot fail.
        let _ =
            writeln!(text, "{:width$}  #{r:02X}{g:02X}{b:02X}  {r:>5} {g:>5} {b:>5} {a:>5} {voxels:>14}", resin.name);
    }
    text += "\nThe background is 0 0 0 0: nothing is printed there but the support that the printer adds.\n";
    for resin in content.resins.iter().filter(|resin| resin.rgba[3] == 0) {
        let voxels = counts[usize::from(resin.id.0)];
        if voxels > 0 {
            let _ = writeln!(text, "{voxels} voxels of {} within the object are background.", resin.name);
        }
    }
    text
}
