//! The XML of one 3MF model part (3MF core specification 1.3; materials and properties extension 1.2).
//!
//! Elements are told by their local names: the extensions read here reuse none of the core's. Those of other namespaces
//! may, and are not taken for them.

use std::collections::BTreeMap;

use glam::{DMat4, DVec3, Vec2};
use quick_xml::Reader;
use quick_xml::events::Event;
use quick_xml::name::QName;

use super::raw::{finite, plain};
use super::support::{self, Fate};
use super::threemf_tag::Tag;
use crate::mesh::error::{Fault, Parsed, quote};
use crate::mesh::{SurfaceMaterial, Wrap};
use crate::words::one_line;

/// One `.model` part.
#[derive(Default)]
pub(super) struct Model {
    pub(super) mm_per_unit: f64,
    pub(super) objects: BTreeMap<u32, Object>,
    pub(super) items: Vec<Item>,
    pub(super) properties: BTreeMap<u32, Properties>,
    pub(super) textures: BTreeMap<u32, TextureResource>,
    pub(super) warnings: Vec<String>,
    /// Colours that are given in ways not read, a sentence.
    pub(super) lost: Option<&'static str>,
}

#[derive(Default)]
pub(super) struct Object {
    pub(super) positions: Vec<DVec3>,
    pub(super) triangles: Vec<Triangle>,
    pub(super) components: Vec<Instance>,
    /// Why the object is no part of what is printed, as a plural: `objects of type support`.
    pub(super) left_out: Option<String>,
    /// What its shape is made of besides the mesh, which therefore cannot stand for it.
    pub(super) unread_shape: Option<&'static str>,
    /// First and last triangle of parts that Slic3r takes for modifiers.
    pub(super) modifiers: Vec<(u32, u32)>,
    /// The attribute that holds colours painted in a slicer.
    pub(super) painted: Option<&'static str>,
    /// Property group of triangles without their own, and its entry.
    group: Option<u32>,
    property: Option<(u32, u32)>,
}

impl Object {
    /// Drops vertices that no triangle uses, if they are many: what is placed often has to be small.
    fn drop_unused(&mut self) {
        const UNUSED: u32 = u32::MAX;
        if self.positions.len() <= 3 * self.triangles.len() {
            return;
        }
        let mut renamed = vec![UNUSED; self.positions.len()];
        let mut used = Vec::new();
        for corner in self.triangles.iter_mut().flat_map(|triangle| &mut triangle.corners) {
            let name = &mut renamed[*corner as usize];
            if *name == UNUSED {
                *name = used.len() as u32;
                used.push(self.positions[*corner as usize]);
            }
            *corner = *name;
        }
        self.positions = used;
    }
}

pub(super) struct Triangle {
    pub(super) corners: [u32; 3],
    /// Property group and its entry at every corner.
    pub(super) property: Option<(u32, [u32; 3])>,
}

/// An object placed: a build item or a component.
#[derive(Clone)]
pub(super) struct Instance {
    pub(super) object: u32,
    /// Another part that holds it (production extension).
    pub(super) part: Option<String>,
    pub(super) transform: DMat4,
}

/// What is to be printed, or not.
pub(super) struct Item {
    pub(super) instance: Instance,
    pub(super) printable: bool,
}

