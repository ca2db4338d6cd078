//! What an object is to look like: where its colours come from, and what a job says of them.

use std::{
    fs,
    path::{Path, PathBuf},
};

use super::{
    Albedo, MeanFreePath, StartOptions, line,
    resins::{Resins, any_colours, beside},
};
use crate::{
    appearance::MeasuredMedium,
    colour::byte_to_linear,
    job::plan::read_picture,
    mesh::{Loaded, TriangleMesh},
    words::toml_string,
};

/// The measured material that stands in for colours where there are none.
const NO_COLOUR: &str = "marble";
/// The mean free path of what does not say, mm.
const MEAN_FREE_PATH: MeanFreePath = MeanFreePath::Same(0.5);
/// Linear channels further apart than this are a colour.
const COLOURFUL: f32 = 0.02;
/// The largest albedo that the set of greys, `synthetic`, does without becoming translucent.
const GREYS: f32 = 0.6;
/// Colours that stand for all of a mesh.
const SAMPLES: usize = 48;

/// Where a look is to come from.
#[derive(Debug, PartialEq)]
pub(super) enum Source {
    Preset(String),
    One(Albedo),
    Mesh { tells_path: bool },
    Image { path: PathBuf, has_uvs: bool },
    Nothing,
}

pub(super) struct Looks {
    pub source: Source,
    pub is_colourful: bool,
    /// Albedos go beyond what [`GREYS`] can do.
    is_bright: bool,
    /// Albedos that stand for all it has, linear.
    pub colours: Vec<[f32; 3]>,
}

impl Looks {
    pub fn of(loaded: &Loaded, path: &Path, options: &StartOptions, notes: &mut Vec<String>) -> Self {
        let one = |source: Source, albedo: [f32; 3]| Self {
            source,
            is_colourful: is_colour(albedo),
            is_bright: false,
            colours: vec![albedo],
        };
        if let Some(albedo) = options.albedo {
            return one(Source::One(albedo), albedo.linear());
        }
        let of_preset = |name: &str| {
            // An unknown name is the job's to refuse.
            MeasuredMedium::named(name).map_or([0.0; 3], |medium| medium.albedo().map(|channel| channel as f32))
        };
        if let Some(look) = &options.look {
            return one(Source::Preset(look.clone()), of_preset(look));
        }
        let mesh = &loaded.mesh;
        let has_own = mesh
            .materials
            .iter()
            .any(|material| material.base_color_texture.is_some() || material.base_color[..3] != [1.0; 3]);
        if loaded.lost_color.is_none() && (has_own || !mesh.corner_colors.is_empty()) {
            let tells_path = mesh.materials.iter().any(|material| material.mean_free_path_mm.is_some());
            notes.push("colour: the mesh's own".to_owned());
            let (is_colourful, is_bright) =
                (colors(mesh).any(is_colour), colors(mesh).flatten().any(|albedo| albedo > GREYS));
            let all = colors(mesh).count();
            let colours = colors(mesh).step_by(all.div_ceil(SAMPLES).max(1)).collect();
            return Self { source: Source::Mesh { tells_path }, is_colourful, is_bright, colours };
        }
        match image_beside(path) {
            Some(name) => {
                notes.push(format!("colour: {name}, which lies beside the mesh"));
                let path = path.with_file_name(&name);
                let (is_colourful, colours) = image_colours(&path);
                let is_bright = !is_colourful && colours.iter().flatten().any(|albedo| *albedo > GREYS);
                Self { source: Source::Image { path, has_uvs: !mesh.uvs.is_empty() }, is_colourful, is_bright, colours }
            }
            None => {
                notes.push("colour: none was found; marble in its place".to_owned());
                Self { is_colourful: false, ..one(Source::Nothing, of_preset(NO_COLOUR)) }
            }
        }
    }

    pub fn target(&self, text: &mut String, options: &StartOptions, resins: &Resins, job: &Path) {
        let path = options.mean_free_path_mm;
        let travels = || (path.unwrap_or(MEAN_FREE_PATH).toml(), "how far light travels between two events");
        let given = |text: &mut String| {
            if let Some(path) = path {
                line(text, &path.toml(), "in place of what was measured");
            }
        };
        match &self.source {
            Source::Preset(look) => {
                line(text, &format!("preset = {}", toml_string(look)), "a measured material");
                given(text);
            }
            Source::Nothing => {
                let code = format!("preset = \"{NO_COLOUR}\"");
                line(text, &code, "the mesh has no colour of its own; or skin1, wholemilk, …");
                given(text);
            }
            Source::One(albedo) => {
                line(text, "kind = \"texture\"", "");
                line(text, &albedo.toml(), "one albedo all over, as asked for");
                let (code, why) = travels();
                line(text, &code, why);
            }
            Source::Mesh { tells_path } => {
                line(text, "kind = \"texture\"", "albedo: the mesh's own base colour");
                let (code, why) = travels();
                match tells_path {
                    true if path.is_none() => {
                        line(text, &format!("# {code}"), "how far light travels: as the file says, with its size");
                    }
                    _ => line(text, &code, why),
                }
            }
            Source::Image { path: image, has_uvs } => {
                line(text, "kind = \"texture\"", "");
                line(text, &format!("albedo = {}", toml_string(&beside(image, job))), "found beside the mesh");
                if !has_uvs {
                    line(text, "projection = \"triplanar\"", "the mesh has no texture coordinates");
                }
                let (code, why) = travels();
                line(text, &code, why);
            }
        }
        // Of the built-in greys many albedos keep their ratios; one, or those that are dark enough, stay as they are.
        let greys = resins.are_greys();
        if greys && self.is_bright {
            line(text, &format!("max-albedo = {GREYS}"), "the brightest that 5 mm of white on black can do is 0.63");
        } else if !greys {
            line(text, "gamut-map = true", "what the resins cannot do is brought smoothly to what they can");
        }
    }
}

