//! 3MF: the build assembled from a package's model parts.
//!
//! Only what is to be printed takes part: no support, no sheets, no helpers of slicers. What takes shape away, or
//! stands in for a shape that is not read, is refused by name.

use std::collections::BTreeMap;

use glam::{DMat4, Vec2};

use super::raw::{RawMesh, finite, plain, uv_or_zero};
use super::threemf_model::{Instance, Model, Object, Properties, TextureResource, Triangle};
use super::threemf_package::Package;
use super::threemf_parts::{MODIFIERS, Parts, Role};
use super::{Source, check_memory, texture};
use crate::mesh::SurfaceMaterial;
use crate::mesh::error::{Fault, Parsed, quote};
use crate::words::counted;

/// Deepest nesting of components.
const MAX_DEPTH: usize = 64;
/// Most objects placed, so that components that double at every level end.
const MAX_INSTANCES: usize = 100_000;
/// Most colours of a group that become materials of their own, each of which is a page of the target; larger groups are
/// colours of corners.
const MAX_PLAIN_COLORS: usize = 256;

pub(super) fn parse(source: &Source) -> Parsed<RawMesh> {
    let mut package = Package::open(source.bytes)?;
    let root = package.root_part()?;
    let models = package.models(&root)?;
    let parts = package.parts()?;
    let mut build = Build {
        raw: RawMesh::new(models[&root].mm_per_unit),
        root: &root,
        package,
        models: &models,
        parts,
        materials: BTreeMap::new(),
        plain: None,
        left_out: BTreeMap::new(),
        lost: BTreeMap::new(),
        transparent: 0,
        instances: 0,
    };
    build.raw.warnings = models.values().flat_map(|model| model.warnings.clone()).collect();
    for lost in models.values().filter_map(|model| model.lost) {
        build.raw.lose_color(lost.to_owned());
    }
    if let Some(lost) = build.parts.lost_colors() {
        build.raw.lose_color(lost.to_owned());
    }
    if models.values().any(|model| model.mm_per_unit != models[&root].mm_per_unit) {
        build.raw.warnings.push("parts differ in unit; the root model's counts".to_owned());
    }
    if models[&root].items.is_empty() {
        return Err(Fault::new(root, "a build without items", "at least one item to print"));
    }
    build.check_room()?;
    for item in &models[&root].items {
        if item.printable {
            build.place(&root, &item.instance, DMat4::IDENTITY, 0)?;
        } else {
            build.leave_out("items with printable=\"0\"");
        }
    }
    Ok(build.finish())
}

struct Build<'a> {
    raw: RawMesh,
    root: &'a str,
    package: Package<'a>,
    models: &'a BTreeMap<String, Model>,
    parts: Parts,
    /// Index into `raw.materials` of a part's property group and, for plain colours, its entry.
    materials: BTreeMap<(String, u32, u32), u16>,
    /// The material of triangles without property.
    plain: Option<u16>,
    /// What is no part of the print, and how much of it there is.
    left_out: BTreeMap<String, usize>,
    /// Why triangles have no colour, and how many.
    lost: BTreeMap<String, usize>,
    /// Triangles with a colour of alpha 0.
    transparent: usize,
    instances: usize,
}

/// Triangles and vertices of objects, by part and number.
type Sizes = BTreeMap<(String, u32), [u64; 2]>;

/// What a triangle looks like: its material, and what varies over it.
struct Look {
    material: u16,
    uv: Option<[Vec2; 3]>,
    colors: Option<[[f32; 3]; 3]>,
}

impl<'a> Build<'a> {
    /// Counts what is built before any of it is: components that multiply at every level fit in a small file.
    fn check_room(&mut self) -> Parsed<()> {
        let mut known = BTreeMap::new();
        let mut sum = [0u64; 2];
        for item in self.models[self.root].items.iter().filter(|item| item.printable) {
            let size = self.size_of(self.root, &item.instance, &mut known, 0);
            sum = [0, 1].map(|i| u64::saturating_add(sum[i], size[i]));
        }
        check_memory(|| format!("{}, the build with every component", self.root), sum[0], sum[1])
    }

