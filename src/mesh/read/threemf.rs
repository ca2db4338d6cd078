//! 3MF packages: the zip, its relationships, and the build assembled from its model parts.

use std::collections::BTreeMap;
use std::io::{Cursor, Read};

use glam::{DMat4, Vec2};
use quick_xml::XmlVersion;
use quick_xml::events::Event;
use zip::ZipArchive;

use super::raw::{RawMesh, finite, plain, uv_or_zero};
use super::threemf_model::{self, Instance, Model, Object, Properties, Triangle};
use super::{MAX_TRIANGLES, Source, texture};
use crate::mesh::SurfaceMaterial;
use crate::mesh::error::{Fault, Parsed, quote};
use crate::words::one_line;

/// Most bytes a part may unpack to: about 15 million triangles of XML, and a stop for zip bombs.
const MAX_PART_BYTES: u64 = 1 << 30;
/// Deepest nesting of components.
const MAX_DEPTH: usize = 64;
/// Most objects placed, so that components that double at every level end.
const MAX_INSTANCES: usize = 100_000;

pub(super) fn parse(source: &Source) -> Parsed<RawMesh> {
    let mut package = Package::open(source.bytes)?;
    let root = package.root_part()?;
    let models = package.models(&root)?;
    let mut build = Build {
        raw: RawMesh::new(models[&root].mm_per_unit),
        package,
        models: &models,
        materials: BTreeMap::new(),
        plain: None,
        instances: 0,
    };
    build.raw.warnings = models.values().flat_map(|model| model.warnings.clone()).collect();
    if models.values().any(|model| model.mm_per_unit != models[&root].mm_per_unit) {
        build.raw.warnings.push("parts differ in unit; the root model's counts".to_owned());
    }
    if models[&root].items.is_empty() {
        return Err(Fault::new(root, "a build without items", "at least one item to print"));
    }
    for item in &models[&root].items {
        build.place(&root, item, DMat4::IDENTITY, 0)?;
    }
    Ok(build.raw)
}

struct Package<'a> {
    zip: ZipArchive<Cursor<&'a [u8]>>,
}

impl<'a> Package<'a> {
    fn open(bytes: &'a [u8]) -> Parsed<Self> {
        match ZipArchive::new(Cursor::new(bytes)) {
            Ok(zip) => Ok(Self { zip }),
            Err(error) => Err(Fault::new("the package", one_line(error), "a zip archive")),
        }
    }

    /// A part's bytes; part names start with a slash, zip entries do not.
    fn part(&mut self, name: &str) -> Parsed<Vec<u8>> {
        let entry = name.trim_start_matches('/');
        let place = || format!("part {}", quote(name.as_bytes()));
        let file = self.zip.by_name(entry).map_err(|error| Fault::new(place(), one_line(error), "that part"))?;
        let mut bytes = Vec::new();
        file.take(MAX_PART_BYTES + 1)
            .read_to_end(&mut bytes)
            .map_err(|error| Fault::new(place(), one_line(error), "intact compressed data"))?;
        if bytes.len() as u64 > MAX_PART_BYTES {
            return Err(Fault::new(place(), "more than 1 GiB unpacked", "a smaller part"));
        }
        Ok(bytes)
    }

    fn xml(&mut self, name: &str) -> Parsed<String> {
        String::from_utf8(self.part(name)?).map_err(|error| {
            Fault::new(name, format!("byte {} in no known encoding", error.utf8_error().valid_up_to()), "UTF-8")
        })
    }

    /// The model that the package's relationships name as its start, or the customary one.
    fn root_part(&mut self) -> Parsed<String> {
        const CUSTOMARY: &str = "/3D/3dmodel.model";
        let Ok(rels) = self.xml("_rels/.rels") else { return Ok(CUSTOMARY.to_owned()) };
        let mut reader = quick_xml::Reader::from_str(&rels);
        loop {
            match reader.read_event() {
                Ok(Event::Start(tag) | Event::Empty(tag)) if tag.local_name().as_ref() == "Relationship" => {
                    let attribute = |name: &str| {
                        let attribute = tag.try_get_attribute(name).ok()??;
                        Some(attribute.normalized_value(XmlVersion::default()).ok()?.into_owned())
                    };
                    if attribute("Type").is_some_and(|kind| kind.ends_with("/3dmodel"))
                        && let Some(target) = attribute("Target")
                    {
                        return Ok(absolute(&target));
                    }
                }
                Ok(Event::Eof) => return Ok(CUSTOMARY.to_owned()),
                Ok(_) => {}
                Err(error) => return Err(Fault::new("_rels/.rels", one_line(error), "well-formed XML")),
            }
        }
    }

