//! What is told of a print that will not print well.

use serde::Serialize;

use super::{LoosePiece, Pieces, Printable, Walls, walls};
use crate::words::counted;

/// Shares of a surface below this are not worth a word: a thousandth.
const WORTH_SAYING: f64 = 1e-3;
/// Most that a print is advised to grow by.
const MOST_LARGER: f64 = 10.0;
/// Skins over a wall of support that they close in hold it as long as they last; the ears of the samples' rabbit, whose
/// layers are searched for their thickness, are a percent of it.
const HOLLOW_WORTH_SAYING: f64 = 0.05;
/// Parts too thin for their layers are common at tips; below a hundredth no one sees them.
const SHALLOW_WORTH_SAYING: f64 = 0.01;

pub(super) fn at(mm: [f64; 3]) -> String {
    let [x, y, z] = mm;
    format!("({x:.1}, {y:.1}, {z:.1}) mm")
}

fn percent(share: f64) -> String {
    if share >= 0.1 { format!("{:.0}%", 100.0 * share) } else { format!("{:.1}%", 100.0 * share) }
}

/// What is told of pieces that hold to nothing: the first and how many more.
fn loose(pieces: &[LoosePiece], one: &str, several: &str) -> String {
    let Some((first, others)) = pieces.split_first() else { return String::new() };
    match others.len() {
        0 => format!("{} {one}", first.words()),
        more => format!("{} and {more} more {several}", first.words()),
    }
}

/// Something that will not print well.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Complaint {
    /// What it is about, as docs/events.md lists it.
    pub kind: &'static str,
    /// The mesh, where it is about one object.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub object: Option<String>,
    /// All of it: the object, what was found, and the cure.
    pub text: String,
    /// What helps.
    pub cure: String,
}

impl Complaint {
    fn of_all(kind: &'static str, found: String, cure: &str) -> Self {
        Self { kind, object: None, text: format!("{found}; {cure}"), cure: cure.to_owned() }
    }

    fn of(kind: &'static str, mesh: &str, found: String, cure: &str) -> Self {
        Self { kind, object: Some(mesh.to_owned()), text: format!("{mesh}: {found}; {cure}"), cure: cure.to_owned() }
    }
}

impl Printable {
    /// What was found, a sentence each, with what cures it; nothing where nothing is wrong.
    pub fn warnings(&self) -> Vec<String> {
        self.complaints().into_iter().map(|complaint| complaint.text).collect()
    }

    /// What was found, piece by piece.
    pub fn complaints(&self) -> Vec<Complaint> {
        self.of_pieces().into_iter().chain(self.of_objects()).collect()
    }

    /// What falls off, apart, or together.
    fn of_pieces(&self) -> Vec<Complaint> {
        let mut found = Vec::new();
        let Pieces { count, crumbs, crumbs_mm3, first_crumb_mm, in_the_air, .. } = &self.pieces;
        if let Some(first) = first_crumb_mm {
            let text = format!(
                "{} {} off, {crumbs_mm3:.2} mm³ together, the first at {}: wires and walls thinner than voxels break \
                 into beads",
                counted(*crumbs as usize, "crumb"),
                if *crumbs == 1 { "falls" } else { "fall" },
                at(*first)
            );
            let cure = "thicken them, print larger, or take a printer of finer pitch";
            found.push(Complaint::of_all("crumbs", text, cure));
        }
        let whole = count - crumbs;
        if whole > self.walls.len() as u64 {
            let text = format!(
                "{} that nothing holds together, of {}: {}{}",
                counted(whole as usize, "piece"),
                counted(self.walls.len(), "object"),
                loose(&self.pieces.loose, "is apart", "are apart"),
                match in_the_air {
                    0 => String::new(),
                    1 => "; 1 of them begins above the tray, on support alone".to_owned(),
                    n => format!("; {n} of them begin above the tray, on support alone"),
                }
            );
            found.push(Complaint::of_all("loose-pieces", text, "join them in the mesh if they belong together"));
        }
        if let Some(washed) = &self.washed
            && washed.pieces > whole
        {
            let text = format!(
                "the print falls into {} where support is washed off, for support lies right through it and comes out \
                 at its sides: {}",
                counted(washed.pieces as usize, "piece"),
                loose(&washed.loose, "comes off", "come off"),
            );
            let cure = "have the layers close it in (depth-from = \"surface\"), or print a resin in its place \
                        (output.background-as)";
            found.push(Complaint::of_all("falls-apart", text, cure));
        }
        if let [first, others @ ..] = self.pieces.glued.as_slice() {
            let [one, other] = first.map(|object| format!("object {} ({})", object + 1, self.walls[object].mesh));
            let more = match others.len() {
                0 => String::new(),
                more => format!(", and so do {}", counted(more, "other pair")),
            };
            let text = format!("{one} and {other} lie nearer together than voxels tell: they print as one piece{more}");
            let cure = "move them a voxel or more apart, or let them touch if they belong together";
            found.push(Complaint::of_all("joined-objects", text, cure));
        }
        found
    }

