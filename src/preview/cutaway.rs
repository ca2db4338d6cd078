//! The object with a quarter taken out, so that its layers show.
//!
//! One ray a pixel first; pixels beside a difference are then replaced by 2×2 rays each. Outlines are drawn between
//! those.

use glam::DVec3;
use rayon::prelude::*;

use super::{
    canvas::Canvas,
    legend::{Legend, millimetres},
    light::Pyramid,
    march::{Hit, Scene, View},
    section::Section,
    sheet::{BLOCK_GAP, MARGIN, side_note},
    style::{FAINT, INK, Linear, PAGE, Palette, encoded, linear, mix},
    text::Font,
    volume::Volume,
};
use crate::parallel;
use crate::{look, voxel::Lattice};

/// Most pixels the object spans.
const OBJECT: [f64; 2] = [1400.0, 900.0];
/// Least width of the picture.
const MIN_WIDTH: usize = 1200;
/// Where the camera stands: in front, to the right, above. Off the diagonal, so that the two faces differ.
const AZIMUTH_DEG: f64 = -58.0;
const ELEVATION_DEG: f64 = 27.0;
/// Towards the lamp: in front, to the left, high, so that both faces get light.
const LAMP: DVec3 = DVec3::new(-0.30, -0.50, 0.82);
/// Light from the lamp, from the sky and from the ground; white in full light stays just below 1.
const LAMP_LIGHT: f32 = 0.50;
const SKY_LIGHT: f32 = 0.50;
const GROUND_LIGHT: f32 = 0.26;
/// How dark the ground gets under the object.
const GROUND_SHADE: f32 = 0.55;
/// Light on the faces perpendicular to x and y: flat, so that materials keep their colours, but not the same.
const FACE_LIGHT: [f32; 2] = [0.80, 0.93];
/// How much of the darkening the faces take.
const FACE_DARKENING: f32 = 0.55;
/// Difference in linear light between neighbours from which a pixel is refined.
const CONTRAST: f32 = 0.04;
/// Strength of outlines.
const OUTLINE: f32 = 0.62;
/// How far around the smoothed surface voxels are looked for, cells.
const SURFACE_REACH: f64 = 2.5;
/// Most lines of sight across a pixel that holds several voxels.
const MOST_RAYS: usize = 4;
/// Specks of light added by resin's gloss.
const GLOSS: f32 = 0.06;

/// What a ray returns.
#[derive(Debug, Clone, Copy)]
struct Sample {
    colour: Linear,
    /// Towards the camera, mm.
    height: f32,
    part: Part,
}

/// What kind of thing a sample shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Part {
    Ground,
    Surface,
    Face(u8),
}

/// Draws the picture; with the `voxels` themselves, the surface shows the outermost ones.
pub(super) fn cutaway(
    lattice: &Lattice,
    volume: &Volume,
    voxels: Option<&look::Volume>,
    cuts: &[Section; 3],
    palette: &Palette,
    legend: &Legend,
) -> Canvas {
    let title = "Cut-away";
    let [x, y] = [0, 1].map(|axis| millimetres(lattice.coordinate(axis, cuts[axis].index)));
    let note = format!("a quarter taken out at x {x}, y {y}");
    let top = MARGIN + Font::Title.height() + BLOCK_GAP;
    let view = View::new(AZIMUTH_DEG.to_radians(), ELEVATION_DEG.to_radians());
    let focus = [0, 1].map(|axis| (f64::from(cuts[axis].index) + 0.5) * lattice.pitch[axis]);
    let Some(frame) = Frame::new(volume, &view, focus) else {
        let mut canvas = Canvas::new(MIN_WIDTH, top + 200, PAGE);
        Font::Title.draw(&mut canvas, [MARGIN, MARGIN], title, INK);
        Font::Normal.draw(&mut canvas, [MARGIN, top], "Nothing but background in these slices.", FAINT);
        return canvas;
    };
    let scene = Scene::new(volume, [&cuts[0], &cuts[1]], focus);
    let size = [frame.across[1] - frame.across[0], frame.upwards[1] - frame.upwards[0]];
    let scale = (OBJECT[0] / size[0]).min(OBJECT[1] / size[1]);
    let stage = Stage { pyramid: Pyramid::new(&scene), scene, voxels, view, palette, frame };
    let words = Font::Title.width(title) + 24 + Font::Normal.width(&note);
    let content = ((size[0] * scale).round() as usize).max(MIN_WIDTH - 2 * MARGIN).max(legend.min_width()).max(words);
    let foot = legend.layout(content, scale);
    let image = [content + 2 * MARGIN, (size[1] * scale).round() as usize + 2 * BLOCK_GAP];
    let foot_y = top + image[1];
    let mut canvas = Canvas::new(image[0], foot_y + foot.height + MARGIN, PAGE);
    let raster = Raster {
        size: image,
        scale,
        left: 0.5 * (frame.across[0] + frame.across[1]) - 0.5 * image[0] as f64 / scale,
        top: frame.upwards[1] + BLOCK_GAP as f64 / scale,
    };
    draw(&mut canvas, top, &raster, &stage);
    Font::Title.draw(&mut canvas, [MARGIN, MARGIN], title, INK);
    side_note(&mut canvas, title, &note);
    legend.draw(&mut canvas, [MARGIN, foot_y], &foot, palette);
    canvas
}

