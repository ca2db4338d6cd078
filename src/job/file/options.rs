//! The tables that have defaults: clusters, stacking, field; and the printer and its resins, which have none.

use glam::DVec3;

use super::paths::InputPath;
use super::ranges as range;
use super::read::{Result, Table, Value};
use crate::search::{Judge, Norm, Objective, ResinLimit};
use crate::voxel::Printer;

/// Where the resins come from.
#[derive(Debug, Clone, PartialEq)]
pub enum MaterialSource {
    /// A built-in set, by its name.
    Set(String),
    /// A material file.
    File(InputPath),
}

/// How texels are grouped before the search.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ClusterOptions {
    /// Clusters at most, 1 to 65535; default 100.
    pub k: usize,
    /// Seed of the random start; default 1.
    pub seed: u64,
}

/// What the search for stackings may do.
#[derive(Debug, Clone, PartialEq)]
pub struct StackingOptions {
    /// Thickness of the whole stacking, mm, 0.01 to 100; default 5.
    pub max_thickness_mm: f64,
    /// Units the thickness is divided into, a power of two from 2 to 4096; default 64.
    pub units: usize,
    /// Depth of the search tree (blocks, not layers), 1 to 12; default 6.
    pub depth: usize,
    /// What the search minimises; default natural light's, its weight of the albedo (k = 0) from 0 to 1000000.
    pub objective: Objective,
    /// The model stackings are judged by; default transport, or Kubelka–Munk where a resin fits no coefficients.
    pub model: StackingModel,
    /// Resin that fills the inside below the stacking; `None`: nothing does. A job always has one, by default `black`.
    pub core: Option<String>,
    /// Limits of single resins, one each at most; support's default stands last if the job gives it none.
    pub limits: Vec<NamedLimit>,
    /// Whether layers may be mixtures; `None`: the job does not say, see [`super::Job::allows_mixtures`].
    pub mixtures: Option<bool>,
}

/// How the light in a stacking is predicted.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum StackingModel {
    /// Scalar Kubelka–Munk, layers of whole units.
    KubelkaMunk,
    /// The transport equation, which refines what Kubelka–Munk finds.
    Transport {
        /// Thinnest layer, mm, 0.001 to 10; `None`: a slice of the printer.
        min_layer_mm: Option<f64>,
        /// Thicknesses are multiples of this, mm, 0.001 to 10; `None`: any.
        layer_step_mm: Option<f64>,
    },
}

/// What fills the inside unless the job says otherwise.
const DEFAULT_CORE: &str = "black";

impl StackingOptions {
    /// The resin that fills the inside of an object.
    pub fn core_name(&self) -> &str {
        self.core.as_deref().unwrap_or(DEFAULT_CORE)
    }

    /// The model that judges stackings.
    pub fn judge(&self) -> Judge {
        match self.model {
            StackingModel::KubelkaMunk => Judge::KubelkaMunk,
            StackingModel::Transport { .. } => Judge::Transport,
        }
    }
}

/// What one resin is allowed to do in stackings that are searched for.
#[derive(Debug, Clone, PartialEq)]
pub struct NamedLimit {
    /// The resin.
    pub resin: String,
    /// No part of it above this depth, mm, 0 to 100; default 0, and 0.2 for support.
    pub min_depth_mm: f64,
    /// Thinnest layer, mm, 0 to 100; default 0.
    pub min_mm: f64,
    /// Thickest layer, mm, 0.0001 to 100; infinite (the default) when there is no such limit.
    pub max_mm: f64,
}

/// The resin that washes off and must not lie bare: the only one with a limit by default.
pub const SUPPORT: &str = "support";
/// Depth in mm that support keeps from the surface unless the job says otherwise.
pub const SUPPORT_MIN_DEPTH_MM: f64 = 0.2;