/// A group of surface properties that triangles refer to.
pub(super) enum Properties {
    Materials(Vec<SurfaceMaterial>),
    /// Colours that are interpolated over a triangle.
    Colors(Vec<SurfaceMaterial>),
    /// Coordinates with v upwards into a texture.
    Texture {
        texture: u32,
        coordinates: Vec<Vec2>,
    },
    /// The element of a group that is not read.
    Unread(&'static str),
}

/// A texture's image, and how it goes on beyond its edges.
pub(super) struct TextureResource {
    pub(super) path: String,
    pub(super) wrap: [Wrap; 2],
    /// Whether it ends there, along u and v.
    pub(super) ends: [bool; 2],
}

pub(super) fn parse(part: &str, text: &str) -> Parsed<Model> {
    let mut reader = Reader::from_str(text);
    let model = Model { mm_per_unit: 1.0, ..Model::default() };
    let mut builder =
        Builder { model, object: None, group: None, setting: None, foreign: Vec::new(), is_bounded_by_volume: false };
    let mut start = 0;
    let mut is_model = false;
    loop {
        let at = |start: usize| {
            let before = text.as_bytes().get(..start).unwrap_or_default();
            format!("{part}, line {}", 1 + before.iter().filter(|&&b| b == b'\n').count())
        };
        match reader.read_event() {
            Ok(Event::Start(tag) | Event::Empty(tag)) => {
                is_model |= tag.local_name().as_ref() == "model";
                builder.open(&Tag { tag: &tag, place: &|| at(start) })?;
            }
            Ok(Event::End(tag)) if tag.local_name().as_ref() == "object" && !builder.is_foreign(tag.name()) => {
                builder.close_object(|| at(start))?;
            }
            Ok(Event::End(_)) => builder.setting = None,
            Ok(Event::Text(text)) => builder.setting_is(&text),
            Ok(Event::Eof) => break,
            Ok(_) => {}
            Err(error) => return Err(Fault::new(at(start), one_line(error), "well-formed XML")),
        }
        start = reader.buffer_position() as usize;
    }
    if !is_model {
        return Err(Fault::new(part, "no model element", "a 3MF model"));
    }
    if builder.object.is_some() {
        return Err(Fault::new(part, "the end of the part", "</object>"));
    }
    Ok(builder.model)
}

struct Builder {
    model: Model,
    object: Option<(u32, Object)>,
    /// The property group being filled.
    group: Option<u32>,
    /// The slicer's setting of an object whose value follows.
    setting: Option<&'static str>,
    /// Prefixes of namespaces that are not read.
    foreign: Vec<String>,
    /// Whether volumetric data of the resources bounds what refers to it.
    is_bounded_by_volume: bool,
}

/// Attributes of triangles in which slicers keep colours that were painted.
const PAINTED: [&str; 2] = ["paint_color", "mmu_segmentation"];

/// Cura's settings of an object by which it is no part of the print.
const CURA_HELPERS: [&str; 4] =
    ["cura:support_mesh", "cura:anti_overhang_mesh", "cura:infill_mesh", "cura:cutting_mesh"];

/// Types of objects that are no part of the print: what holds it up while it is printed, sheets, and what only others
/// refer to.
const NOT_PRINTED: [&str; 4] = ["support", "solidsupport", "surface", "other"];

/// Elements that make a shape of an object in ways not read.
const UNREAD_SHAPES: [&str; 4] = ["booleanshape", "levelset", "displacementmesh", "implicitfunction"];

impl Builder {
    fn is_foreign(&self, name: QName) -> bool {
        name.prefix().is_some_and(|prefix| self.foreign.iter().any(|foreign| foreign == prefix.as_ref()))
    }

    fn open(&mut self, tag: &Tag) -> Parsed<()> {
        if self.is_foreign(tag.tag.name()) {
            return self.open_foreign(tag);
        }
        match tag.tag.local_name().as_ref() {
            "model" => self.model_tag(tag)?,
            "object" => self.open_object(tag)?,
            "vertex" => {
                let p = DVec3::new(tag.number("x")?, tag.number("y")?, tag.number("z")?);
                let p = finite(p, tag.place)?;
                self.object(tag)?.positions.push(p);
            }
            "triangle" => {
                let triangle = self.triangle(tag)?;
                let painted = tag.filled(&PAINTED);
                let object = self.object(tag)?;
                object.triangles.push(triangle);
                object.painted = object.painted.or(painted);
            }
            "component" => {
                let instance = tag.instance()?;
                self.object(tag)?.components.push(instance);
            }
            "item" => {
                let printable = tag.text("printable")?.is_none_or(|text| !["0", "false"].contains(&text.trim()));
                self.model.items.push(Item { instance: tag.instance()?, printable });
            }
            "metadata" if self.object.is_some() => {
                let name = tag.text("name")?.unwrap_or_default();
                self.setting = CURA_HELPERS.into_iter().find(|helper| name == *helper);
            }
            // Of Cura up to 4.0.
            "setting" if self.object.is_some() => {
                let key = tag.text("key")?.unwrap_or_default();
                self.setting = CURA_HELPERS.into_iter().find(|helper| helper.strip_prefix("cura:") == Some(&key));
            }
            "mesh" => {
                let has_volume = tag.text("volumeid")?.is_some();
                if let (true, true, Some((_, object))) = (has_volume, self.is_bounded_by_volume, &mut self.object) {
                    object.unread_shape = Some("volumedata");
                }
            }
            "basematerials" => self.open_group(tag, Properties::Materials(Vec::new()))?,
            "colorgroup" => self.open_group(tag, Properties::Colors(Vec::new()))?,
            "texture2dgroup" => {
                let texture = tag.number("texid")?;
                self.open_group(tag, Properties::Texture { texture, coordinates: Vec::new() })?;
            }
            "base" => {
                if tag.text("displaycolor")?.is_none() {
                    self.warn("a base material states no displaycolor: it is white");
                }
                let material = plain(tag.text("name")?.unwrap_or_default(), tag.color("displaycolor")?);
                self.add_material(material);
            }
            "color" => {
                let material = plain(tag.text("color")?.unwrap_or_default(), tag.color("color")?);
                self.add_material(material);
            }
            "tex2coord" => {
                let uv = Vec2::new(tag.number("u")?, tag.number("v")?);
                if let Some(Properties::Texture { coordinates, .. }) = self.group_mut() {
                    coordinates.push(uv);
                }
            }
            "texture2d" => {
                let path = tag.text("path")?.unwrap_or_default();
                let styles = [tag.text("tilestyleu")?, tag.text("tilestylev")?].map(Option::unwrap_or_default);
                let wrap = [0, 1].map(|axis| match styles[axis].as_str() {
                    "mirror" => Wrap::Mirror,
                    "clamp" | "none" => Wrap::Clamp,
                    _ => Wrap::Repeat,
                });
                let ends = [0, 1].map(|axis| styles[axis] == "none");
                self.model.textures.insert(tag.number("id")?, TextureResource { path, wrap, ends });
            }
            "compositematerials" => self.open_group(tag, Properties::Unread("composite materials"))?,
            "multiproperties" => self.open_group(tag, Properties::Unread("multi-properties"))?,
            _ => self.open_foreign(tag)?,
        }
        Ok(())
    }

