//! The textures of a texture target, texel by texel: albedo and mean free path, wherever either comes from.

use glam::Vec2;

use super::{
    context::TargetContext,
    image_checks::{ALBEDO, PATH, tell},
    images::Picture,
};
use crate::{
    appearance::{AppearancePage, Reduction},
    colour::{LUMINANCE, byte_to_linear, to_channels},
    job::{
        RunError,
        file::{AlbedoSource, InputPath, OutputFormat, Projection, TextureTarget},
    },
    machine::{self, Shortage},
    mesh::{Projected, SurfaceMaterial},
    words::counted,
};

/// Pages of appearance with the page of every triangle.
pub(super) struct Appearance {
    pub pages: Vec<AppearancePage>,
    pub page_of: Vec<u16>,
    /// What 1 stands for in the pages' mean free paths, mm: for all channels, or for each.
    pub unit_mm: Vec<f64>,
    /// Whether colours were asked for that resins of one channel cannot have: their luminance is left.
    pub loses_colour: bool,
}

/// Bytes per texel of what a texture asks for, while it is laid on the surface: measured with 4 to 268 M texels.
pub(in crate::job) const TEXEL_BYTES: u64 = 64;
/// Light of a colour's channels that differs by less passes for grey.
const GREY: f32 = 0.03;
/// Longest mean free path that a mesh's materials are believed, mm: the longest that a job may name.
const LONGEST_MM: f64 = 1000.0;

/// What a page's colours come from.
struct Source<'a> {
    width: u32,
    height: u32,
    /// Linear colour at (u, v).
    colour: Box<dyn Fn(f32, f32) -> [f32; 3] + 'a>,
    /// Where its texels lay on the mesh's own coordinates, if elsewhere.
    baked_from: Option<&'a [Vec2]>,
    /// Where projected images lie on its texels.
    projected: Option<&'a [Projected]>,
    /// Mean free path of red, green and blue light, mm.
    path_mm: [f64; 3],
}

impl<'a> Source<'a> {
    fn plain(rgb: [f32; 3], path_mm: [f64; 3]) -> Self {
        let colour = Box::new(move |_, _| rgb);
        Self { width: 1, height: 1, colour, baked_from: None, projected: None, path_mm }
    }

    fn of_material(material: &'a SurfaceMaterial, given_mm: Option<[f64; 3]>) -> Self {
        let [r, g, b, _] = material.base_color;
        let own_mm = material.mean_free_path_mm.map(|path| path.map(|mm| mm.min(LONGEST_MM)));
        let source = Self::plain([r, g, b], given_mm.or(own_mm).unwrap_or([1.0; 3]));
        let Some(texture) = &material.base_color_texture else { return source };
        Self {
            width: texture.width,
            height: texture.height,
            colour: Box::new(move |u, v| {
                let texel = |at: f32, size: u32| ((at * size as f32) as u32).min(size - 1) as usize;
                let index = texel(u, texture.width) + texture.width as usize * texel(v, texture.height);
                let [tr, tg, tb, _] = texture.texels[index].map(byte_to_linear);
                [tr * r, tg * g, tb * b]
            }),
            baked_from: material.baked_from.as_deref(),
            projected: material.projected.as_deref(),
            ..source
        }
    }
}

impl Picture {
    /// What is seen where it is projected, of what `texel` is at (u, v).
    fn projected(&self, at: &Projected, texel: impl Fn(f32, f32) -> [f32; 3]) -> [f32; 3] {
        let aspect = self.width as f32 / self.height as f32;
        let mut sum = [0.0; 3];
        for (uv, share) in at.uvs.iter().zip(at.shares).filter(|(_, share)| *share > 0.0) {
            let rgb = texel(uv.x.rem_euclid(1.0), (uv.y * aspect).rem_euclid(1.0));
            sum.iter_mut().zip(rgb).for_each(|(sum, value)| *sum += share * value);
        }
        sum
    }
}