/// Limits that keep resins from the surface, in the order of their `names`: by the depth that is `given` for each, mm,
/// else as far as support keeps by default.
pub fn min_depth_limits<'a>(
    names: impl Iterator<Item = &'a str>,
    given: impl Fn(&str) -> Option<f64>,
) -> Vec<ResinLimit> {
    let default = |name: &str| if name == SUPPORT { SUPPORT_MIN_DEPTH_MM } else { 0.0 };
    let limit = |name| ResinLimit { min_depth_mm: given(name).unwrap_or(default(name)), ..ResinLimit::NONE };
    names.map(limit).collect()
}

impl StackingOptions {
    /// Whether a limit leaves no room for a resin above the core.
    pub fn leaves_out(&self, resin: &str) -> bool {
        let limit = self.limits.iter().find(|limit| limit.resin == resin);
        limit.is_some_and(|limit| limit.min_depth_mm >= self.max_thickness_mm)
    }

    /// The limits in the order of `resins`; [`ResinLimit::NONE`] for those without. Names that no resin bears are
    /// left out ([`Job::check_resins`](super::Job::check_resins) reports them). What has no room is in no layer and
    /// no mixture, not even in one of no thickness.
    pub fn resin_limits(&self, resins: &[&str]) -> Vec<ResinLimit> {
        let limit = |name: &&str| self.limits.iter().find(|limit| limit.resin == **name);
        let plain = |limit: &NamedLimit| ResinLimit {
            min_depth_mm: limit.min_depth_mm,
            min_mm: if self.leaves_out(&limit.resin) { 0.0 } else { limit.min_mm },
            max_mm: if self.leaves_out(&limit.resin) { 0.0 } else { limit.max_mm },
        };
        resins.iter().map(|name| limit(name).map_or(ResinLimit::NONE, plain)).collect()
    }
}

/// Which depth layers are laid by.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Distance {
    /// The exact distance to the triangles (the default).
    Exact,
    /// The Euclidean distance transform of a grid, as the paper does.
    Grid,
    /// The Lp-averaged distance, which keeps creases sharp.
    Lp {
        /// The exponent p, 2.1 to 64; default 8 (above 2 as theory wants; not tuned).
        exponent: f64,
    },
}

/// How depth is measured.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FieldOptions {
    /// The distance; default exact.
    pub distance: Distance,
    /// Whether boundaries between layers are dithered; `None`: the job does not say, see [`super::Job::dithers`].
    pub dither: Option<bool>,
}

/// Default of [`Distance::Lp`]'s exponent.
const DEFAULT_LP_EXPONENT: f64 = 8.0;

pub(super) const PRINTER_KEYS: &[&str] = &["preset", "name", "pitch-mm", "tray-mm", "max-colors", "min-slices"];

pub(super) fn read_printer(root: &Table<'_>) -> Result<Printer> {
    let table = root.require("printer", "a [printer] table with a preset or a pitch-mm")?.table()?;
    table.allow_only(PRINTER_KEYS)?;
    table.exclusive("preset", "pitch-mm")?;
    table.exclusive("preset", "name")?;
    let mut printer = match table.get("preset") {
        Some(preset) => {
            let name = preset.name("a printer")?;
            Printer::by_name(&name).map_err(|error| preset.unknown("printer", &name, error.hint))?
        }
        None => {
            let pitch = table.require("pitch-mm", "a pitch-mm, or a preset in its place")?;
            Printer {
                name: table.name("name", "a printer")?.unwrap_or_else(|| "custom".to_owned()),
                pitch_mm: DVec3::from_array(pitch.triple(range::PITCH)?),
                tray_mm: None,
                max_colors: None,
                min_slices: None,
            }
        }
    };
    if let Some(tray) = table.get("tray-mm") {
        let tray_mm = DVec3::from_array(tray.triple(range::TRAY)?);
        if tray_mm.cmplt(printer.pitch_mm).any() {
            return Err(tray.refuse_as("a tray smaller than one voxel", "a tray at least as large as pitch-mm"));
        }
        printer.tray_mm = Some(tray_mm);
    }
    if let Some(colors) = table.get("max-colors") {
        printer.max_colors = Some(colors.integer(range::COLORS)? as usize);
    }
    if let Some(slices) = table.get("min-slices") {
        printer.min_slices = Some(slices.integer(range::SLICES)? as usize);
    }
    Ok(printer)
}

