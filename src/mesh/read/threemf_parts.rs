//! What slicers note beside a 3MF model: which parts of it are printed, and which only help; and whether filaments of
//! several colours are laid, by parts or by height.
//!
//! PrusaSlicer and its kin keep ranges of an object's triangles in `Metadata/Slic3r_PE_model.config`; Bambu Studio and
//! OrcaSlicer keep kinds of an object's components in `Metadata/model_settings.config`.

use std::collections::{BTreeMap, BTreeSet};

use quick_xml::XmlVersion;
use quick_xml::events::{BytesStart, Event};

use crate::mesh::error::{Fault, Parsed};
use crate::words::one_line;

/// Part names of the two notes.
pub(super) const RANGES_PART: &str = "/Metadata/Slic3r_PE_model.config";
pub(super) const COMPONENTS_PART: &str = "/Metadata/model_settings.config";
/// Names of the parts that hold changes of colour by height: PrusaSlicer's, Bambu Studio's.
pub(super) const CHANGES_PARTS: [&str; 2] =
    ["/Metadata/Prusa_Slicer_custom_gcode_per_print_z.xml", "/Metadata/custom_gcode_per_layer.xml"];

/// What changes how others are printed.
pub(super) const MODIFIERS: &str = "modifier volumes";

/// What a part of an object is for.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Role {
    Printed,
    /// It changes how others are printed, or holds them up: a plural.
    Helper(&'static str),
    /// It takes shape away, or what it does is not known: its name in the file.
    Unread(String),
}

impl Role {
    /// By PrusaSlicer's and Bambu Studio's names.
    fn named(name: &str) -> Self {
        match name {
            "ModelPart" | "normal_part" => Self::Printed,
            "ParameterModifier" | "modifier_part" => Self::Helper(MODIFIERS),
            "SupportEnforcer" | "support_enforcer" => Self::Helper("support enforcers"),
            "SupportBlocker" | "support_blocker" => Self::Helper("support blockers"),
            other => Self::Unread(other.to_owned()),
        }
    }
}

/// Roles of the root model's objects' parts.
#[derive(Debug, Default)]
pub(super) struct Parts {
    /// First and last triangle of an object's parts that are not printed.
    ranges: BTreeMap<u32, Vec<(u32, u32, Role)>>,
    /// Object and component.
    components: BTreeMap<(u32, u32), Role>,
    /// Numbers of the filaments that parts are made of.
    filaments: BTreeSet<u32>,
    /// Whether the colour changes by height.
    changes: bool,
}

impl Parts {
    /// Reads what is there of the notes.
    pub(super) fn read(ranges: Option<&str>, components: Option<&str>, changes: &[String]) -> Parsed<Self> {
        let mut parts = Self::default();
        if let Some(text) = ranges {
            parts.read_ranges(text)?;
            parts.read_filaments(text, RANGES_PART)?;
        }
        if let Some(text) = components {
            parts.read_components(text)?;
            parts.read_filaments(text, COMPONENTS_PART)?;
        }
        for (text, part) in changes.iter().zip(CHANGES_PARTS) {
            for_each_tag(text, part, |_, attribute| {
                parts.changes |= attribute("color").is_some_and(|color| !color.trim().is_empty());
            })?;
        }
        Ok(parts)
    }

    /// The numbers of parts' filaments (`extruder`): a part's own, else its object's, else the first.
    fn read_filaments(&mut self, text: &str, part: &str) -> Parsed<()> {
        let (mut of_object, mut of_parts): (Option<u32>, Vec<Option<u32>>) = (None, Vec::new());
        let mut close = |of_object: Option<u32>, of_parts: &mut Vec<Option<u32>>| {
            of_parts.resize(of_parts.len().max(1), None);
            self.filaments.extend(of_parts.drain(..).map(|of_part| of_part.or(of_object).unwrap_or(1)));
        };
        let mut is_open = false;
        for_each_tag(text, part, |tag, attribute| match tag {
            "object" => {
                if std::mem::replace(&mut is_open, true) {
                    close(of_object, &mut of_parts);
                }
                of_object = None;
            }
            "volume" | "part" => of_parts.push(None),
            "metadata" if attribute("key").as_deref() == Some("extruder") => {
                let number = attribute("value").and_then(|value| value.trim().parse().ok()).filter(|&n: &u32| n > 0);
                *of_parts.last_mut().unwrap_or(&mut of_object) = number;
            }
            _ => {}
        })?;
        if is_open {
            close(of_object, &mut of_parts);
        }
        Ok(())
    }