/// What is left of the object, as the camera sees it; mm.
#[derive(Debug, Clone, Copy)]
struct Frame {
    /// Range along the image's right vector, and along its up vector.
    across: [f64; 2],
    upwards: [f64; 2],
    /// Corners of the box around it.
    low: DVec3,
    high: DVec3,
}

impl Frame {
    /// `None` if nothing is left.
    fn new(volume: &Volume, view: &View, focus: [f64; 2]) -> Option<Self> {
        let edge = DVec3::from(volume.edge);
        let none = [f64::INFINITY, f64::NEG_INFINITY];
        let mut frame = Self { across: none, upwards: none, low: DVec3::INFINITY, high: DVec3::NEG_INFINITY };
        for ([first, last], [y, z]) in volume.solid_rows() {
            let low = DVec3::from([first, y, z].map(|cell| cell as f64)) * edge;
            let mut high = DVec3::from([last + 1, y + 1, z + 1].map(|cell| cell as f64)) * edge;
            if high.y <= focus[1] {
                high.x = high.x.min(focus[0]);
            }
            if high.x <= low.x {
                continue;
            }
            (frame.low, frame.high) = (frame.low.min(low), frame.high.max(high));
            let (middle, half) = (0.5 * (low + high), 0.5 * (high - low));
            for (range, axis) in [(&mut frame.across, view.right), (&mut frame.upwards, view.up)] {
                let (at, reach) = (middle.dot(axis), half.dot(axis.abs()));
                *range = [range[0].min(at - reach), range[1].max(at + reach)];
            }
        }
        (frame.low.x < frame.high.x).then_some(frame)
    }
}

/// Pixels on the image plane.
struct Raster {
    size: [usize; 2],
    /// Pixels per mm.
    scale: f64,
    /// Upper left corner on the image plane, mm.
    left: f64,
    top: f64,
}

/// Everything that a ray needs.
struct Stage<'a> {
    scene: Scene<'a>,
    voxels: Option<&'a look::Volume>,
    pyramid: Pyramid,
    view: View,
    palette: &'a Palette,
    frame: Frame,
}