/// The one mean free path that stands for three where a resin's channel is luminance: their mean, weighted by what each
/// colour returns of it.
fn joined(albedo: [f32; 3], path: [f64; 3]) -> f64 {
    if path == [path[0]; 3] {
        return path[0];
    }
    let weights = || LUMINANCE.iter().zip(albedo).map(|(weight, albedo)| weight * f64::from(albedo));
    let total: f64 = weights().sum();
    match total > 0.0 {
        true => weights().zip(path).map(|(weight, path)| weight * path).sum::<f64>() / total,
        false => LUMINANCE.iter().zip(path).map(|(weight, path)| weight * path).sum(),
    }
}

impl TargetContext<'_> {
    /// Length on the surface that texels may be averaged to, mm, where nothing is written of the texture as it is: no
    /// voxel is finer.
    fn finest_texel_mm(&self) -> Option<f64> {
        let is_written = self.job.wants(OutputFormat::Heights);
        (!is_written).then(|| self.job.printer.pitch_mm.min_element())
    }

    /// The image of factors of mean free paths. Where all are 0 light enters nowhere, and nothing could be made of it.
    fn path_factors(&self, path: &InputPath, warnings: &mut Vec<String>) -> Result<Picture, RunError> {
        let factors = self.job.picture(PATH, path, warnings)?;
        let (zeros, texels) = (factors.zeros(), factors.width as usize * factors.height as usize);
        let name = path.shown();
        if factors.is_black() {
            return Err(self.refuse(PATH, format!("{name} of zeros"), "factors above 0 of mean-free-path-mm"));
        }
        let told = format!(
            "{PATH}: {name}: found {} of {texels} with a channel of 0, expected factors above 0 of mean-free-path-mm: \
             light would enter nowhere there, and goes as little far as is told apart from that",
            counted(zeros, "texel"),
        );
        if zeros > 0 {
            tell(warnings, told);
        }
        Ok(factors)
    }

    /// Reads the textures of a texture target.
    pub(super) fn appearance(
        &self,
        target: &TextureTarget,
        warnings: &mut Vec<String>,
    ) -> Result<Appearance, RunError> {
        let channels = self.materials.channels.len();
        let over_coordinates = target.projection == Projection::Coordinates;
        let factor = target.mean_free_path.as_ref();
        let factor = factor.map(|path| self.path_factors(path, warnings)).transpose()?;
        if factor.is_some() && over_coordinates {
            self.require_uvs("target.mean-free-path")?;
        }
        let mesh = &self.solid.mesh;
        let given_mm = target.mean_free_path_mm;
        let path_mm = given_mm.unwrap_or([1.0; 3]);
        let image = match &target.albedo {
            AlbedoSource::Texture(path) => {
                if over_coordinates {
                    self.require_uvs("target.albedo")?;
                }
                Some(self.job.picture(ALBEDO, path, warnings)?)
            }
            _ => None,
        };
        let image = image.as_ref();
        let mut page_of = Vec::new();
        let mut sources: Vec<Source<'_>> = match &target.albedo {
            AlbedoSource::Constant(albedo) => vec![Source::plain([*albedo as f32; 3], path_mm)],
            AlbedoSource::Colour(colour) => vec![Source::plain(colour.map(|value| value as f32), path_mm)],
            AlbedoSource::Texture(_) => image.map_or_else(Vec::new, |image| {
                let colour = Box::new(move |u, v| image.light(u, v));
                vec![Source { width: image.width, height: image.height, colour, ..Source::plain([0.0; 3], path_mm) }]
            }),
            AlbedoSource::MeshBaseColor => {
                if mesh.materials.is_empty() {
                    let name = self.job.objects[self.object].mesh.shown();
                    let found = format!("{name} without a base colour of its own");
                    return Err(self.refuse("target", found, "an albedo, an albedo-colour or an albedo-value"));
                }
                page_of = mesh.material_of.clone();
                mesh.materials.iter().map(|material| Source::of_material(material, given_mm)).collect()
            }
        };
        // Images were projected onto pages that the mesh was laid out on.
        let laid_out = mesh.materials.iter().any(|material| material.projected.is_some());
        if laid_out && target.albedo != AlbedoSource::MeshBaseColor {
            let rgb = (sources[0].colour)(0.0, 0.0);
            page_of = mesh.material_of.clone();
            let page =
                |material| Source { colour: Box::new(move |_, _| rgb), ..Source::of_material(material, given_mm) };
            sources = mesh.materials.iter().map(page).collect();
        }
        let alike = sources.iter().all(|source| source.path_mm == [source.path_mm[0]; 3]);
        let paths = match alike && factor.as_ref().is_none_or(Picture::is_grey) {
            false if channels == 3 => 3,
            _ => 1,
        };
        let mut unit_mm = vec![f64::MIN_POSITIVE; paths];
        let mut pages: Vec<AppearancePage> = Vec::with_capacity(sources.len());
        let mut texels = 0;
        let mut loses_colour = false;
        // Mean free paths in mm by texel, and their factors.
        let mut lengths: Vec<Vec<(f64, f32)>> = Vec::with_capacity(sources.len());
        for source in &sources {
            let (mut width, mut height) = (source.width, source.height);
            let elsewhere = source.baked_from.is_some() || source.projected.is_some();
            if let Some(factor) = factor.as_ref().filter(|_| !elsewhere) {
                (width, height) = (width.max(factor.width), height.max(factor.height));
            }
            let on_page = |triangle: usize| page_of.get(triangle).map_or(0, |page| usize::from(*page)) == pages.len();
            let reduction = match self.finest_texel_mm().filter(|_| !elsewhere) {
                Some(finest_mm) => Reduction::new(mesh, on_page, (width, height), finest_mm),
                None => Reduction::none((width, height)),
            };
            // Linear red, green, blue, and the factors of their mean free paths.
            let texel = |x: u32, y: u32| {
                let texel = x as usize + width as usize * y as usize;
                let (u, v) = ((x as f32 + 0.5) / width as f32, (y as f32 + 0.5) / height as f32);
                let projected = source.projected.map(|projected| &projected[texel]);
                let [r, g, b] = match (image, projected) {
                    (Some(image), Some(at)) => image.projected(at, |u, v| image.light(u, v)),
                    _ => (source.colour)(u, v),
                };
                let [u, v] = match source.baked_from.map(|from| from[texel]) {
                    Some(from) => from.to_array().map(|at| at.rem_euclid(1.0)),
                    None => [u, v],
                };
                let [fr, fg, fb] = match (&factor, projected) {
                    (None, _) => [1.0; 3],
                    (Some(factor), Some(at)) => factor.projected(at, |u, v| factor.nearest(u, v)),
                    (Some(factor), None) => factor.nearest(u, v),
                };
                [r, g, b, fr, fg, fb]
            };
            let (width, height) = reduction.size();
            texels += u64::from(width) * u64::from(height);
            if let Some(Shortage { needs, expected }) = machine::short_of(texels * TEXEL_BYTES) {
                return Err(self.refuse("target", format!("{texels} texels, {needs}"), &expected));
            }
            let mut page = AppearancePage { width, height, albedo: Vec::new(), mean_free_path: Vec::new() };
            let mut of_page = Vec::new();
            for y in 0..height {
                self.watch.go_on()?;
                for x in 0..width {
                    let [r, g, b, factors @ ..] = reduction.mean(x, y, texel);
                    let rgb = [r, g, b];
                    loses_colour |= channels == 1 && r.max(g).max(b) - r.min(g).min(b) > GREY;
                    to_channels(rgb, channels, &mut page.albedo);
                    if paths == 3 {
                        of_page.extend(source.path_mm.into_iter().zip(factors));
                    } else if factors == [factors[0]; 3] {
                        of_page.push((joined(rgb, source.path_mm), factors[0]));
                    } else {
                        let whole: [f64; 3] = std::array::from_fn(|c| source.path_mm[c] * f64::from(factors[c]));
                        let unit = joined(rgb, source.path_mm);
                        of_page.push((unit, (joined(rgb, whole) / unit) as f32));
                    }
                }
            }
            for (index, (mm, _)) in of_page.iter().enumerate() {
                unit_mm[index % paths] = unit_mm[index % paths].max(*mm);
            }
            lengths.push(of_page);
            pages.push(page);
        }
        for (page, lengths) in pages.iter_mut().zip(lengths) {
            let share = |(index, (mm, factor)): (usize, (f64, f32))| (mm / unit_mm[index % paths]) as f32 * factor;
            page.mean_free_path = lengths.into_iter().enumerate().map(share).collect();
        }
        Ok(Appearance { pages, page_of, unit_mm, loses_colour })
    }
}