    /// Triangles and vertices of an instance; of those known, each once. What is wrong with it is said where it is
    /// placed.
    fn size_of(&mut self, part: &str, instance: &Instance, known: &mut Sizes, depth: usize) -> [u64; 2] {
        let part = self.part_of(part, instance);
        let key = (part, instance.object);
        if let Some(&size) = known.get(&key) {
            return size;
        }
        // What contains itself is not counted again.
        known.insert(key.clone(), [0; 2]);
        let models = self.models;
        let object = models.get(&key.0).and_then(|model| model.objects.get(&instance.object));
        let Some(object) = object.filter(|_| depth <= MAX_DEPTH) else { return [0; 2] };
        let mut sum = match object.left_out {
            Some(_) if object.components.is_empty() => [0; 2],
            _ => [object.triangles.len() as u64, object.positions.len() as u64],
        };
        for component in &object.components {
            let size = self.size_of(&key.0, component, known, depth + 1);
            sum = [0, 1].map(|i| sum[i].saturating_add(size[i]));
        }
        known.insert(key, sum);
        sum
    }

    /// The part that holds an instance's object.
    fn part_of(&mut self, part: &str, instance: &Instance) -> String {
        match instance.part.as_deref() {
            Some(named) => self.package.spelled(named),
            None => part.to_owned(),
        }
    }

    fn place(&mut self, part: &str, instance: &Instance, parent: DMat4, depth: usize) -> Parsed<()> {
        let part = self.part_of(part, instance);
        let place = || format!("{part}, object {}", instance.object);
        self.instances += 1;
        if depth > MAX_DEPTH || self.instances > MAX_INSTANCES {
            let found = format!("component {} at depth {depth}", self.instances);
            return Err(Fault::new(
                place(),
                found,
                format!("at most {MAX_INSTANCES} components, {MAX_DEPTH} deep, no cycles"),
            ));
        }
        let models = self.models;
        let object = models.get(&part).and_then(|model| model.objects.get(&instance.object));
        let Some(object) = object else {
            return Err(Fault::new(place(), "no such object", "an object defined in that part"));
        };
        if let Some(shape) = object.unread_shape {
            return Err(Fault::new(place(), format!("a shape by {shape}"), "a shape by its mesh"));
        }
        let transform = parent * instance.transform;
        // An object's type does not count where it is made of components.
        match &object.left_out {
            Some(what) if object.components.is_empty() => self.leave_out(what),
            _ => self.add(&part, instance.object, object, transform)?,
        }
        for component in &object.components {
            let role = match part == self.root {
                true => self.parts.component(instance.object, component.object).clone(),
                false => Role::Printed,
            };
            match role {
                Role::Printed => self.place(&part, component, transform, depth + 1)?,
                Role::Helper(what) => self.leave_out(what),
                Role::Unread(what) => {
                    let found = format!("component {} of kind {}", component.object, quote(what.as_bytes()));
                    return Err(Fault::new(place(), found, EXPECTED_PARTS));
                }
            }
        }
        Ok(())
    }

    fn leave_out(&mut self, what: &str) {
        *self.left_out.entry(what.to_owned()).or_default() += 1;
    }

    fn lose(&mut self, what: String) {
        *self.lost.entry(what).or_default() += 1;
    }

