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
mod words;

use serde::Serialize;

pub use pieces::{LoosePiece, Pieces};
pub use shells::LostShells;
pub use walls::Walls;
pub use washed::Washed;
pub use words::Complaint;

use super::{Prepared, RunError};
use crate::{optics::Mixture, watch::Watch};

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

impl Prepared {
    /// Whether a layer of that name prints as background: one resin that does, no mixture, and nothing in its place.
    fn is_background(&self, layer: &str) -> bool {
        let only = Mixture::parts_of_name(layer).filter(|parts| parts.len() == 1);
        let found = only.and_then(|parts| self.materials.resin(parts[0].0));
        self.job.output.map_background.is_none()
            && found.is_some_and(|(resin, _)| self.materials[resin].print_as_background)
    }

    /// Looks for what will not print well, and tells it as warnings.
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
        let found = Printable { pieces, washed, lost_shells, walls, inside_voxels };
        let tell = |complaint: Complaint| watch.found("warning", serde_json::json!(complaint));
        found.complaints().into_iter().for_each(tell);
        Ok(found)
    }
}