    /// What is wrong with single objects.
    fn of_objects(&self) -> Vec<Complaint> {
        let mut found = Vec::new();
        for (lost, walls) in self.lost_shells.iter().zip(&self.walls) {
            if let Some(first) = lost.first_mm {
                let text = format!(
                    "{} of {:.3} mm³ together will not be printed, the first at {}: no voxel's centre lies inside",
                    counted(lost.count as usize, "shell"),
                    lost.mm3,
                    at(first)
                );
                let cure = "thicken them, print larger, or take a printer of finer pitch";
                found.push(Complaint::of("lost-shells", &walls.mesh, text, cure));
            }
        }
        found.extend(self.walls.iter().flat_map(of_walls));
        found
    }
}

/// What is wrong with the walls and layers of an object.
fn of_walls(walls: &Walls) -> Vec<Complaint> {
    let mut found = Vec::new();
    let Walls { mesh, limit_mm, .. } = walls;
    if let Some((thinnest, place)) = walls.thinnest_mm.zip(walls.thinnest_at_mm)
        && walls.thin_share > WORTH_SAYING
    {
        // Rounded up, so that it is enough; a figure several times as large is another figure.
        let times = (10.0 * limit_mm / thinnest.max(1e-3)).ceil() / 10.0;
        let larger = match times <= MOST_LARGER {
            true => format!(", or print {times:.1} times as large"),
            false => String::new(),
        };
        let text = format!(
            "{} of its surface is on walls and wires thinner than {} voxels ({limit_mm:.3} mm), {thinnest:.3} mm at \
             {}: they break or are lost",
            percent(walls.thin_share),
            walls::VOXELS,
            at(place),
        );
        found.push(Complaint::of("thin-walls", mesh, text, &format!("thicken them{larger}")));
    }
    if walls.bare_share > WORTH_SAYING {
        let share = percent(walls.bare_share);
        let text = format!("support lies bare on {share} of its surface, where it is washed off");
        found.push(Complaint::of("bare-support", mesh, text, "min-depth-mm in [[stacking.limit]] keeps it below"));
    }
    if walls.hollow_share > HOLLOW_WORTH_SAYING {
        let share = percent(walls.hollow_share);
        let text = format!("{share} of its surface is a skin over a wall of support, which holds nothing together");
        let cure = "thicken the part, or lay less support (where layers are searched for, by max-mm of a \
                    [[stacking.limit]])";
        found.push(Complaint::of("hollow-walls", mesh, text, cure));
    }
    if walls.shallow_share > SHALLOW_WORTH_SAYING {
        let text = format!(
            "{} of its surface is on parts too thin for their layers, of which the lowest are left out, and look \
             otherwise than predicted",
            percent(walls.shallow_share)
        );
        let cure = match walls.takes_thin_parts {
            true => "appearance.thin-parts = true gives them layers of their own",
            false => "thicken them, or write layers that fit",
        };
        found.push(Complaint::of("shallow-parts", mesh, text, cure));
    }
    found
}
