//! A triangle in pieces: cut along lines until none passes through a piece.
//!
//! Binary space partition (Fuchs, Kedem, Naylor, *On visible surface generation by a priori tree structures*, SIGGRAPH
//! 1980) in the triangle's plane: a line cuts the convex piece that it passes through all the way. Many lines are first
//! parted by upright and level cuts through their middle, which keeps the tree flat. Pieces need not meet those of the
//! next triangle corner to corner: distances do not mind.

use glam::{DVec2, DVec3};

use super::contact::{Line, Tolerance};

/// More lines than this are parted in the middle first.
const FEW: usize = 24;

/// Twice as wide as it is a four-cornered piece may seem to [`width`].
const NARROW: f64 = 2.0;

/// A corner of a piece: where it is in the plane, and its weights of the triangle's corners.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Corner {
    pub(super) at: DVec2,
    pub(super) weights: DVec3,
}

/// A convex part of a triangle, counter-clockwise.
pub(super) type Piece = Vec<Corner>;

struct Node {
    piece: Piece,
    /// The first of its two parts, which follow each other.
    parts: Option<usize>,
    /// Whether it stays; `None` of what is too narrow to be judged, which goes with what it was cut from.
    is_kept: Option<bool>,
    is_uniform: bool,
}

/// The parts of a triangle that `keeps` says stay, in as few pieces as the cuts leave; `None` if that is all of it.
///
/// Of parts narrower than `touch` nothing is asked. Between faces that miss each other by less, such a part lies in a
/// crack, with outside on one side for all that can be seen from there, and depth would be measured from it.
pub(super) fn kept(
    corners: [DVec2; 3],
    lines: Vec<Line>,
    Tolerance { touch, rounding }: Tolerance,
    mut keeps: impl FnMut(&Piece) -> bool,
) -> Option<Vec<Piece>> {
    let weights = [DVec3::X, DVec3::Y, DVec3::Z];
    let whole: Piece = corners.into_iter().zip(weights).map(|(at, weights)| Corner { at, weights }).collect();
    let node = |piece| Node { piece, parts: None, is_kept: None, is_uniform: true };
    let mut nodes = vec![node(whole)];
    let mut open = vec![(0_usize, lines)];
    while let Some((index, lines)) = open.pop() {
        match part(&nodes[index].piece, lines, rounding) {
            Some(([left, right], [left_lines, right_lines])) => {
                let first = nodes.len();
                nodes[index].parts = Some(first);
                nodes.extend([node(left), node(right)]);
                open.extend([(first, left_lines), (first + 1, right_lines)]);
            }
            None if index > 0 && width(&nodes[index].piece) < NARROW * touch => {}
            None => nodes[index].is_kept = Some(keeps(&nodes[index].piece)),
        }
    }
    // Parts follow their whole, so that backwards every whole comes after its parts.
    for index in (0..nodes.len()).rev() {
        if let Some(first) = nodes[index].parts {
            let [a, b] = [&nodes[first], &nodes[first + 1]];
            let is_alike = a.is_kept == b.is_kept || a.is_kept.is_none() || b.is_kept.is_none();
            let is_uniform = a.is_uniform && b.is_uniform && is_alike;
            let is_kept = a.is_kept.or(b.is_kept);
            (nodes[index].is_uniform, nodes[index].is_kept) = (is_uniform, is_kept);
        }
    }
    if nodes[0].is_uniform {
        let is_kept = nodes[0].is_kept.unwrap_or_else(|| keeps(&nodes[0].piece));
        return if is_kept { None } else { Some(Vec::new()) };
    }
    let mut pieces = Vec::new();
    let mut open = vec![0];
    while let Some(index) = open.pop() {
        let node = &mut nodes[index];
        match node.parts {
            Some(first) if !node.is_uniform => open.extend([first + 1, first]),
            _ if node.is_kept == Some(true) => pieces.push(std::mem::take(&mut node.piece)),
            _ => {}
        }
    }
    Some(pieces)
}

/// How wide a piece is across its longest side, mm, at least by half.
pub(super) fn width(piece: &Piece) -> f64 {
    let at = |i: usize| piece[i % piece.len()].at;
    let twice_area: f64 = (1..piece.len() - 1).map(|i| (at(i) - at(0)).perp_dot(at(i + 1) - at(0))).sum();
    let longest = (0..piece.len()).map(|i| at(i).distance(at(i + 1))).fold(0.0, f64::max);
    twice_area / longest
}