    /// The root model and every part that it refers to, by name.
    fn models(&mut self, root: &str) -> Parsed<BTreeMap<String, Model>> {
        let mut models = BTreeMap::new();
        let mut wanted = vec![root.to_owned()];
        while let Some(name) = wanted.pop() {
            if models.contains_key(&name) {
                continue;
            }
            let model = threemf_model::parse(&name, &self.xml(&name)?)?;
            let instances = model.items.iter().chain(model.objects.values().flat_map(|object| &object.components));
            wanted.extend(instances.filter_map(|instance| instance.part.as_deref()).map(absolute));
            models.insert(name, model);
        }
        Ok(models)
    }
}

fn absolute(part: &str) -> String {
    format!("/{}", part.trim_start_matches('/'))
}

struct Build<'a> {
    raw: RawMesh,
    package: Package<'a>,
    models: &'a BTreeMap<String, Model>,
    /// Index into `raw.materials` of a part's property group and, for plain colours, its entry.
    materials: BTreeMap<(String, u32, u32), u16>,
    /// The material of triangles without property.
    plain: Option<u16>,
    instances: usize,
}

/// What an instance's triangles of one property group look like.
enum Look<'a> {
    Plain,
    Materials(&'a [SurfaceMaterial]),
    Texture { texture: Option<&'a String>, coordinates: &'a [Vec2] },
}

impl<'a> Build<'a> {
    fn place(&mut self, part: &str, instance: &Instance, parent: DMat4, depth: usize) -> Parsed<()> {
        let part = instance.part.as_deref().map_or_else(|| part.to_owned(), absolute);
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
        let transform = parent * instance.transform;
        self.add(&part, instance.object, object, transform)?;
        object.components.iter().try_for_each(|component| self.place(&part, component, transform, depth + 1))
    }

    fn add(&mut self, part: &str, id: u32, object: &Object, transform: DMat4) -> Parsed<()> {
        let place = || format!("{part}, object {id}");
        let base = self.raw.positions.len();
        if base + object.positions.len() > 3 * MAX_TRIANGLES {
            return Err(Fault::new(place(), "more vertices", format!("at most {} vertices", 3 * MAX_TRIANGLES)));
        }
        for &p in &object.positions {
            self.raw.positions.push(finite(transform.transform_point3(p), place)?);
        }
        let mirrored = transform.determinant() < 0.0;
        for triangle in &object.triangles {
            let (material, uv) = self.look(part, triangle)?;
            let order = if mirrored { [0, 2, 1] } else { [0, 1, 2] };
            let corners = order.map(|i| base as u32 + triangle.corners[i]);
            self.raw.push(place, corners, uv.map(|uv| order.map(|i| uv[i])))?;
            self.raw.material_of.push(material);
        }
        Ok(())
    }

    /// Material and texture coordinates of a triangle. One whose corners differ in colour takes the first's.
    fn look(&mut self, part: &str, triangle: &Triangle) -> Parsed<(u16, Option<[Vec2; 3]>)> {
        let (group, p) = triangle.property.unwrap_or((0, [0; 3]));
        let model = &self.models[part];
        let look = match triangle.property.and_then(|_| model.properties.get(&group)) {
            None => Look::Plain,
            Some(Properties::Materials(materials)) => Look::Materials(materials),
            Some(Properties::Texture { texture, coordinates }) => {
                Look::Texture { texture: model.textures.get(texture), coordinates }
            }
        };
        let outside = |count: usize| {
            let found = format!("entries {p:?} of property group {group}");
            Fault::new(part, found, format!("entries below {count}"))
        };
        match look {
            Look::Plain => Ok((self.plain()?, None)),
            Look::Materials(materials) => {
                let material = materials.get(p[0] as usize).ok_or_else(|| outside(materials.len()))?;
                Ok((self.material((part.to_owned(), group, p[0]), || material.clone())?, None))
            }
            Look::Texture { texture, coordinates } => {
                let mut uv = [Vec2::ZERO; 3];
                for (uv, &i) in uv.iter_mut().zip(&p) {
                    let c = coordinates.get(i as usize).ok_or_else(|| outside(coordinates.len()))?;
                    *uv = uv_or_zero(Vec2::new(c.x, 1.0 - c.y));
                }
                let key = (part.to_owned(), group, 0);
                if let Some(&index) = self.materials.get(&key) {
                    return Ok((index, Some(uv)));
                }
                let textured = self.textured(texture.map_or("", String::as_str));
                Ok((self.material(key, || textured)?, Some(uv)))
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

    fn textured(&mut self, path: &str) -> SurfaceMaterial {
        let bytes = self.package.part(path).map_err(|_| "there is no such part".to_owned());
        let base_color_texture = match bytes.and_then(|bytes| texture::decode(&bytes)) {
            Ok(texture) => Some(texture),
            Err(reason) => {
                self.raw.lose_color(format!("texture `{path}` cannot be read ({reason}): its triangles stay plain"));
                None
            }
        };
        SurfaceMaterial { name: path.to_owned(), base_color: [1.0; 4], base_color_texture }
    }
}
