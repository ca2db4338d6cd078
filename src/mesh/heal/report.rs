//! The health report in sentences.

use super::HealthReport;
use crate::words::{counted, is_are, was_were};

/// Share of the volume from which on it is said that what was left out is not flat.
const BULGING: f64 = 1e-3;

impl HealthReport {
    /// What a user should know, one sentence with counts for each finding; empty for a sound mesh.
    pub fn warnings(&self) -> Vec<String> {
        let mut said = Vec::new();
        let mut say = |count: usize, sentence: String| {
            if count > 0 {
                said.push(sentence);
            }
        };
        say(
            self.joined_corners,
            format!(
                "{} joined with others that they missed by a few millionths of the mesh's length.",
                was_were(self.joined_corners, "corner")
            ),
        );
        say(
            self.split_edges,
            format!("{} split at corners of other pieces that lie on them.", was_were(self.split_edges, "open edge")),
        );
        say(
            self.dropped_sheets,
            format!(
                "Left out beside the solid: {} without thickness, of {}.",
                counted(self.dropped_sheets, "sheet"),
                counted(self.dropped_sheet_triangles, "triangle")
            ),
        );
        say(
            usize::from(self.dropped_sheet_volume_mm3 > BULGING * self.volume_mm3),
            format!(
                "What was left out would hold {:.2} mm³ if it were closed; it hangs open beside the solid. If that is a \
                 part of it, let its rim reach into what it sits on.",
                self.dropped_sheet_volume_mm3
            ),
        );
        say(
            self.holes,
            format!(
                "The mesh has {}{}; closed for the inside test by {} of {:.2} mm² ({:.2}% of the surface). \
                 Depth is measured from the mesh only, not from what closes it.",
                counted(self.holes, "hole"),
                if self.open_edges > 0 {
                    format!(" with {}", counted(self.open_edges, "open edge"))
                } else {
                    String::new()
                },
                counted(self.caps, "triangle"),
                self.cap_area_mm2,
                100.0 * self.cap_area_mm2 / self.area_mm2
            ),
        );
        say(
            self.non_manifold_edges,
            format!("{} joined by more than two triangles.", is_are(self.non_manifold_edges, "edge")),
        );
        say(
            self.flipped_triangles,
            format!("{} turned to agree with their neighbours.", was_were(self.flipped_triangles, "triangle")),
        );
        say(
            self.twisted_edges,
            format!(
                "{} between neighbours that face opposite ways and cannot be made to agree; the surface is one-sided \
                    there.",
                is_are(self.twisted_edges, "edge")
            ),
        );
        say(
            self.turned_shells,
            format!("{} facing inwards and turned inside out.", was_were(self.turned_shells, "shell")),
        );
        say(
            self.unjudged_shells,
            format!(
                "{} facing inwards and left so, there are too many to check.",
                is_are(self.unjudged_shells, "shell")
            ),
        );
        say(
            self.open_shells,
            format!(
                "{} of {} open by more than a tenth of their surface: what closes them is a guess.",
                self.open_shells,
                counted(self.shells, "piece")
            ),
        );
        say(
            self.seated_shells,
            format!("{} open where they sit on others, and closed within them.", is_are(self.seated_shells, "piece")),
        );
        say(
            self.joint_shells,
            format!(
                "The rims of {} run along each other, up to {:.4} mm apart: they are taken for one body, without the \
                 gap between them.",
                counted(self.joint_shells, "piece"),
                self.rim_gap_mm
            ),
        );
        say(
            self.doubled_triangles,
            format!("{} dropped because another has the same corners.", was_were(self.doubled_triangles, "triangle")),
        );
        say(
            self.degenerate_triangles,
            format!("{} without area and not measured from.", is_are(self.degenerate_triangles, "triangle")),
        );
        let crossings = self.self_intersections.unwrap_or(0);
        say(
            crossings,
            format!(
                "{} of triangles cross each other; where parts overlap they count as one.",
                counted(crossings, "pair")
            ),
        );
        say(
            usize::from(self.buried_area_mm2 > 0.0),
            format!(
                "{:.2} mm² of faces have inside on both sides or lie on others, where parts overlap or touch: they are \
                 no surface, and no depth is measured from them.",
                self.buried_area_mm2
            ),
        );
        say(
            usize::from(self.inside_out),
            "Where the surface crosses itself, a part of it is inside out (its outer side within): what that encloses \
             is left out of the print, unless it is a cavity."
                .to_owned(),
        );
        said
    }
}