/// Cuts a piece in two, with the lines that are left to cut either; `None` if no line passes through it.
fn part(piece: &Piece, mut lines: Vec<Line>, rounding: f64) -> Option<([Piece; 2], [Vec<Line>; 2])> {
    if lines.len() > FEW {
        let middle = |line: &Line| 0.5 * (line[0] + line[1]);
        let (low, high) = lines
            .iter()
            .map(middle)
            .fold((DVec2::INFINITY, DVec2::NEG_INFINITY), |(low, high), p| (low.min(p), high.max(p)));
        let axis = usize::from((high - low).y > (high - low).x);
        let mut places: Vec<f64> = lines.iter().map(|line| middle(line)[axis]).collect();
        let half = places.len() / 2;
        let at = *places.select_nth_unstable_by(half, f64::total_cmp).1;
        let mut through = DVec2::ZERO;
        through[axis] = at;
        let mut across = DVec2::ZERO;
        across[axis] = 1.0;
        if let Some(parts) = split(piece, through, across, rounding) {
            let sides = divide(&lines, through, across, rounding);
            // Lines that all pass through the middle would never become fewer.
            if sides.iter().all(|side| 4 * side.len() < 3 * lines.len()) {
                return Some((parts, sides));
            }
        }
    }
    while let Some([from, to]) = lines.pop() {
        let Some(across) = (to - from).perp().try_normalize() else { continue };
        // A line that an earlier one was cut off from may lie beside this piece by now.
        if !passes(piece, [from, to], rounding) {
            continue;
        }
        if let Some(parts) = split(piece, from, across, rounding) {
            let sides = divide(&lines, from, across, rounding);
            return Some((parts, sides));
        }
    }
    None
}

/// Whether part of a line lies inside a piece.
fn passes(piece: &Piece, line: Line, rounding: f64) -> bool {
    let (mut from, mut to) = (0.0_f64, 1.0_f64);
    for (i, corner) in piece.iter().enumerate() {
        let edge = piece[(i + 1) % piece.len()].at - corner.at;
        let inwards = edge.perp().normalize_or_zero();
        let [a, b] = line.map(|p| inwards.dot(p - corner.at) - rounding);
        match (a > 0.0, b > 0.0) {
            (true, true) => {}
            (false, false) if edge.length() > rounding => return false,
            (false, true) => from = from.max(a / (a - b)),
            (true, false) => to = to.min(a / (a - b)),
            _ => {}
        }
    }
    from < to
}

/// Both parts of a piece, left and right of a line; `None` if one of them is no wider than rounding.
fn split(piece: &Piece, through: DVec2, across: DVec2, rounding: f64) -> Option<[Piece; 2]> {
    let sides: Vec<f64> = piece.iter().map(|corner| across.dot(corner.at - through)).collect();
    let reach = |sign: f64| sides.iter().any(|side| side * sign > rounding);
    if !reach(1.0) || !reach(-1.0) {
        return None;
    }
    let (mut left, mut right) = (Piece::new(), Piece::new());
    for (i, &corner) in piece.iter().enumerate() {
        let j = (i + 1) % piece.len();
        let [a, b] = [sides[i], sides[j]];
        if a >= -rounding {
            left.push(corner);
        }
        if a <= rounding {
            right.push(corner);
        }
        if (a > rounding && b < -rounding) || (a < -rounding && b > rounding) {
            let (share, next) = (a / (a - b), piece[j]);
            let cut = Corner { at: corner.at.lerp(next.at, share), weights: corner.weights.lerp(next.weights, share) };
            left.push(cut);
            right.push(cut);
        }
    }
    Some([left, right])
}

/// The lines on either side of a cut; those that cross it in two, those along it gone.
fn divide(lines: &[Line], through: DVec2, across: DVec2, rounding: f64) -> [Vec<Line>; 2] {
    let (mut left, mut right) = (Vec::new(), Vec::new());
    for line in lines {
        let [a, b] = line.map(|p| across.dot(p - through));
        if a.abs() <= rounding && b.abs() <= rounding {
            continue;
        }
        if a >= -rounding && b >= -rounding {
            left.push(*line);
        } else if a <= rounding && b <= rounding {
            right.push(*line);
        } else {
            let cut = line[0].lerp(line[1], a / (a - b));
            let [first, second] = [[line[0], cut], [cut, line[1]]];
            let (above, below) = if a > 0.0 { (first, second) } else { (second, first) };
            left.push(above);
            right.push(below);
        }
    }
    [left, right]
}