/// Every albedo of a mesh's surface, linear, 0 to 1: a corner's colour times its material's; of a textured one every
/// texel times the most that its corners have.
fn colors(mesh: &TriangleMesh) -> impl Iterator<Item = [f32; 3]> {
    let corners = |triangle: usize| mesh.corner_colors.get(triangle).copied().unwrap_or([[1.0; 3]; 3]);
    let material = |triangle: usize| mesh.material_of.get(triangle).map_or(0, |material| usize::from(*material));
    let mut most: Vec<Option<[f32; 3]>> = vec![None; mesh.materials.len()];
    for triangle in 0..mesh.triangles.len() {
        if let Some(most) = most.get_mut(material(triangle)) {
            let all = corners(triangle).into_iter().chain(*most);
            *most = all.reduce(|a, b| [0, 1, 2].map(|channel| a[channel].max(b[channel])));
        }
    }
    let times = |a: [f32; 3], b: [f32; 3]| [0, 1, 2].map(|channel| a[channel] * b[channel]);
    let textured = mesh.materials.iter().zip(most).flat_map(move |(material, most)| {
        let [r, g, b, _] = material.base_color;
        let tint = most.map(|most| times(most, [r, g, b]));
        let texels = material.base_color_texture.iter().flat_map(|texture| &texture.texels);
        let of = move |[r, g, b, _]: &[u8; 4]| Some(times(tint?, [*r, *g, *b].map(byte_to_linear)));
        texels.filter_map(of)
    });
    let plain = (0..mesh.triangles.len()).flat_map(move |triangle| {
        let material = mesh.materials.get(material(triangle));
        let base = match material {
            Some(material) if material.base_color_texture.is_some() => None,
            Some(material) => Some([material.base_color[0], material.base_color[1], material.base_color[2]]),
            None => Some([1.0; 3]),
        };
        base.into_iter().flat_map(move |base| corners(triangle).map(|corner| times(corner, base)))
    });
    plain.chain(textured)
}

/// Whether an image has colours rather than greys, and some of them, linear, spread over it; any colours where it
/// cannot be read, which the job tells.
fn image_colours(path: &Path) -> (bool, Vec<[f32; 3]>) {
    let Ok(picture) = read_picture(path) else { return (true, any_colours()) };
    let side = SAMPLES.isqrt();
    let at = |step: usize| (step as f32 + 0.5) / side as f32;
    let colours = (0..side * side).map(|sample| picture.light(at(sample % side), at(sample / side)));
    (!picture.is_grey(), colours.collect())
}

/// Whether it is a colour rather than a grey.
fn is_colour([r, g, b]: [f32; 3]) -> bool {
    r.max(g).max(b) - r.min(g).min(b) > COLOURFUL
}

/// An image in the mesh's folder that is named after it and is no map of something else.
fn image_beside(mesh: &Path) -> Option<String> {
    let stem = mesh.file_stem()?.to_string_lossy().to_lowercase();
    let folder = mesh.parent().filter(|folder| *folder != Path::new("")).unwrap_or(Path::new("."));
    let mut names: Vec<String> = fs::read_dir(folder)
        .ok()?
        .filter_map(|entry| entry.ok()?.file_name().into_string().ok())
        .filter(|name| {
            let lower = name.to_lowercase();
            let is_image = [".png", ".jpg", ".jpeg"].iter().any(|extension| lower.ends_with(extension));
            let others = ["normal", "rough", "metal", "bump", "height", "occlusion", "mfp", "label", "preview"];
            is_image && lower.starts_with(&stem) && !others.iter().any(|other| lower.contains(other))
        })
        .collect();
    let says_colour = |name: &String| {
        let lower = name.to_lowercase();
        !["albedo", "basecolor", "base_color", "diffuse", "color", "colour", "texture"]
            .iter()
            .any(|w| lower.contains(w))
    };
    names.sort_by_key(|name| (says_colour(name), name.clone()));
    names.into_iter().next()
}