    fn add(&mut self, part: &str, id: u32, object: &Object, transform: DMat4) -> Parsed<()> {
        let place = || format!("{part}, object {id}");
        let base = self.raw.positions.len();
        for &p in &object.positions {
            self.raw.positions.push(finite(transform.transform_point3(p), place)?);
        }
        let mut ranges = if part == self.root { self.parts.ranges(id).to_vec() } else { Vec::new() };
        let modifiers = object.modifiers.iter().map(|&(first, last)| (first, last, Role::Helper(MODIFIERS)));
        ranges.extend(modifiers);
        for (first, last, role) in &ranges {
            match role {
                Role::Printed => {}
                Role::Helper(what) => self.leave_out(what),
                Role::Unread(what) => {
                    let found = format!("a volume of kind {}, triangles {first} to {last}", quote(what.as_bytes()));
                    return Err(Fault::new(place(), found, EXPECTED_PARTS));
                }
            }
        }
        if let Some(attribute) = object.painted {
            self.lose(format!("colours painted in a slicer ({attribute})"));
        }
        let mirrored = transform.determinant() < 0.0;
        for (t, triangle) in (0..).zip(&object.triangles) {
            if ranges.iter().any(|(first, last, role)| (*first..=*last).contains(&t) && *role != Role::Printed) {
                continue;
            }
            let look = self.look(part, triangle)?;
            let order = if mirrored { [0, 2, 1] } else { [0, 1, 2] };
            let corners = order.map(|i| base as u32 + triangle.corners[i]);
            self.raw.push(place, corners, look.uv.map(|uv| order.map(|i| uv[i])))?;
            self.raw.material_of.push(look.material);
            if let Some(colors) = look.colors {
                self.raw.color_last(order.map(|i| colors[i]));
            }
        }
        Ok(())
    }

    fn look(&mut self, part: &str, triangle: &Triangle) -> Parsed<Look> {
        let models = self.models;
        let Some((group, p)) = triangle.property else {
            return Ok(Look { material: self.plain()?, uv: None, colors: None });
        };
        let model = &models[part];
        let outside = |count: usize| {
            let found = format!("entries {p:?} of property group {group}");
            Fault::new(part, found, format!("entries below {count}"))
        };
        let key = |entry: u32| (part.to_owned(), group, entry);
        match model.properties.get(&group) {
            None => {
                self.lose(format!("property group {group} of {part}, which is nowhere defined"));
                Ok(Look { material: self.plain()?, uv: None, colors: None })
            }
            Some(Properties::Unread(what)) => {
                self.lose(format!("{what} (property group {group} of {part})"));
                Ok(Look { material: self.plain()?, uv: None, colors: None })
            }
            Some(Properties::Materials(materials)) => {
                // Base materials do not mix: the first corner's is the triangle's.
                let material = materials.get(p[0] as usize).ok_or_else(|| outside(materials.len()))?;
                self.transparent += usize::from(is_transparent(material));
                Ok(Look { material: self.material(key(p[0]), || material.clone())?, uv: None, colors: None })
            }
            Some(Properties::Colors(colors)) => {
                let color = |i: u32| colors.get(i as usize).ok_or_else(|| outside(colors.len()));
                let corners = [color(p[0])?, color(p[1])?, color(p[2])?];
                self.transparent += usize::from(corners.into_iter().any(is_transparent));
                if p == [p[0]; 3] && colors.len() <= MAX_PLAIN_COLORS {
                    return Ok(Look {
                        material: self.material(key(p[0]), || corners[0].clone())?,
                        uv: None,
                        colors: None,
                    });
                }
                let material = self.material(key(u32::MAX), || plain(format!("colour group {group}"), [1.0; 4]))?;
                let colors = corners.map(|color| [color.base_color[0], color.base_color[1], color.base_color[2]]);
                Ok(Look { material, uv: None, colors: Some(colors) })
            }
            Some(Properties::Texture { texture, coordinates }) => {
                let mut uv = [Vec2::ZERO; 3];
                for (uv, &i) in uv.iter_mut().zip(&p) {
                    let c = coordinates.get(i as usize).ok_or_else(|| outside(coordinates.len()))?;
                    *uv = uv_or_zero(Vec2::new(c.x, 1.0 - c.y));
                }
                let texture = model.textures.get(texture);
                let leaves = |axis: usize| uv.iter().any(|uv| !(-EDGE..=1.0 + EDGE).contains(&uv[axis]));
                if let Some(texture) = texture
                    && (0..2).any(|axis| texture.ends[axis] && leaves(axis))
                {
                    self.lose(format!("texture `{}`, which ends where they go on (tile style none)", texture.path));
                }
                if let Some(&material) = self.materials.get(&key(0)) {
                    return Ok(Look { material, uv: Some(uv), colors: None });
                }
                let textured = self.textured(part, texture);
                Ok(Look { material: self.material(key(0), || textured)?, uv: Some(uv), colors: None })
            }
        }
    }

