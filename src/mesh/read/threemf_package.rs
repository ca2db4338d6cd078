//! The zip behind a 3MF file and the names of its parts (Open Packaging Conventions, ECMA-376 part 2).
//!
//! Part names are told apart without case; a target may be relative, and escape characters with `%`.

use std::collections::{BTreeMap, HashMap, HashSet};
use std::io::{Cursor, Read};

use quick_xml::events::Event;
use zip::ZipArchive;

use super::gltf_container::percent_decode;
use super::threemf_model::{self, Model};
use super::threemf_parts::{CHANGES_PARTS, COMPONENTS_PART, Parts, RANGES_PART, attribute};
use crate::encoding;
use crate::mesh::error::{Fault, Parsed, quote};
use crate::words::one_line;

/// Most bytes a part may unpack to: about 15 million triangles of XML, and a stop for zip bombs.
const MAX_PART_BYTES: u64 = 1 << 30;

/// An opened package.
pub(super) struct Package<'a> {
    zip: ZipArchive<Cursor<&'a [u8]>>,
    /// Entries by the name that all spellings share.
    entries: HashMap<String, usize>,
    /// Names that several entries have.
    doubled: HashSet<String>,
    /// Names by which parts were first referred to, by the name that all spellings share.
    spellings: HashMap<String, String>,
}

impl<'a> Package<'a> {
    pub(super) fn open(bytes: &'a [u8]) -> Parsed<Self> {
        match ZipArchive::new(Cursor::new(bytes)) {
            Ok(zip) => {
                let (mut entries, mut doubled) = (HashMap::new(), HashSet::new());
                for i in 0..zip.len() {
                    // An entry whose name cannot be read is none that anything refers to.
                    if let Some(Ok(name)) = zip.name_for_index(i)
                        && !name.ends_with('/')
                        && entries.insert(key(&name), i).is_some()
                    {
                        doubled.insert(key(&name));
                    }
                }
                Ok(Self { zip, entries, doubled, spellings: HashMap::new() })
            }
            Err(error) => Err(Fault::new("the package", one_line(error), "a zip archive")),
        }
    }

    /// A part's name from the root, in the spelling that was first seen.
    pub(super) fn spelled(&mut self, part: &str) -> String {
        self.spellings.entry(key(part)).or_insert_with(|| absolute(part)).clone()
    }

    fn has(&self, name: &str) -> bool {
        self.entries.contains_key(&key(name))
    }

    /// A part's bytes.
    pub(super) fn part(&mut self, name: &str) -> Parsed<Vec<u8>> {
        let place = || format!("part {}", quote(name.as_bytes()));
        let Some(&index) = self.entries.get(&key(name)) else {
            return Err(Fault::new(place(), "specified file not found in archive", "that part"));
        };
        if self.doubled.contains(&key(name)) {
            return Err(Fault::new(place(), "two entries of that name", "names used once, whatever their case"));
        }
        let file = self.zip.by_index(index).map_err(|error| Fault::new(place(), one_line(error), "that part"))?;
        let mut bytes = Vec::new();
        file.take(MAX_PART_BYTES + 1)
            .read_to_end(&mut bytes)
            .map_err(|error| Fault::new(place(), one_line(error), "intact compressed data"))?;
        if bytes.len() as u64 > MAX_PART_BYTES {
            return Err(Fault::new(place(), "more than 1 GiB unpacked", "a smaller part"));
        }
        Ok(bytes)
    }

    /// A part that another refers to: from the root, or failing that from the other's folder.
    pub(super) fn part_from(&mut self, part: &str, target: &str) -> Parsed<Vec<u8>> {
        let beside = absolute(&format!("{}/{target}", part.rsplit_once('/').map_or("", |(folder, _)| folder)));
        let name = if target.starts_with('/') || self.has(target) || !self.has(&beside) { target } else { &beside };
        self.part(name)
    }

    fn xml(&mut self, name: &str) -> Parsed<String> {
        let bytes = self.part(name)?;
        encoding::text(&bytes).map_err(|found| Fault::new(name, found, "UTF-8 or UTF-16"))
    }

    /// The model that the package's relationships name as its start, or the customary one.
    pub(super) fn root_part(&mut self) -> Parsed<String> {
        const CUSTOMARY: &str = "/3D/3dmodel.model";
        let Ok(rels) = self.xml("_rels/.rels") else { return Ok(self.spelled(CUSTOMARY)) };
        let mut reader = quick_xml::Reader::from_str(&rels);
        loop {
            match reader.read_event() {
                Ok(Event::Start(tag) | Event::Empty(tag)) if tag.local_name().as_ref() == "Relationship" => {
                    let is_model = attribute(&tag, "Type").is_some_and(|kind| kind.ends_with("/3dmodel"));
                    let is_inside = attribute(&tag, "TargetMode").is_none_or(|mode| mode != "External");
                    if let Some(target) = attribute(&tag, "Target").filter(|_| is_model && is_inside) {
                        return Ok(self.spelled(&target));
                    }
                }
                Ok(Event::Eof) => return Ok(self.spelled(CUSTOMARY)),
                Ok(_) => {}
                Err(error) => return Err(Fault::new("_rels/.rels", one_line(error), "well-formed XML")),
            }
        }
    }

    /// The root model and every part that it refers to, by [`absolute`] name.
    pub(super) fn models(&mut self, root: &str) -> Parsed<BTreeMap<String, Model>> {
        let mut models = BTreeMap::new();
        let mut wanted = vec![root.to_owned()];
        while let Some(name) = wanted.pop() {
            if models.contains_key(&name) {
                continue;
            }
            let model = threemf_model::parse(&name, &self.xml(&name)?)?;
            let items = model.items.iter().map(|item| &item.instance);
            let instances = items.chain(model.objects.values().flat_map(|object| &object.components));
            let parts = instances.filter_map(|instance| instance.part.as_deref());
            wanted.extend(parts.map(|part| self.spelled(part)));
            models.insert(name, model);
        }
        Ok(models)
    }

    /// What a slicer noted about the parts.
    pub(super) fn parts(&mut self) -> Parsed<Parts> {
        let mut note = |name: &str| self.has(name).then(|| self.xml(name)).transpose();
        let (ranges, components) = (note(RANGES_PART)?, note(COMPONENTS_PART)?);
        let [changes, others] = CHANGES_PARTS.map(|name| note(name).map(Option::unwrap_or_default));
        Parts::read(ranges.as_deref(), components.as_deref(), &[changes?, others?])
    }
}

/// A part's name from the root, `.` and `..` resolved.
fn absolute(part: &str) -> String {
    let mut folders = Vec::new();
    for step in part.split(['/', '\\']).filter(|step| !step.is_empty() && *step != ".") {
        if step == ".." {
            folders.pop();
        } else {
            folders.push(step);
        }
    }
    format!("/{}", folders.join("/"))
}

/// The name that all spellings of a part's name share.
fn key(part: &str) -> String {
    let name = absolute(part);
    String::from_utf8_lossy(&percent_decode(&name)).to_lowercase()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn part_names_are_told_apart_without_case_folder_steps_and_escapes() {
        for name in ["/3D/a b.model", "3d/A%20B.MODEL", "\\3D\\./x/../a b.Model", "/../3D//a b.model"] {
            assert_eq!(key(name), "/3d/a b.model", "{name}");
        }
    }
}
