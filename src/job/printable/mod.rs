//! Will it print? What of a job breaks, falls off, washes away or cannot look as it should, counted before it is
//! printed.
//!
//! **In:** a [`Prepared`] job. **Out:** a [`Printable`]: numbers, sentences with what cures them, and a picture.
//!
//! | question | answered by |
//! | --- | --- |
//! | does it hang together? | voxels that share faces, of all objects, at the printer's own pitch: [`pieces`] |
//! | do objects stay apart? | the same, of two objects whose meshes do not touch: [`beside`] |
//! | is all of it there? | bodies that no voxel's centre lies in: [`shells`] |
//! | is it strong enough? | the way straight through at points of the surface: [`walls`] |
//! | does it still, once support is washed off? | what is printed, and the support that is closed in: [`washed`] |
//! | does support lie bare, or alone between two skins? | the layers below those points |
//! | is it thick enough for its layers? | the largest ball inside at those points that is limited from the other side, where thin parts get no stackings of their own |

mod beside;
mod picture;
mod pieces;
mod shells;
mod walls;
mod washed;

use serde::Serialize;

pub use pieces::{LoosePiece, Pieces};
pub use shells::LostShells;
pub use walls::Walls;
pub use washed::Washed;

use super::{Prepared, RunError};
use crate::{optics::Mixture, watch::Watch, words::counted};

/// What of a job will not print well.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Printable {
    /// What hangs together.
    pub pieces: Pieces,
    /// What is left of the print where support is washed off; `None` where water comes to none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub washed: Option<Washed>,
    /// Shells of every object that no voxel lies in, in the order of the job.
    pub lost_shells: Vec<LostShells>,
    /// Walls and wires of every object, in the order of the job.
    pub walls: Vec<Walls>,
    /// Voxels inside of the objects, each counted for itself.
    #[serde(skip)]
    pub(in crate::job) inside_voxels: u64,
}

/// Shares of a surface below this are not worth a word: a thousandth.
const WORTH_SAYING: f64 = 1e-3;
/// Most that a print is advised to grow by.
const MOST_LARGER: f64 = 10.0;
/// Skins over a wall of support that they close in hold it as long as they last; the ears of the samples' rabbit, whose
/// layers are searched for their thickness, are a percent of it.
const HOLLOW_WORTH_SAYING: f64 = 0.05;
/// Parts too thin for their layers are common at tips; below a hundredth no one sees them.
const SHALLOW_WORTH_SAYING: f64 = 0.01;

impl Prepared {
    /// Whether a layer of that name prints as background: one resin that does, no mixture, and nothing in its place.
    fn is_background(&self, layer: &str) -> bool {
        let only = Mixture::parts_of_name(layer).filter(|parts| parts.len() == 1);
        let found = only.and_then(|parts| self.materials.resin(parts[0].0));
        self.job.output.map_background.is_none()
            && found.is_some_and(|(resin, _)| self.materials[resin].print_as_background)
    }

    /// Looks for what will not print well.
    ///
    /// # Errors
    /// [`RunError::Stopped`].
    pub fn printable(&self, watch: &dyn Watch) -> Result<Printable, RunError> {
        watch.stage("will it print", 0);
        let (pieces, inside_voxels) = self.pieces(watch)?;
        let walls = (0..self.objects.len()).map(|object| self.walls(object, watch)).collect::<Result<Vec<_>, _>>()?;
        let washed = self.washed(&walls, watch)?;
        let of = |object| self.lost_shells(object, watch);
        let lost_shells = (0..self.objects.len()).map(of).collect::<Result<_, _>>()?;
        Ok(Printable { pieces, washed, lost_shells, walls, inside_voxels })
    }
}