    fn plain(&mut self) -> Parsed<u16> {
        match self.plain {
            Some(index) => Ok(index),
            None => {
                let index = self.raw.add_material(|| "the build".to_owned(), plain("default", [1.0; 4]))?;
                self.plain = Some(index);
                Ok(index)
            }
        }
    }

    fn material(&mut self, key: (String, u32, u32), make: impl FnOnce() -> SurfaceMaterial) -> Parsed<u16> {
        if let Some(&index) = self.materials.get(&key) {
            return Ok(index);
        }
        let index = self.raw.add_material(|| key.0.clone(), make())?;
        self.materials.insert(key, index);
        Ok(index)
    }

    fn textured(&mut self, part: &str, texture: Option<&TextureResource>) -> SurfaceMaterial {
        let path = texture.map_or("", |texture| &texture.path);
        let bytes = self.package.part_from(part, path).map_err(|_| "there is no such part".to_owned());
        let base_color_texture = match bytes.and_then(|bytes| texture::decode(&bytes)) {
            Ok(texture) => Some(texture),
            Err(reason) => {
                self.raw.lose_color(format!("texture `{path}` cannot be read ({reason}): its triangles stay plain"));
                None
            }
        };
        let wrap = texture.map_or_else(Default::default, |texture| texture.wrap);
        SurfaceMaterial { base_color_texture, wrap, ..plain(path, [1.0; 4]) }
    }

    fn finish(mut self) -> RawMesh {
        for (what, count) in &self.left_out {
            self.raw.besides.push(format!("{what} ({count} left out)"));
            self.raw.warnings.push(format!("{what} are no part of the print: {count} left out"));
        }
        for shape in ["beam lattices", "slice stacks", "volumetric data"] {
            if self.raw.warnings.iter().any(|said| said.starts_with(shape)) {
                self.raw.besides.push(shape.to_owned());
            }
        }
        let objects = || self.models.values().flat_map(|model| model.objects.values());
        let empty = objects().filter(|object| object.components.is_empty() && object.triangles.is_empty()).count();
        self.raw.note_besides(empty, "object");
        if let (Some(what), true) = (self.raw.besides.last_mut(), empty > 0) {
            what.push_str(" without a triangle");
        }
        for (what, count) in std::mem::take(&mut self.lost) {
            let counted = if what.contains("painted") { counted(count, "object") } else { counted(count, "triangle") };
            self.raw.lose_color(format!("the colour of {counted} is not read: {what}"));
        }
        if self.transparent > 0 {
            let triangles = counted(self.transparent, "triangle");
            self.raw.warnings.push(format!(
                "{triangles} with a colour that is wholly transparent (alpha 0): printed in that colour all the same"
            ));
        }
        if let Some(plain) = self.plain {
            let bare = self.raw.material_of.iter().filter(|&&material| material == plain).count();
            if bare == self.raw.triangles.len() {
                // No colour at all is no white.
                self.raw.materials.clear();
                self.raw.material_of.clear();
            } else if self.raw.lost_color.is_none() {
                self.raw.warnings.push(format!("{} without a colour: white", counted(bare, "triangle")));
            }
        }
        self.raw
    }
}

fn is_transparent(material: &SurfaceMaterial) -> bool {
    material.base_color[3] == 0.0
}

/// What a slicer's parts may be.
const EXPECTED_PARTS: &str =
    "parts to be printed, modifiers and support: take volumes away in the slicer or a modeller";

/// How far beyond a texture's edge coordinates may lie by rounding.
const EDGE: f32 = 1e-5;