impl Stage<'_> {
    /// The ray through pixel position (x, y).
    fn sample(&self, raster: &Raster, x: f64, y: f64) -> Sample {
        let right = raster.left + x / raster.scale;
        let up = raster.top - y / raster.scale;
        let point = self.view.right * right + self.view.up * up;
        match self.scene.hit(point, &self.view) {
            Some((height, Hit::Face { axis, id })) => {
                let place = point + self.view.toward * height;
                let colour = self.face(axis, id, place, raster.scale);
                Sample { colour, height: height as f32, part: Part::Face(axis as u8) }
            }
            Some((height, Hit::Surface)) => {
                let place = point + self.view.toward * height;
                Sample { colour: self.surface(place, raster.scale), height: height as f32, part: Part::Surface }
            }
            None => Sample {
                colour: self.ground(point, fade([x, y], raster.size)),
                height: f32::NEG_INFINITY,
                part: Part::Ground,
            },
        }
    }

    fn face(&self, axis: usize, id: u8, place: DVec3, scale: f64) -> Linear {
        let along = (place[1 - axis] + place.z) * scale;
        let base = self.palette.at(id, along as f32).unwrap_or_else(|| linear(PAGE));
        let normal = [DVec3::X, DVec3::NEG_Y][axis];
        let open = 1.0 - FACE_DARKENING * (1.0 - self.pyramid.openness(place, normal));
        base.map(|c| c * FACE_LIGHT[axis] * open)
    }

    fn surface(&self, place: DVec3, scale: f64) -> Linear {
        let base = self.outermost(place, scale).unwrap_or_else(|| self.blend(place));
        let normal = self.scene.normal(place);
        let lamp = LAMP.normalize();
        let open = self.pyramid.openness(place, normal);
        let facing = (normal.dot(lamp) as f32).max(0.0);
        let lit = if facing > 0.0 { self.pyramid.lit(place, normal, lamp) } else { 0.0 };
        let sky = 0.5 + 0.5 * normal.z as f32;
        let light = open * (GROUND_LIGHT + (SKY_LIGHT - GROUND_LIGHT) * sky) + LAMP_LIGHT * facing * lit;
        let half = (lamp + self.view.toward).normalize();
        let gloss = GLOSS * lit * (normal.dot(half).max(0.0) as f32).powi(24);
        base.map(|c| c * light + gloss)
    }

    /// Mean colour of the outermost voxels that lines of sight through a pixel around `place` meet; `None` where they
    /// are not known or none is met nearby.
    fn outermost(&self, place: DVec3, scale: f64) -> Option<Linear> {
        let voxels = self.voxels?;
        let pitch = voxels.lattice().pitch;
        let rays = (1.0 / (scale * pitch.min_element())).ceil().clamp(1.0, MOST_RAYS as f64) as usize;
        let (mut sum, mut met) = ([0.0; 3], 0.0);
        for n in 0..rays * rays {
            let across = |n: usize| ((n as f64 + 0.5) / rays as f64 - 0.5) / scale;
            let from = place + self.view.right * across(n % rays) + self.view.up * across(n / rays);
            if let Some(colour) = self.first_voxel(voxels, from / pitch).and_then(|id| self.palette.flat(id)) {
                sum = std::array::from_fn(|c| sum[c] + colour[c]);
                met += 1.0;
            }
        }
        (met > 0.0).then(|| sum.map(|c| c / met))
    }

    /// The first solid voxel on a line of sight near `from`, in voxels.
    fn first_voxel(&self, voxels: &look::Volume, from: DVec3) -> Option<u8> {
        let pitch = voxels.lattice().pitch;
        let step = -self.view.toward / pitch;
        // The surface that was met is a smoothed one, and within a cell of the voxels'.
        let reach = SURFACE_REACH * self.scene.volume.edge.into_iter().fold(0.0, f64::max);
        let start = from - step * reach;
        let mut voxel = start.floor();
        let way = |voxel: DVec3| {
            let wall = DVec3::select(step.cmpgt(DVec3::ZERO), voxel + 1.0, voxel);
            (wall - start) / step
        };
        let mut walls = way(voxel);
        let mut t = 0.0;
        while t < 2.0 * reach {
            let id = voxels.voxel(voxel.to_array().map(|v| v as i64)).0;
            let at = (voxel + 0.5) * pitch;
            let taken_out = at.x > self.scene.focus[0] && at.y < self.scene.focus[1];
            if id != 0 && !taken_out && self.palette.flat(id).is_some() {
                return Some(id);
            }
            let axis = if walls.x <= walls.y.min(walls.z) { 0 } else { 1 + usize::from(walls.z < walls.y) };
            t = walls[axis];
            voxel[axis] += step[axis].signum();
            walls[axis] = way(voxel)[axis];
        }
        None
    }

    /// Colour of the cells around `place`, where the voxels themselves are not known.
    fn blend(&self, place: DVec3) -> Linear {
        let (mut sum, mut weights) = ([0.0; 3], 0.0);
        self.scene.corners(place, |cell, weight| {
            if let Some(colour) = self.palette.flat(self.scene.volume.ids[cell]) {
                let weight = weight * f32::from(self.scene.volume.coverage(cell));
                weights += weight;
                sum = std::array::from_fn(|c| sum[c] + weight * colour[c]);
            }
        });
        if weights > 0.0 { sum.map(|c| c / weights) } else { linear(PAGE) }
    }

    /// The page where nothing is hit: darker on the ground beside the object.
    fn ground(&self, point: DVec3, strength: f32) -> Linear {
        let page = linear(PAGE);
        let Frame { low, high, .. } = self.frame;
        let place = point + self.view.toward * ((low.z - point.z) / self.view.toward.z);
        // Shadows end within the object's height around it.
        let reach = 1.5 * (high.z - low.z) + 4.0 * self.scene.volume.edge[0];
        if (0..2).any(|axis| place[axis] < low[axis] - reach || place[axis] > high[axis] + reach) {
            return page;
        }
        let lit = self.pyramid.lit(place, DVec3::Z, LAMP.normalize());
        let open = self.pyramid.openness(place, DVec3::Z) * (0.45 + 0.55 * lit);
        page.map(|c| c * (1.0 - GROUND_SHADE * strength * (1.0 - open)))
    }
}

