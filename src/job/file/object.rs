//! `[[object]]`: a mesh, where and how large it stands, and what it should look like.

use super::paths::InputPath;
use super::ranges::{ANGLE, COUNT, HEIGHT, POSITION, SCALE};
use super::read::{Result, Table};
use super::target::{self, TargetSpec};
use crate::mesh::Unit;

/// How large an object is printed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Scaling {
    /// The file's size in mm, times this; 0.000001 to 1000000, default 1.
    Scale(f64),
    /// The extent along z after rotation, mm; 0.01 to 2000.
    HeightMm(f64),
}

/// What depth is measured from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum DepthFrom {
    /// The whole surface.
    #[default]
    Surface,
    /// What of it looks up: a slab to be seen from above, layered straight down.
    Top,
}

/// One object on the tray.
#[derive(Debug, Clone, PartialEq)]
pub struct ObjectJob {
    /// The mesh file.
    pub mesh: InputPath,
    /// The unit of the file's numbers; `None`: the one the file states or implies.
    pub unit: Option<Unit>,
    /// Its size; default `Scale(1)`.
    pub scaling: Scaling,
    /// Rotation about the fixed axes x, y, z in this order, degrees, −360 to 360; default 0.
    pub rotate_deg: [f64; 3],
    /// Where its bounding box's minimum stands, mm, −2000 to 2000; default 0.
    pub position_mm: [f64; 3],
    /// What depth is measured from; default the whole surface.
    pub depth_from: DepthFrom,
    /// What it should look like: its own target, or else the job's.
    pub target: TargetSpec,
    /// Whether targets out of reach are brought into the resins' gamut before the search; default no.
    pub gamut_map: bool,
}

/// Names in the job file.
pub(super) const DEPTH_FROM: &[(&str, DepthFrom)] = &[("surface", DepthFrom::Surface), ("top", DepthFrom::Top)];

pub(super) const KEYS: &[&str] =
    &["mesh", "unit", "scale", "height-mm", "rotate-deg", "position-mm", "count", "depth-from", "target"];

/// Reads every object; `common` is the job's `[target]`, `arranged` whether the job finds them their places. Copies
/// come after all that are written, which so keep the numbers of their tables.
pub(super) fn read_all(
    root: &Table<'_>,
    common: Option<&(TargetSpec, bool)>,
    arranged: bool,
) -> Result<Vec<ObjectJob>> {
    const EXPECTED: &str = "one or several [[object]] tables";
    let value = root.require("object", EXPECTED)?;
    let objects = value.list(EXPECTED)?;
    if objects.is_empty() {
        return Err(value.refuse(EXPECTED));
    }
    let mut read_objects = Vec::new();
    let mut copies = Vec::new();
    for object in &objects {
        let table = object.table()?;
        let object = read(&table, common)?;
        if let Some(position) = table.get("position-mm").filter(|_| arranged) {
            return Err(position.refuse_as("a position beside arrange = true", "no position: the job finds one"));
        }
        if let Some(value) = table.get("count") {
            let count = value.integer(COUNT)?;
            if count > 1 && !arranged {
                return Err(value.refuse_as(format!("{count} at one place"), "arrange = true before the first table"));
            }
            copies.extend((1..count).map(|_| object.clone()));
        }
        read_objects.push(object);
    }
    read_objects.extend(copies);
    Ok(read_objects)
}

fn read(table: &Table<'_>, common: Option<&(TargetSpec, bool)>) -> Result<ObjectJob> {
    table.allow_only(KEYS)?;
    table.exclusive("scale", "height-mm")?;
    let own = table.get("target").map(|target| target::read_with_map(&target.table()?)).transpose()?;
    let scaling = match table.get("height-mm") {
        Some(height) => Scaling::HeightMm(height.number(HEIGHT)?),
        None => Scaling::Scale(table.number_or("scale", 1.0, SCALE)?),
    };
    let (target, gamut_map) = own
        .or_else(|| common.cloned())
        .ok_or_else(|| table.missing("target", "a [target] for the whole job or an [object.target] of its own"))?;
    Ok(ObjectJob {
        mesh: table.require("mesh", "the path of a mesh file")?.file("a mesh file")?,
        unit: table.get("unit").map(|unit| unit.choice(&Unit::ALL)).transpose()?,
        scaling,
        rotate_deg: table.triple_or("rotate-deg", [0.0; 3], ANGLE)?,
        position_mm: table.triple_or("position-mm", [0.0; 3], POSITION)?,
        depth_from: table.get("depth-from").map_or(Ok(DepthFrom::Surface), |value| value.choice(DEPTH_FROM))?,
        target,
        gamut_map,
    })
}
