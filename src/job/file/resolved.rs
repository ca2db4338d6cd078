//! A job with every default spelt out: what the manifest keeps of it. It is a job itself: written as TOML beside
//! the same inputs it reads back to the same work.

use serde::Serialize;

use super::options::{Distance, MaterialSource, Overlap, StackingModel};
use super::output::VolumeValues;
use super::target::TargetSpec;
use super::texture::{AlbedoSource, Projection, TextureTarget};
use super::{Job, Scaling};

/// The canonical form of a [`Job`]: keys as in the job file, every default explicit, every object with its own target,
/// a preset as its numbers. It holds no absolute paths.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub struct ResolvedJob {
    #[serde(skip_serializing_if = "Option::is_none")]
    overlap: Option<&'static str>,
    #[serde(skip_serializing_if = "Option::is_none")]
    arrange: Option<bool>,
    #[serde(skip_serializing_if = "Option::is_none")]
    gap_mm: Option<f64>,
    object: Vec<Object>,
    printer: Printer,
    materials: Materials,
    clusters: Clusters,
    stacking: Stacking,
    appearance: Appearance,
    field: Field,
    output: Output,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case")]
struct Object {
    mesh: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    unit: Option<&'static str>,
    #[serde(skip_serializing_if = "Option::is_none")]
    scale: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    height_mm: Option<f64>,
    rotate_deg: [f64; 3],
    #[serde(skip_serializing_if = "Option::is_none")]
    position_mm: Option<[f64; 3]>,
    depth_from: &'static str,
    target: MappedTarget,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case")]
struct MappedTarget {
    #[serde(flatten)]
    target: Target,
    #[serde(skip_serializing_if = "Option::is_none")]
    gamut_map: Option<bool>,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(tag = "kind", rename_all = "lowercase", rename_all_fields = "kebab-case")]
enum Target {
    Stacking {
        stack: String,
    },
    Profile {
        profile: OneOrMany,
    },
    Texture {
        #[serde(skip_serializing_if = "Option::is_none")]
        albedo: Option<String>,
        #[serde(skip_serializing_if = "Option::is_none")]
        albedo_value: Option<f64>,
        #[serde(skip_serializing_if = "Option::is_none")]
        albedo_colour: Option<[f64; 3]>,
        #[serde(skip_serializing_if = "Option::is_none")]
        mean_free_path: Option<String>,
        #[serde(skip_serializing_if = "Option::is_none")]
        mean_free_path_mm: Option<OneOrThree>,
        #[serde(skip_serializing_if = "Option::is_none")]
        projection: Option<&'static str>,
        #[serde(skip_serializing_if = "Option::is_none")]
        tile_mm: Option<f64>,
        #[serde(skip_serializing_if = "Option::is_none")]
        max_albedo: Option<f64>,
    },
    Clusters {
        labels: String,
        profiles: Vec<OneOrMany>,
    },
    Bssrdf {
        map: String,
        #[serde(skip_serializing_if = "Option::is_none")]
        max_albedo: Option<f64>,
    },
}

/// A number for all channels, or one each.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(untagged)]
enum OneOrThree {
    One(f64),
    Three([f64; 3]),
}

impl OneOrThree {
    fn new(numbers: [f64; 3]) -> Self {
        if numbers == [numbers[0]; 3] { Self::One(numbers[0]) } else { Self::Three(numbers) }
    }
}

/// A path for all channels, or one for each.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(untagged)]
enum OneOrMany {
    One(String),
    Many(Vec<String>),
}

impl OneOrMany {
    fn new(paths: &[super::InputPath]) -> Self {
        match paths {
            [path] => Self::One(path.shown()),
            _ => Self::Many(paths.iter().map(super::InputPath::shown).collect()),
        }
    }
}

#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case")]
struct Printer {
    name: String,
    pitch_mm: [f64; 3],
    #[serde(skip_serializing_if = "Option::is_none")]
    tray_mm: Option<[f64; 3]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    max_colors: Option<usize>,
    #[serde(skip_serializing_if = "Option::is_none")]
    min_slices: Option<usize>,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(rename_all = "lowercase")]
enum Materials {
    Set(String),
    File(String),
}

#[derive(Debug, Clone, PartialEq, Serialize)]
struct Clusters {
    k: usize,
    seed: u64,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case")]
struct Stacking {
    max_thickness_mm: f64,
    units: usize,
    depth: usize,
    objective: &'static str,
    dc_weight: f64,
    model: &'static str,
    #[serde(skip_serializing_if = "Option::is_none")]
    min_layer_mm: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    layer_step_mm: Option<f64>,
    core: String,
    limit: Vec<Limit>,
    #[serde(skip_serializing_if = "Option::is_none")]
    mixtures: Option<bool>,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case")]
struct Limit {
    resin: String,
    min_depth_mm: f64,
    min_mm: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    max_mm: Option<f64>,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case")]
struct Appearance {
    rounds: u32,
    thin_parts: bool,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case")]
struct Field {
    distance: &'static str,
    #[serde(skip_serializing_if = "Option::is_none")]
    lp_exponent: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    dither: Option<bool>,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case")]
struct Output {
    formats: Vec<&'static str>,
    #[serde(skip_serializing_if = "Option::is_none")]
    volumes: Option<&'static str>,
    #[serde(skip_serializing_if = "Option::is_none")]
    mesh_pitch_mm: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    mesh_error_mm: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    background_as: Option<String>,
}

pub(super) fn resolve(job: &Job) -> ResolvedJob {
    let (distance, lp_exponent) = match job.field.distance {
        Distance::Exact => ("exact", None),
        Distance::Grid => ("grid", None),
        Distance::Lp { exponent } => ("lp", Some(exponent)),
    };
    let stacking = &job.stacking;
    let (model, min_layer_mm, layer_step_mm) = match stacking.model {
        StackingModel::KubelkaMunk => ("km", None, None),
        StackingModel::Transport { min_layer_mm, layer_step_mm } => ("transport", min_layer_mm, layer_step_mm),
    };
    ResolvedJob {
        overlap: (job.overlap == Overlap::Union).then_some("union"),
        arrange: job.arrange_gap_mm.map(|_| true),
        gap_mm: job.arrange_gap_mm,
        object: job.objects.iter().map(|it| object(it, job.arrange_gap_mm.is_some())).collect(),
        printer: Printer {
            name: job.printer.name.clone(),
            pitch_mm: job.printer.pitch_mm.to_array(),
            tray_mm: job.printer.tray_mm.map(|tray| tray.to_array()),
            max_colors: job.printer.max_colors,
            min_slices: job.printer.min_slices,
        },
        materials: match &job.materials {
            MaterialSource::Set(name) => Materials::Set(name.clone()),
            MaterialSource::File(path) => Materials::File(path.shown()),
        },
        clusters: Clusters { k: job.clusters.k, seed: job.clusters.seed },
        stacking: Stacking {
            max_thickness_mm: stacking.max_thickness_mm,
            units: stacking.units,
            depth: stacking.depth,
            objective: stacking.objective.norm.name(),
            dc_weight: stacking.objective.dc_weight,
            model,
            min_layer_mm,
            layer_step_mm,
            core: stacking.core_name().to_owned(),
            limit: stacking
                .limits
                .iter()
                .map(|limit| Limit {
                    resin: limit.resin.clone(),
                    min_depth_mm: limit.min_depth_mm,
                    min_mm: limit.min_mm,
                    max_mm: limit.max_mm.is_finite().then_some(limit.max_mm),
                })
                .collect(),
            mixtures: stacking.mixtures,
        },
        appearance: Appearance { rounds: job.rounds(), thin_parts: job.thin_parts() },
        field: Field { distance, lp_exponent, dither: job.field.dither },
        output: Output {
            formats: job.output.formats.iter().map(|format| format.name()).collect(),
            volumes: (job.output.volumes == VolumeValues::Fractions).then_some("fractions"),
            mesh_pitch_mm: job.output.mesh_pitch_mm,
            mesh_error_mm: job.output.mesh_error_mm,
            background_as: job.output.map_background.clone(),
        },
    }
}

fn object(object: &super::ObjectJob, arranged: bool) -> Object {
    let (scale, height_mm) = match object.scaling {
        Scaling::Scale(factor) => (Some(factor), None),
        Scaling::HeightMm(height) => (None, Some(height)),
    };
    Object {
        mesh: object.mesh.shown(),
        unit: object.unit.map(super::Unit::name),
        scale,
        height_mm,
        rotate_deg: object.rotate_deg,
        position_mm: (!arranged).then_some(object.position_mm),
        depth_from: match object.depth_from {
            super::DepthFrom::Surface => "surface",
            super::DepthFrom::Top => "top",
        },
        target: MappedTarget {
            target: target(&object.target),
            // Nothing is to be mapped where the stacking is given.
            gamut_map: (!matches!(object.target, TargetSpec::Stacking { .. })).then_some(object.gamut_map),
        },
    }
}

fn texture_target(texture: &TextureTarget) -> Target {
    let (albedo, albedo_value, albedo_colour) = match &texture.albedo {
        AlbedoSource::MeshBaseColor => (None, None, None),
        AlbedoSource::Texture(path) => (Some(path.shown()), None, None),
        AlbedoSource::Constant(value) => (None, Some(*value), None),
        AlbedoSource::Colour(colour) => (None, None, Some(*colour)),
    };
    let (projection, tile_mm) = match texture.projection {
        Projection::Coordinates => (None, None),
        Projection::Triplanar { tile_mm } => (Some("triplanar"), tile_mm),
    };
    Target::Texture {
        albedo,
        albedo_value,
        albedo_colour,
        mean_free_path: texture.mean_free_path.as_ref().map(super::InputPath::shown),
        mean_free_path_mm: texture.mean_free_path_mm.map(OneOrThree::new),
        projection,
        tile_mm,
        max_albedo: texture.max_albedo,
    }
}

fn target(spec: &TargetSpec) -> Target {
    match spec {
        TargetSpec::Stacking { stack } => Target::Stacking { stack: stack.to_string() },
        TargetSpec::Profile { paths } => Target::Profile { profile: OneOrMany::new(paths) },
        TargetSpec::Texture(texture) => texture_target(texture),
        TargetSpec::Clusters { labels, profiles } => Target::Clusters {
            labels: labels.shown(),
            profiles: profiles.iter().map(|paths| OneOrMany::new(paths)).collect(),
        },
        TargetSpec::Bssrdf { map, max_albedo } => Target::Bssrdf { map: map.shown(), max_albedo: *max_albedo },
    }
}