fn at(mm: [f64; 3]) -> String {
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

impl Printable {
    /// What was found, a sentence each, with what cures it; nothing where nothing is wrong.
    pub fn warnings(&self) -> Vec<String> {
        let mut words = Vec::new();
        let Pieces { count, crumbs, crumbs_mm3, first_crumb_mm, in_the_air, .. } = &self.pieces;
        if let Some(first) = first_crumb_mm {
            words.push(format!(
                "{} {} off, {crumbs_mm3:.2} mm³ together, the first at {}: wires and walls thinner than voxels break \
                 into beads; thicken them, print larger, or take a printer of finer pitch",
                counted(*crumbs as usize, "crumb"),
                if *crumbs == 1 { "falls" } else { "fall" },
                at(*first)
            ));
        }
        let whole = count - crumbs;
        if whole > self.walls.len() as u64 {
            words.push(format!(
                "{} that nothing holds together, of {}: {}{}; join them in the mesh if they belong together",
                counted(whole as usize, "piece"),
                counted(self.walls.len(), "object"),
                loose(&self.pieces.loose, "is apart", "are apart"),
                match in_the_air {
                    0 => String::new(),
                    1 => "; 1 of them begins above the tray, on support alone".to_owned(),
                    n => format!("; {n} of them begin above the tray, on support alone"),
                }
            ));
        }
        if let Some(washed) = &self.washed
            && washed.pieces > whole
        {
            words.push(format!(
                "the print falls into {} where support is washed off, for support lies right through it and comes out \
                 at its sides: {}; have the layers close it in (depth-from = \"surface\"), or print a resin in its \
                 place (output.background-as)",
                counted(washed.pieces as usize, "piece"),
                loose(&washed.loose, "comes off", "come off"),
            ));
        }
        if let [first, others @ ..] = self.pieces.glued.as_slice() {
            let [one, other] = first.map(|object| format!("object {} ({})", object + 1, self.walls[object].mesh));
            let more = match others.len() {
                0 => String::new(),
                more => format!(", and so do {}", counted(more, "other pair")),
            };
            words.push(format!(
                "{one} and {other} lie nearer together than voxels tell: they print as one piece{more}; move them a \
                 voxel or more apart, or let them touch if they belong together"
            ));
        }
        for (lost, walls) in self.lost_shells.iter().zip(&self.walls) {
            if let Some(first) = lost.first_mm {
                words.push(format!(
                    "{}: {} of {:.3} mm³ together will not be printed, the first at {}: no voxel's centre lies inside; \
                     thicken them, print larger, or take a printer of finer pitch",
                    walls.mesh,
                    counted(lost.count as usize, "shell"),
                    lost.mm3,
                    at(first)
                ));
            }
        }
        for walls in &self.walls {
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
                words.push(format!(
                    "{mesh}: {} of its surface is on walls and wires thinner than {} voxels ({limit_mm:.3} mm), \
                     {thinnest:.3} mm at {}: they break or are lost; thicken them{larger}",
                    percent(walls.thin_share),
                    walls::VOXELS,
                    at(place),
                ));
            }
            if walls.bare_share > WORTH_SAYING {
                words.push(format!(
                    "{mesh}: support lies bare on {} of its surface, where it is washed off; min-depth-mm in \
                     [[stacking.limit]] keeps it below",
                    percent(walls.bare_share)
                ));
            }
            if walls.hollow_share > HOLLOW_WORTH_SAYING {
                words.push(format!(
                    "{mesh}: {} of its surface is a skin over a wall of support, which holds nothing together; thicken \
                     the part, or lay less support (where layers are searched for, by max-mm of a [[stacking.limit]])",
                    percent(walls.hollow_share)
                ));
            }
            if walls.shallow_share > SHALLOW_WORTH_SAYING {
                let cure = match walls.takes_thin_parts {
                    true => "appearance.thin-parts = true gives them layers of their own",
                    false => "thicken them, or write layers that fit",
                };
                words.push(format!(
                    "{mesh}: {} of its surface is on parts too thin for their layers, of which the lowest are left \
                     out, and look otherwise than predicted; {cure}",
                    percent(walls.shallow_share)
                ));
            }
        }
        words
    }
}
