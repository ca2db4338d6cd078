//! `[target]`: what a surface should look like under light, or the stacking it should be printed with.

use super::error::JobError;
use super::paths::InputPath;
use super::ranges::{CLUSTERS, MAX_ALBEDO};
use super::read::{Result, Table, Value};
use super::texture::{self, TextureTarget};
use crate::optics::Stack;

/// What an object should look like.
#[derive(Debug, Clone, PartialEq)]
pub enum TargetSpec {
    /// The same layers everywhere; nothing is optimised.
    Stacking {
        /// Layers of 0.0001 to 2000 mm, at least one. Not bound by `max-thickness-mm` nor by the limits, which are the
        /// search's.
        stack: Stack<String>,
    },
    /// The same profile everywhere.
    Profile {
        /// Profile CSVs: one for all channels, or one for each.
        paths: Vec<InputPath>,
    },
    /// A profile per texel, modelled from albedo and mean free path.
    Texture(TextureTarget),
    /// A profile per texel, chosen from a list.
    Clusters {
        /// Image of indices into `profiles`.
        labels: InputPath,
        /// 1 to 65535 profiles, each of one CSV for all channels or of one for each.
        profiles: Vec<Vec<InputPath>>,
    },
    /// Profiles factored from a measured 4D BSSRDF.
    Bssrdf {
        /// The folder that `lumislice factor` wrote.
        map: InputPath,
        /// The largest albedo of a cluster after rescaling, 0.001 to 1; `None`: not rescaled.
        max_albedo: Option<f64>,
    },
}

impl TargetSpec {
    /// Whether it is made of profiles that lie side by side: what each place shows is its neighbours' too.
    pub fn is_of_profiles(&self) -> bool {
        matches!(self, Self::Clusters { .. } | Self::Bssrdf { .. })
    }
}

/// The keys of each kind besides `kind` itself.
pub(super) const KINDS: &[(&str, &[&str])] = &[
    ("stacking", &["stack"]),
    ("profile", &["profile", "gamut-map"]),
    ("texture", texture::KEYS),
    ("clusters", &["labels", "profiles", "gamut-map"]),
    ("bssrdf", &["map", "max-albedo", "gamut-map"]),
];

/// Keys that a target of their kind cannot do without.
pub(super) const REQUIRED: &[&str] = &["stack", "profile", "labels", "profiles", "map"];

/// A target, and whether it is to be brought into the gamut.
pub(super) fn read_with_map(table: &Table<'_>) -> Result<(TargetSpec, bool)> {
    let target = read(table)?;
    Ok((target, table.get("gamut-map").map_or(Ok(false), |value| value.truth())?))
}

fn read(table: &Table<'_>) -> Result<TargetSpec> {
    let all: Vec<&str> = KINDS.iter().flat_map(|(_, keys)| *keys).copied().chain(["kind"]).collect();
    table.allow_only(&all)?;
    let kinds: Vec<_> = KINDS.iter().map(|kind| (kind.0, kind)).collect();
    let expected = "one of \"stacking\", \"profile\", \"texture\", \"clusters\", \"bssrdf\"";
    let (kind, keys) = match table.get("kind") {
        // A preset says what it is by itself.
        None if table.get("preset").is_some() => ("texture", texture::KEYS),
        _ => *table.require("kind", expected)?.choice(&kinds)?,
    };
    refuse_foreign_keys(table, kind, keys)?;
    match kind {
        "stacking" => {
            let stack = table.require("stack", "layers like \"white:0.5,support:1.0\"")?;
            let layers = stack.text("layers like \"white:0.5,support:1.0\"")?.parse();
            let layers =
                layers.map_err(|error| JobError::Stack { place: stack.place(), key: stack.key().to_owned(), error })?;
            Ok(TargetSpec::Stacking { stack: layers })
        }
        "profile" => Ok(TargetSpec::Profile { paths: read_profile(&table.require("profile", PROFILE_PATH)?)? }),
        "texture" => Ok(TargetSpec::Texture(texture::read(table)?)),
        "clusters" => {
            let labels = table.require("labels", "the path of an image of labels")?.file("an image of labels")?;
            let value = table.require("profiles", "an array of paths of profile CSVs")?;
            let list = value.list("an array of paths of profile CSVs")?;
            if list.is_empty() || list.len() as u64 > CLUSTERS.max {
                return Err(value.refuse(format!("1 to {} paths of profile CSVs", CLUSTERS.max)));
            }
            let profiles = list.iter().map(read_profile).collect::<Result<_>>()?;
            Ok(TargetSpec::Clusters { labels, profiles })
        }
        _ => {
            const MAP: &str = "a folder of factored profiles";
            Ok(TargetSpec::Bssrdf {
                map: table.require("map", "the path of a folder of factored profiles")?.folder(MAP)?,
                max_albedo: table.get("max-albedo").map(|value| value.number(MAX_ALBEDO)).transpose()?,
            })
        }
    }
}

const PROFILE: &str = "a profile CSV";
const PROFILE_PATH: &str = "the path of a profile CSV, or an array of one for each channel";

/// One path for all channels, or an array of one for each.
fn read_profile(value: &Value<'_>) -> Result<Vec<InputPath>> {
    match value.list("") {
        Ok(list) if list.is_empty() => Err(value.refuse(PROFILE_PATH)),
        Ok(list) => list.iter().map(|path| path.file(PROFILE)).collect(),
        Err(_) => Ok(vec![value.file(PROFILE)?]),
    }
}

/// Refuses keys that belong to another kind of target.
fn refuse_foreign_keys(table: &Table<'_>, kind: &str, keys: &[&str]) -> Result<()> {
    let known: Vec<&str> = keys.iter().copied().chain(["kind"]).collect();
    let Some((key, at)) = table.first_not_in(&known) else { return Ok(()) };
    let owner = KINDS.iter().find(|(_, keys)| keys.contains(&key.as_str())).map_or("another kind", |(name, _)| name);
    Err(table.error(
        at,
        &key,
        format!("a key of kind = \"{owner}\""),
        format!("only keys of kind = \"{kind}\": {}", keys.join(", ")),
    ))
}