pub(super) const MATERIALS_KEYS: &[&str] = &["set", "file"];

pub(super) fn read_materials(root: &Table<'_>) -> Result<MaterialSource> {
    let table = root.require("materials", "a [materials] table with a set or a file")?.table()?;
    table.allow_only(MATERIALS_KEYS)?;
    table.exclusive("set", "file")?;
    match table.get("file") {
        Some(file) => Ok(MaterialSource::File(file.file("a material file")?)),
        None => {
            let set = table.require("set", "the name of a built-in set of resins, or a file in its place")?;
            Ok(MaterialSource::Set(set.name("a built-in set of resins")?))
        }
    }
}

pub(super) const CLUSTERS_KEYS: &[&str] = &["k", "seed"];

pub(super) fn read_clusters(table: &Table<'_>) -> Result<ClusterOptions> {
    table.allow_only(CLUSTERS_KEYS)?;
    Ok(ClusterOptions {
        k: table.integer_or("k", 100, range::CLUSTERS)? as usize,
        seed: table.integer_or("seed", 1, range::SEED)?,
    })
}

pub(super) const STACKING_KEYS: &[&str] = &[
    "max-thickness-mm",
    "units",
    "depth",
    "objective",
    "dc-weight",
    "model",
    "min-layer-mm",
    "layer-step-mm",
    "core",
    "limit",
    "mixtures",
];

pub(super) fn read_stacking(table: &Table<'_>) -> Result<StackingOptions> {
    table.allow_only(STACKING_KEYS)?;
    Ok(StackingOptions {
        max_thickness_mm: table.number_or("max-thickness-mm", 5.0, range::MAX_THICKNESS)?,
        units: table.get("units").map_or(Ok(64), |units| read_units(&units))?,
        depth: table.integer_or("depth", 6, range::DEPTH)? as usize,
        objective: Objective {
            norm: table.get("objective").map_or(Ok(Norm::default()), |value| value.choice(&Norm::ALL))?,
            dc_weight: table.number_or("dc-weight", 1.0, range::DC_WEIGHT)?,
        },
        model: read_model(table)?,
        core: table.name("core", "a resin")?.or_else(|| Some(DEFAULT_CORE.to_owned())),
        limits: read_limits(table)?,
        mixtures: table.get("mixtures").map(|value| value.truth()).transpose()?,
    })
}

fn read_model(table: &Table<'_>) -> Result<StackingModel> {
    let transport = table.get("model").map_or(Ok(true), |value| value.choice(&[("km", false), ("transport", true)]))?;
    let number = |key| {
        let value = table.get(key);
        match value.filter(|_| !transport) {
            Some(value) => Err(value.refuse_as("a thickness that nothing uses", "model = \"transport\" beside it")),
            None => table.get(key).map(|value| value.number(range::PITCH)).transpose(),
        }
    };
    let (min_layer_mm, layer_step_mm) = (number("min-layer-mm")?, number("layer-step-mm")?);
    Ok(if transport { StackingModel::Transport { min_layer_mm, layer_step_mm } } else { StackingModel::KubelkaMunk })
}

fn read_units(value: &Value<'_>) -> Result<usize> {
    let units = value.integer(range::UNITS)?;
    if units.is_power_of_two() {
        return Ok(units as usize);
    }
    let above = units.next_power_of_two();
    Err(value.refuse(format!("{}: {} or {above} is next to it", range::UNITS, above / 2)))
}

pub(super) const LIMIT_KEYS: &[&str] = &["resin", "min-depth-mm", "min-mm", "max-mm"];