    /// How colours are given that only the slicer's settings hold: a sentence.
    pub(super) fn lost_colors(&self) -> Option<&'static str> {
        match (self.filaments.len() > 1, self.changes) {
            (true, _) => Some("the colours of the filaments that parts are made of in a slicer are not read"),
            (false, true) => Some("colours that change by height in a slicer are not read"),
            (false, false) => None,
        }
    }

    fn read_ranges(&mut self, text: &str) -> Parsed<()> {
        let mut object = None;
        for_each_tag(text, RANGES_PART, |tag, attribute| {
            let number = |name: &str| attribute(name).and_then(|text| text.trim().parse().ok());
            match tag {
                "object" => object = number("id"),
                "volume" => {
                    if let (Some(object), Some(first), Some(last)) = (object, number("firstid"), number("lastid")) {
                        self.ranges.entry(object).or_default().push((first, last, Role::Printed));
                    }
                }
                "metadata" if attribute("type").as_deref() == Some("volume") => {
                    let value = attribute("value").unwrap_or_default();
                    let role = match attribute("key").as_deref() {
                        Some("volume_type") => Role::named(&value),
                        // Before there were types.
                        Some("modifier") if value == "1" => Role::named("ParameterModifier"),
                        _ => return,
                    };
                    let volumes = object.and_then(|object| self.ranges.get_mut(&object));
                    if let Some(last) = volumes.and_then(|volumes| volumes.last_mut()) {
                        last.2 = role;
                    }
                }
                _ => {}
            }
        })?;
        for volumes in self.ranges.values_mut() {
            volumes.retain(|(_, _, role)| *role != Role::Printed);
        }
        Ok(())
    }

    fn read_components(&mut self, text: &str) -> Parsed<()> {
        let mut object = None;
        for_each_tag(text, COMPONENTS_PART, |tag, attribute| {
            let id = || attribute("id").and_then(|text| text.trim().parse().ok());
            match tag {
                "object" => object = id(),
                "part" => {
                    if let (Some(object), Some(part), Some(subtype)) = (object, id(), attribute("subtype")) {
                        self.components.insert((object, part), Role::named(&subtype));
                    }
                }
                _ => {}
            }
        })
    }

    /// Ranges of an object's triangles that are not printed.
    pub(super) fn ranges(&self, object: u32) -> &[(u32, u32, Role)] {
        self.ranges.get(&object).map_or(&[], Vec::as_slice)
    }

    /// The role of an object's component.
    pub(super) fn component(&self, object: u32, component: u32) -> &Role {
        self.components.get(&(object, component)).unwrap_or(&Role::Printed)
    }
}

/// Calls `each` for every start tag with its local name and its attributes by name.
fn for_each_tag(text: &str, part: &str, mut each: impl FnMut(&str, &dyn Fn(&str) -> Option<String>)) -> Parsed<()> {
    let mut reader = quick_xml::Reader::from_str(text);
    loop {
        match reader.read_event() {
            Ok(Event::Start(tag) | Event::Empty(tag)) => {
                each(tag.local_name().as_ref(), &|name| attribute(&tag, name));
            }
            Ok(Event::Eof) => return Ok(()),
            Ok(_) => {}
            Err(error) => return Err(Fault::new(part, one_line(error), "well-formed XML")),
        }
    }
}

/// An attribute, entities resolved.
pub(super) fn attribute(tag: &BytesStart, name: &str) -> Option<String> {
    let attribute = tag.try_get_attribute(name).ok()??;
    Some(attribute.normalized_value(XmlVersion::default()).ok()?.into_owned())
}
