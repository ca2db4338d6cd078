//! What a brick's volume fractions add to the grids of resins: active where there is something of the resin, with its
//! fraction from 0 to 1. Bricks of one composition are tiles.

use std::io;

use super::{
    Piece, in_leaf_order, mask_of,
    tree::{Inactive, Leaf},
    values,
};
use crate::{
    container::unit,
    voxel::{BrickFractions, WHOLE},
};

/// The pieces, each with its resin's id.
pub(super) fn pieces(brick: &BrickFractions) -> io::Result<Vec<(usize, Piece)>> {
    match brick {
        BrickFractions::Empty => Ok(Vec::new()),
        BrickFractions::Uniform(parts) => {
            let tile = |fraction: u16| Piece::Tile(unit(fraction).to_bits() as i32);
            Ok(parts.iter().map(|(resin, fraction)| (usize::from(resin.0), tile(*fraction))).collect())
        }
        BrickFractions::Each(resins) => {
            let leaf = |fractions| -> io::Result<Piece> {
                let fractions = in_leaf_order(fractions);
                let is_there = |fraction: u16| fraction != 0;
                let mask = mask_of(&fractions, is_there);
                let found = || fractions.iter().copied().filter(|fraction| is_there(*fraction));
                // A leaf without values is one of ones.
                let is_whole = found().all(|fraction| fraction == WHOLE);
                let words = found().map(|fraction| unit(fraction).to_bits());
                let values = (!is_whole).then(|| values(words)).transpose()?;
                Ok(Piece::Leaf(Leaf { mask, values, inactive: Inactive::Background }))
            };
            resins.iter().map(|(resin, fractions)| Ok((usize::from(resin.0), leaf(&**fractions)?))).collect()
        }
    }
}