fn read_limits(table: &Table<'_>) -> Result<Vec<NamedLimit>> {
    let mut limits: Vec<NamedLimit> = Vec::new();
    let list = table.get("limit").map(|value| value.list("one or several [[stacking.limit]] tables")).transpose()?;
    for value in list.unwrap_or_default() {
        let table = value.table()?;
        table.allow_only(LIMIT_KEYS)?;
        let name = table.require("resin", "the name of a resin")?;
        let resin = name.name("a resin")?;
        if limits.iter().any(|limit| limit.resin == resin) {
            return Err(name.refuse_as(format!("a second limit for {resin:?}"), "one limit for each resin"));
        }
        let default_depth = if resin == SUPPORT { SUPPORT_MIN_DEPTH_MM } else { 0.0 };
        let limit = NamedLimit {
            min_depth_mm: table.number_or("min-depth-mm", default_depth, range::LIMIT_DEPTH)?,
            min_mm: table.number_or("min-mm", 0.0, range::LIMIT_MIN)?,
            max_mm: table.number_or("max-mm", f64::INFINITY, range::LIMIT_MAX)?,
            resin,
        };
        if let Some(max) = table.get("max-mm").filter(|_| limit.min_mm > limit.max_mm) {
            return Err(max.refuse_as(limit.max_mm.to_string(), format!("at least min-mm, which is {}", limit.min_mm)));
        }
        limits.push(limit);
    }
    if limits.iter().all(|limit| limit.resin != SUPPORT) {
        limits.push(NamedLimit {
            resin: SUPPORT.to_owned(),
            min_depth_mm: SUPPORT_MIN_DEPTH_MM,
            min_mm: 0.0,
            max_mm: f64::INFINITY,
        });
    }
    Ok(limits)
}

pub(super) const FIELD_KEYS: &[&str] = &["distance", "lp-exponent", "dither"];

pub(super) fn read_field(table: &Table<'_>) -> Result<FieldOptions> {
    table.allow_only(FIELD_KEYS)?;
    let lp = Distance::Lp { exponent: DEFAULT_LP_EXPONENT };
    let choices = [("exact", Distance::Exact), ("grid", Distance::Grid), ("lp", lp)];
    let mut distance = table.get("distance").map_or(Ok(Distance::Exact), |value| value.choice(&choices))?;
    if let Some(value) = table.get("lp-exponent") {
        let Distance::Lp { exponent } = &mut distance else {
            return Err(value.refuse_as("an exponent that nothing uses", "distance = \"lp\" beside it"));
        };
        *exponent = value.number(range::LP_EXPONENT)?;
    }
    let dither = table.get("dither").map(|value| value.truth()).transpose()?;
    if let Some(value) = table.get("dither").filter(|_| dither == Some(true) && distance != Distance::Exact) {
        return Err(value.refuse_as("true beside another distance", "distance = \"exact\" beside it"));
    }
    Ok(FieldOptions { distance, dither })
}

/// What becomes of objects that share space.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Overlap {
    /// The job is refused.
    #[default]
    Refuse,
    /// They are one: what of either lies within the other is no surface, and a voxel in both is the earlier one's.
    Union,
}

pub(super) fn read_overlap(root: &Table<'_>) -> Result<Overlap> {
    let choices = [("refuse", Overlap::Refuse), ("union", Overlap::Union)];
    root.get("overlap").map_or(Ok(Overlap::default()), |value| value.choice(&choices))
}

/// Gap between objects that are arranged, unless the job says otherwise, mm.
const DEFAULT_GAP_MM: f64 = 2.0;

/// The gap between objects where the job has them arranged.
pub(super) fn read_arrange(root: &Table<'_>) -> Result<Option<f64>> {
    let arrange = root.get("arrange").map_or(Ok(false), |value| value.truth())?;
    match root.get("gap-mm") {
        Some(value) if !arrange => Err(value.refuse_as("a gap that nothing uses", "arrange = true beside it")),
        Some(value) => value.number(range::GAP).map(Some),
        None => Ok(arrange.then_some(DEFAULT_GAP_MM)),
    }
}