    /// What extensions add that are not read.
    fn open_foreign(&mut self, tag: &Tag) -> Parsed<()> {
        match tag.tag.local_name().as_ref() {
            "beamlattice" => self.warn("beam lattices are not read, only the mesh beside them"),
            "slicestack" => self.warn("slice stacks are not read, only the mesh beside them"),
            "boundary" => match &mut self.object {
                Some((_, object)) => object.unread_shape = Some("volumedata"),
                None => self.is_bounded_by_volume = true,
            },
            "volumedata" => self.warn("volumetric data is not read, only the mesh it belongs to"),
            "color" | "composite" if self.is_foreign(tag.tag.name()) => {
                self.model.lost = Some("colours of volumetric data are not read");
            }
            // Of Slic3r: first and last triangle.
            "volume" => {
                let is_modifier = tag.text("modifier")?.as_deref() == Some("1");
                let (first, last) = (tag.optional("ts")?, tag.optional("te")?);
                if let (true, Some(first), Some(last), Some((_, object))) = (is_modifier, first, last, &mut self.object)
                {
                    object.modifiers.push((first, last));
                }
            }
            // Shapes by boolean operations, implicit functions and the like, which a mesh at most stands in for.
            other => {
                let unread = UNREAD_SHAPES.into_iter().find(|shape| *shape == other);
                if let (Some(shape), Some((_, object))) = (unread, &mut self.object) {
                    object.unread_shape = Some(shape);
                }
            }
        }
        Ok(())
    }

    fn warn(&mut self, what: &str) {
        if !self.model.warnings.iter().any(|said| said == what) {
            self.model.warnings.push(what.to_owned());
        }
    }

    fn model_tag(&mut self, tag: &Tag) -> Parsed<()> {
        let unit = tag.text("unit")?;
        self.model.mm_per_unit = match unit.as_deref() {
            Some("micron") => 1e-3,
            None | Some("millimeter") => 1.0,
            Some("centimeter") => 10.0,
            Some("inch") => 25.4,
            Some("foot") => 304.8,
            Some("meter") => 1000.0,
            Some(other) => {
                let found = format!("unit {}", quote(other.as_bytes()));
                return tag.fault(found, "micron, millimeter, centimeter, inch, foot or meter");
            }
        };
        for attribute in tag.tag.attributes().with_checks(false).flatten() {
            let Some(prefix) = attribute.key.as_ref().strip_prefix("xmlns:") else { continue };
            let namespace = tag.text_of_namespace(prefix)?.unwrap_or_default();
            if support::fate("3MF", &namespace) != Some(Fate::Read) {
                self.foreign.push(prefix.to_owned());
            }
        }
        for (list, kind) in [("requiredextensions", "required"), ("recommendedextensions", "recommended")] {
            for prefix in tag.text(list)?.unwrap_or_default().split_whitespace() {
                let namespace = tag.text_of_namespace(prefix)?.unwrap_or_default();
                if support::fate("3MF", &namespace) == Some(Fate::Read) {
                    continue;
                }
                // Most begin alike.
                let name =
                    namespace.strip_prefix("http://schemas.microsoft.com/3dmanufacturing/").unwrap_or(&namespace);
                let found = format!("{kind} extension {} ({})", quote(prefix.as_bytes()), quote(name.as_bytes()));
                if kind == "required" {
                    return tag.fault(found, "only the materials, production and triangle set extensions");
                }
                self.warn(&format!("{found} is not read: what it says of shape or colour is missing"));
            }
        }
        Ok(())
    }

