//! A start tag of a 3MF model part and its attributes. Those that are there and are no numbers where they must be are
//! errors with their line.

use glam::{DMat4, DVec4};
use quick_xml::XmlVersion;
use quick_xml::events::BytesStart;

use super::text::expected_number;
use super::threemf_model::Instance;
use crate::colour::byte_to_linear;
use crate::mesh::error::{Fault, Parsed, quote};
use crate::words::one_line;

/// A start tag that knows its place.
pub(super) struct Tag<'a> {
    pub(super) tag: &'a BytesStart<'a>,
    pub(super) place: &'a dyn Fn() -> String,
}

impl Tag<'_> {
    pub(super) fn fault<T>(&self, found: impl Into<String>, expected: &str) -> Parsed<T> {
        Err(Fault::new((self.place)(), found, expected))
    }

    /// The first of these attributes that holds anything.
    pub(super) fn filled(&self, names: &[&'static str]) -> Option<&'static str> {
        for attribute in self.tag.attributes().with_checks(false).flatten() {
            let key = attribute.key.local_name();
            let name = names.iter().find(|name| key.as_ref() == **name);
            if name.is_some() && !attribute.value.trim().is_empty() {
                return name.copied();
            }
        }
        None
    }

    /// An attribute by local name, entities resolved.
    pub(super) fn text(&self, name: &str) -> Parsed<Option<String>> {
        for attribute in self.tag.attributes().with_checks(false) {
            let attribute = match attribute {
                Ok(attribute) => attribute,
                Err(error) => return self.fault(one_line(error), "well-formed attributes"),
            };
            if attribute.key.local_name().as_ref() == name {
                return match attribute.normalized_value(XmlVersion::default()) {
                    Ok(value) => Ok(Some(value.into_owned())),
                    Err(error) => self.fault(one_line(error), "a well-formed attribute"),
                };
            }
        }
        Ok(None)
    }

    pub(super) fn optional<T: std::str::FromStr>(&self, name: &str) -> Parsed<Option<T>> {
        let Some(text) = self.text(name)? else { return Ok(None) };
        match text.trim().parse() {
            Ok(value) => Ok(Some(value)),
            Err(_) => self
                .fault(format!("{name} = {}", quote(text.as_bytes())), &expected_number(text.as_bytes(), "a number")),
        }
    }

    pub(super) fn number<T: std::str::FromStr>(&self, name: &str) -> Parsed<T> {
        match self.optional(name)? {
            Some(value) => Ok(value),
            None => self.fault(format!("no {name}"), "that attribute"),
        }
    }

    /// A 3MF matrix: 12 numbers, rows of a 4×3 matrix that row vectors are multiplied with.
    pub(super) fn transform(&self) -> Parsed<DMat4> {
        let Some(text) = self.text("transform")? else { return Ok(DMat4::IDENTITY) };
        let values: Option<Vec<f64>> = text.split_whitespace().map(|word| word.parse().ok()).collect();
        match values.as_deref() {
            Some(&[a, b, c, d, e, f, g, h, i, x, y, z]) => Ok(DMat4::from_cols(
                DVec4::new(a, b, c, 0.0),
                DVec4::new(d, e, f, 0.0),
                DVec4::new(g, h, i, 0.0),
                DVec4::new(x, y, z, 1.0),
            )),
            _ => {
                let found = format!("transform {}", quote(text.as_bytes()));
                self.fault(found, &expected_number(text.as_bytes(), "12 numbers"))
            }
        }
    }

    pub(super) fn instance(&self) -> Parsed<Instance> {
        Ok(Instance { object: self.number("objectid")?, part: self.text("path")?, transform: self.transform()? })
    }

    /// `#RRGGBB` or `#RRGGBBAA` in sRGB, as linear RGBA.
    pub(super) fn color(&self, name: &str) -> Parsed<[f32; 4]> {
        let Some(text) = self.text(name)? else { return Ok([1.0; 4]) };
        let digits = text.trim().strip_prefix('#').unwrap_or("");
        let value = u32::from_str_radix(digits, 16).ok();
        let rgba = match (value, digits.len()) {
            (Some(rgb), 6) => rgb << 8 | 0xff,
            (Some(rgba), 8) => rgba,
            _ => return self.fault(format!("{name} = {}", quote(text.as_bytes())), "#RRGGBB or #RRGGBBAA"),
        };
        let [r, g, b, a] = rgba.to_be_bytes();
        let [r, g, b] = [r, g, b].map(byte_to_linear);
        Ok([r, g, b, f32::from(a) / 255.0])
    }

    /// The namespace that `xmlns:prefix` declares on this element.
    pub(super) fn text_of_namespace(&self, prefix: &str) -> Parsed<Option<String>> {
        // Its qualified name is `xmlns:prefix`, so its local name is the prefix.
        self.text(prefix)
    }
}
