//! Fewer and larger triangles, within a stated error.
//!
//! **In:** [`Interfaces`] as they were marched, the *fine* ones, and the boundaries that they stand for where these are
//! known exactly. **Out:** interfaces with fewer triangles that are no further from the fine ones, or from the exact
//! ones, than the error, nor these from them, wherever that was looked at: at every fine vertex, at every vertex that
//! was moved and along the edges between triangles that are not flat to each other, about every half edge of a fine
//! triangle. An edge that would break that is not collapsed, so what is too fine to be simplified stays fine.
//!
//! Edges are collapsed, the flattest first ([`quadric`]), and every triangle between two materials is there once: so
//! neighbours go on sharing their boundary. A vertex inside of a boundary may go anywhere; one on a curve where three
//! materials meet may only be joined with the next one on it; where curves meet, nothing moves.
//!
//! | file | what it does |
//! | --- | --- |
//! | `quadric` | how far a point is from the planes around it |
//! | `queue` | which edge comes next |
//! | `tile` | collapses in one cube of space |
//! | `fine` | distance to the fine triangles |
//! | `groups` | numbers by group: triangles around vertices, vertices near facets |
//!
//! Cubes are worked on in parallel, and all vertices with a triangle in another cube stay where they are. Then cubes
//! are larger and lie elsewhere, and every edge is tried again: what was refused may do once its neighbours are gone. So the result does not depend on threads.
//!
//! Not guaranteed: that two boundaries nearer to each other than twice the error do not touch.

mod fine;
mod groups;
mod quadric;
mod queue;
mod tile;

use glam::{DVec3, IVec3};
use rayon::prelude::*;

use self::{
    fine::Fine,
    groups::Groups,
    tile::{Changes, Tile},
};
use super::{
    MeshingError,
    exact::Exact,
    interfaces::{Facet, Interfaces},
};
use crate::parallel;
use crate::watch::Watch;

/// Edge of the first round's cubes in pitches; a cube then has some 10,000 triangles.
const CUBE: f64 = 40.0;
/// Where each round's cubes begin, as a share of their edge: no wall of one round lies on one of another.
const OFFSETS: [f64; 3] = [0.0, 0.31, 0.62];
/// Cubes of a round are so many times as large as those before.
const GROWTH: f64 = 2.0;

/// What becomes of a fine vertex.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Home {
    /// It is a vertex still, where it was.
    Itself,
    /// It lies near this facet.
    Facet(u32),
    /// It was on a curve, which has its own measure.
    Curve,
}

/// The mesh between rounds. A vertex keeps the number of a fine one.
struct Whole<'a> {
    fine: &'a Fine<'a>,
    positions: Vec<[f32; 3]>,
    facets: Vec<Facet>,
    homes: Vec<Home>,
    /// How far the fine curve is from the edges at a vertex on it, mm.
    curve_errors: Vec<f32>,
}

/// Fewer triangles within `error` mm of `interfaces`, which were marched at `pitch` mm, or of what is `exact`.
pub fn simplify(
    interfaces: Interfaces,
    exact: Exact<'_>,
    error: f64,
    pitch: f64,
    watch: &dyn Watch,
) -> Result<Interfaces, MeshingError> {
    let vertices = interfaces.positions.len();
    let fine = Fine::new(interfaces, exact);
    let mut whole = Whole {
        fine: &fine,
        positions: fine.positions.clone(),
        facets: fine.facets.clone(),
        homes: vec![Home::Itself; vertices],
        curve_errors: vec![0.0; vertices],
    };
    let mut cube = CUBE * pitch;
    for offset in OFFSETS {
        whole.round(cube, offset * cube, error, pitch, watch)?;
        cube *= GROWTH;
    }
    Ok(whole.finish())
}

/// Marks a vertex whose triangles lie in several cubes, or that has none.
const SEVERAL: u32 = u32::MAX;

impl Whole<'_> {
    fn round(&mut self, cube: f64, offset: f64, error: f64, pitch: f64, watch: &dyn Watch) -> Result<(), MeshingError> {
        let tiles = self.tiles(cube, offset);
        let mut owner = vec![None; self.positions.len()];
        for (number, tile) in (0..).zip(&tiles) {
            for &vertex in tile.iter().flat_map(|&facet| &self.facets[facet as usize].corners) {
                let owner: &mut Option<u32> = &mut owner[vertex as usize];
                *owner = Some(if owner.is_none_or(|owner| owner == number) { number } else { SEVERAL });
            }
        }
        let whole = &*self;
        let (owner, held) = (&owner, &whole.held());
        let changes: Vec<Changes> = parallel::map_in(
            tiles.len(),
            || vec![u32::MAX; whole.positions.len()],
            |local, n| {
                watch.go_on()?;
                let free = |vertex: u32| owner[vertex as usize] != Some(SEVERAL);
                let mut tile = Tile::new(whole, &tiles[n], held, free, [error, pitch], local);
                tile.collapse_all();
                Ok(tile.changes())
            },
        )
        .into_iter()
        .collect::<Result<_, MeshingError>>()?;
        self.facets.clear();
        for Changes { facets, moved, homes, curve_errors } in changes {
            let first = self.facets.len() as u32;
            self.facets.extend(facets);
            for (vertex, position) in moved {
                self.positions[vertex as usize] = position;
            }
            for (vertex, home) in homes {
                let home = if let Home::Facet(facet) = home { Home::Facet(first + facet) } else { home };
                self.homes[vertex as usize] = home;
            }
            for (vertex, error) in curve_errors {
                let known = &mut self.curve_errors[vertex as usize];
                *known = known.max(error);
            }
        }
        Ok(())
    }

    /// The facets of every cube, cube after cube.
    fn tiles(&self, cube: f64, offset: f64) -> Vec<Vec<u32>> {
        let at = |vertex: u32| DVec3::from(self.positions[vertex as usize].map(f64::from));
        let place = |facet: &Facet| {
            let [a, b, c] = facet.corners.map(at);
            (((a + b + c) / 3.0 - offset) / cube).floor().as_ivec3()
        };
        let key = |IVec3 { x, y, z }: IVec3| (z, y, x);
        let mut places: Vec<_> =
            (0..).zip(&self.facets).map(|(index, facet): (u32, _)| (key(place(facet)), index)).collect();
        places.par_sort_unstable();
        places.chunk_by(|p, q| p.0 == q.0).map(|tile| tile.iter().map(|&(_, facet)| facet).collect()).collect()
    }

    /// The fine vertices that lie near each facet.
    fn held(&self) -> Groups {
        Groups::new(self.facets.len(), || {
            (0..).zip(&self.homes).filter_map(|(vertex, home): (u32, _)| match home {
                Home::Facet(facet) => Some((*facet, vertex)),
                Home::Itself | Home::Curve => None,
            })
        })
    }

    /// The vertices in use, numbered anew, no two of them in one place.
    fn finish(self) -> Interfaces {
        let mut numbers = vec![u32::MAX; self.positions.len()];
        let mut out = Interfaces { positions: Vec::new(), facets: self.facets };
        for corner in out.facets.iter_mut().flat_map(|facet| &mut facet.corners) {
            let number = &mut numbers[*corner as usize];
            if *number == u32::MAX {
                *number = out.positions.len() as u32;
                out.positions.push(self.positions[*corner as usize]);
            }
            *corner = *number;
        }
        out
    }
}