    fn open_object(&mut self, tag: &Tag) -> Parsed<()> {
        if self.object.is_some() {
            return tag.fault("an object inside an object", "</object> before it");
        }
        let group: Option<u32> = tag.optional("pid")?;
        let property = group.zip(tag.optional("pindex")?);
        let kind = tag.text("type")?.unwrap_or_default();
        let left_out = NOT_PRINTED.contains(&kind.as_str()).then(|| format!("objects of type `{kind}`"));
        let resolution = tag.text("meshresolution")?;
        // Its mesh is coarse, or made unlike on purpose (production alternatives).
        let stands_in =
            tag.text("modelresolution")?.is_some_and(|kind| ["lowres", "obfuscated"].contains(&kind.as_str()));
        let unread_shape = match (resolution.as_deref(), tag.text("slicestackid")?) {
            _ if stands_in => Some("an alternative of full resolution"),
            (Some("lowres"), _) => Some("slices of higher resolution"),
            // By the specification the mesh would count; in files it is no more than the box around the slices.
            (None, Some(_)) => Some("slices (slicestackid)"),
            _ => None,
        };
        let object = Object { left_out, unread_shape, group, property, ..Object::default() };
        self.object = Some((tag.number("id")?, object));
        Ok(())
    }

    /// The value of the setting just opened.
    fn setting_is(&mut self, value: &str) {
        let is_on = ["true", "1"].iter().any(|on| value.trim().eq_ignore_ascii_case(on));
        if let (Some(setting), true, Some((_, object))) = (self.setting, is_on, &mut self.object) {
            object.left_out = Some(format!("objects that are `{setting}`"));
        }
    }

    fn object(&mut self, tag: &Tag) -> Parsed<&mut Object> {
        match &mut self.object {
            Some((_, object)) => Ok(object),
            None => tag.fault("it outside of an object", "an object around it"),
        }
    }

    fn close_object(&mut self, place: impl Fn() -> String) -> Parsed<()> {
        let Some((id, object)) = self.object.take() else { return Ok(()) };
        let vertices = object.positions.len();
        let mut object = object;
        for (t, triangle) in object.triangles.iter().enumerate() {
            if let Some(i) = triangle.corners.iter().find(|&&i| i as usize >= vertices) {
                let found = format!("vertex index {i} in triangle {t} of object {id}");
                return Err(Fault::new(place(), found, format!("an index below {vertices}")));
            }
        }
        object.drop_unused();
        if self.model.objects.insert(id, object).is_some() {
            return Err(Fault::new(place(), format!("a second object {id}"), "ids used once"));
        }
        Ok(())
    }

    fn triangle(&self, tag: &Tag) -> Parsed<Triangle> {
        let corners = [tag.number("v1")?, tag.number("v2")?, tag.number("v3")?];
        let (group, default) = self.object.as_ref().map_or((None, None), |(_, object)| (object.group, object.property));
        let property = match tag.optional("p1")? {
            Some(p1) => {
                let group = tag.optional("pid")?.or(group);
                let p = [p1, tag.optional("p2")?.unwrap_or(p1), tag.optional("p3")?.unwrap_or(p1)];
                group.map(|group| (group, p))
            }
            None => default.map(|(group, index)| (group, [index; 3])),
        };
        Ok(Triangle { corners, property })
    }

    fn open_group(&mut self, tag: &Tag, properties: Properties) -> Parsed<()> {
        let id = tag.number("id")?;
        self.group = Some(id);
        self.model.properties.insert(id, properties);
        Ok(())
    }

    fn group_mut(&mut self) -> Option<&mut Properties> {
        self.model.properties.get_mut(&self.group?)
    }

    fn add_material(&mut self, material: SurfaceMaterial) {
        if let Some(Properties::Materials(materials) | Properties::Colors(materials)) = self.group_mut() {
            materials.push(material);
        }
    }
}