/// 0 at the picture's edges, 1 further in: shadows must not be cut off by them.
fn fade([x, y]: [f64; 2], [width, height]: [usize; 2]) -> f32 {
    const BORDER: f64 = 140.0;
    let part = [x / BORDER, (width as f64 - x) / BORDER, 4.0 * (height as f64 - y) / BORDER]
        .into_iter()
        .fold(1.0, f64::min)
        .max(0.0);
    (part * part * (3.0 - 2.0 * part)) as f32
}

/// Renders into the canvas from row `top` on.
fn draw(canvas: &mut Canvas, top: usize, raster: &Raster, stage: &Stage<'_>) {
    let [width, height] = raster.size;
    let middle = |n: usize| stage.sample(raster, (n % width) as f64 + 0.5, (n / width) as f64 + 0.5);
    let coarse: Vec<Sample> = (0..width * height).into_par_iter().map(middle).collect();
    // At a silhouette the surface falls away over a few pixels; only a gap beyond that is an edge.
    let jump = (24.0 / raster.scale) as f32;

    // Four rays for the pixels that differ from one beside them.
    let fine: Vec<Vec<(usize, [Sample; 4])>> = parallel::map(height, |y| {
        let differs = |x: usize| {
            let own = &coarse[x + width * y];
            (y.saturating_sub(1)..(y + 2).min(height))
                .any(|v| (x.saturating_sub(1)..(x + 2).min(width)).any(|u| own.differs(&coarse[u + width * v], jump)))
        };
        let quarter = |x: usize| {
            std::array::from_fn(|n| {
                stage.sample(raster, x as f64 + 0.25 + 0.5 * (n % 2) as f64, y as f64 + 0.25 + 0.5 * (n / 2) as f64)
            })
        };
        (0..width).filter(|&x| differs(x)).map(|x| (x, quarter(x))).collect()
    });

    // The sample at a quarter of a pixel, counted in half pixels.
    let at = |x: usize, y: usize| {
        let row = &fine[y / 2];
        match row.binary_search_by_key(&(x / 2), |&(x, _)| x) {
            Ok(n) => row[n].1[x % 2 + 2 * (y % 2)],
            Err(_) => coarse[x / 2 + width * (y / 2)],
        }
    };
    let ink = linear(INK);
    parallel::rows(&mut canvas.pixels[top * width..(top + height) * width], width, |y, row| {
        let mut refined = fine[y].iter().peekable();
        for (x, pixel) in row.iter_mut().enumerate() {
            if refined.next_if(|(at, _)| *at == x).is_none() {
                *pixel = encoded(coarse[x + width * y].colour);
                continue;
            }
            let mut sum = [0.0; 3];
            for n in 0..4 {
                let (u, v) = (2 * x + n % 2, 2 * y + n / 2);
                let own = at(u, v);
                let beside = [(u.wrapping_sub(1), v), (u + 1, v), (u, v.wrapping_sub(1)), (u, v + 1)];
                let mut inside = beside.into_iter().filter(|&(u, v)| u < 2 * width && v < 2 * height);
                let edge = inside.any(|(u, v)| own.edge(&at(u, v), jump));
                let colour = if edge { mix(own.colour, ink, OUTLINE) } else { own.colour };
                sum = std::array::from_fn(|c| sum[c] + 0.25 * colour[c]);
            }
            *pixel = encoded(sum);
        }
    });
}

impl Sample {
    fn differs(&self, other: &Self, jump: f32) -> bool {
        self.part != other.part
            || (self.height - other.height).abs() > jump
            || (0..3).any(|c| (self.colour[c] - other.colour[c]).abs() > CONTRAST)
    }

    /// Whether an outline runs on this sample's side of the border to `other`: the nearer side draws it.
    fn edge(&self, other: &Self, jump: f32) -> bool {
        match (self.part, other.part) {
            (Part::Ground, _) => false,
            (_, Part::Ground) => true,
            (a, b) => self.height > other.height + jump || (a != b && self.height >= other.height),
        }
    }
}
