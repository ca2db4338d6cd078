//! What glTF's materials say of light below the surface: KHR_materials_transmission, _volume and _diffuse_transmission;
//! and two drafts that are not ratified, KHR_materials_volume_scatter (glTF pull request 2453, as of 2026-06) and
//! KHR_materials_scatter (pull request 2579, commit 0addbb0a, 2026-07).
//!
//! They become what a target is made of, an albedo and a mean free path. Per channel, with b the base colour, s the
//! transmission, d the diffuse transmission and D its colour, light that meets the surface
//!
//! ```text
//!   turns round there          R = (1 − s)(1 − d) b
//!   goes through               W = s b + (1 − s) d D
//! ```
//!
//! | the material | albedo | mean free path |
//! | --- | --- | --- |
//! | thin-walled: no volume, or a thickness of 0 | R + W, what a sheet sends to both sides | not said |
//! | a volume that scatters, of multiple-scattering albedo ρ | R + W² ρ / (1 − R ρ) | 1/σt, σt = −ln c / a |
//! | a volume that does not | R + W c | a |
//!
//! where c is the attenuation colour and a the attenuation distance. The last is no physics: what a medium that only
//! absorbs sends back is what lies behind it; the colour that its maker saw is c at the distance a. Particles that
//! scatter with a mean cosine g make the path of the isotropic medium that looks alike longer, by 1/(1 − g ρ₁), with ρ₁
//! the albedo of a single scattering as either draft derives it from ρ. KHR_materials_scatter's strength multiplies ρ
//! of a volume, and of a thin wall it mixes the transmitted b with its colour.
//!
//! Base colours are dielectrics' here: metalness is not looked at.

use gltf::Document;
use gltf::Material;
use serde_json::Value;

use crate::numeric::similarity::similarity;

/// A texture that an extension names, and where on the surface it lies.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct TextureUse {
    /// Index of the texture.
    pub(super) index: usize,
    /// Set of texture coordinates.
    pub(super) set: u32,
    /// Offset, rotation in radians, scale.
    pub(super) transform: ([f32; 2], f32, [f32; 2]),
}

impl TextureUse {
    /// As JSON has it.
    fn new(value: &Value) -> Option<Self> {
        let index = value.get("index")?.as_u64()? as usize;
        let transform = value.get("extensions").and_then(|all| all.get("KHR_texture_transform"));
        let number = |value: Option<&Value>, default: f32| value.and_then(Value::as_f64).map_or(default, |v| v as f32);
        let pair = |key: &str, default: f32| {
            let list = transform.and_then(|transform| transform.get(key));
            [0, 1].map(|axis| number(list.and_then(|list| list.get(axis)), default))
        };
        let set = transform.and_then(|transform| transform.get("texCoord")).or(value.get("texCoord"));
        let rotation = number(transform.and_then(|transform| transform.get("rotation")), 0.0);
        let set = set.and_then(Value::as_u64).unwrap_or(0) as u32;
        Some(Self { index, set, transform: (pair("offset", 0.0), rotation, pair("scale", 1.0)) })
    }

    /// That of a base colour.
    pub(super) fn of_base(info: &gltf::texture::Info) -> Self {
        let transform = info.texture_transform();
        let set = transform.as_ref().and_then(|transform| transform.tex_coord()).unwrap_or(info.tex_coord());
        let transform = transform.map_or(([0.0; 2], 0.0, [1.0; 2]), |t| (t.offset(), t.rotation(), t.scale()));
        Self { index: info.texture().index(), set, transform }
    }

    /// Whether both lie on the surface alike.
    pub(super) fn lies_like(&self, other: &Self) -> bool {
        (self.set, self.transform) == (other.set, other.transform)
    }
}

/// Which channel of a texture is which factor of the material.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Slot {
    /// R.
    Transmission,
    /// A.
    DiffuseTransmission,
    /// RGB, sRGB.
    DiffuseColour,
    /// RGB, sRGB.
    ScatterColour,
    /// A.
    ScatterStrength,
}

/// The volume behind a surface.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Volume {
    /// Attenuation colour.
    colour: [f64; 3],
    /// Attenuation distance, file units; infinite where it is not given.
    distance: f64,
}

/// How particles scatter.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Scattering {
    anisotropy: f64,
    /// Whether the albedo of a single scattering is derived with the anisotropy, as the newer draft has it.
    by_anisotropy: bool,
}

/// What a material says of light below its surface; factors as they are where no texture multiplies them.
#[derive(Debug, Clone)]
pub(super) struct Interior {
    transmission: f32,
    diffuse_transmission: f32,
    diffuse_colour: [f32; 3],
    scatter_colour: [f32; 3],
    scatter_strength: f32,
    volume: Option<Volume>,
    scattering: Option<Scattering>,
    /// Textures of factors.
    pub(super) textures: Vec<(Slot, TextureUse)>,
}

/// A mean free path longer than this, in the file's unit, is none that a colour of attenuation tells: 1 km.
const LONGEST: f64 = 1000.0;

impl Interior {
    /// `None` for a material without any of the extensions, and for one that light cannot enter.
    pub(super) fn of(material: &Material) -> Option<Self> {
        let extension = |name: &str| material.extension_value(name);
        let [transmission, diffuse, volume, scatter, older] = [
            "KHR_materials_transmission",
            "KHR_materials_diffuse_transmission",
            "KHR_materials_volume",
            "KHR_materials_scatter",
            "KHR_materials_volume_scatter",
        ]
        .map(extension);
        let number = |of: Option<&Value>, key: &str, default: f64| {
            let value = of.and_then(|of| of.get(key)).and_then(Value::as_f64);
            value.filter(|value| value.is_finite() && *value >= -1.0).unwrap_or(default)
        };
        let colour = |of: Option<&Value>, keys: [&str; 2], default: f64| {
            let list = of.and_then(|of| keys.iter().find_map(|key| of.get(key)));
            let at = |c: usize| list.and_then(|list| list.get(c)).and_then(Value::as_f64).unwrap_or(default);
            [0, 1, 2].map(|c| at(c).clamp(0.0, 1.0))
        };
        let share = |of, key, default| number(of, key, default).clamp(0.0, 1.0) as f32;
        let single = |rgb: [f64; 3]| rgb.map(|value| value as f32);
        let both = scatter.or(older);
        let mut textures = Vec::new();
        for (of, key, slot) in [
            (transmission, "transmissionTexture", Slot::Transmission),
            (diffuse, "diffuseTransmissionTexture", Slot::DiffuseTransmission),
            (diffuse, "diffuseTransmissionColorTexture", Slot::DiffuseColour),
            (both, "multiscatterColorTexture", Slot::ScatterColour),
            (scatter, "scatterStrengthTexture", Slot::ScatterStrength),
        ] {
            textures.extend(of.and_then(|of| of.get(key)).and_then(TextureUse::new).map(|used| (slot, used)));
        }
        let is_volume = |volume: &&Value| {
            // The older draft's examples leave the thickness out.
            let default = if older.is_some() { 1.0 } else { 0.0 };
            number(Some(volume), "thicknessFactor", default) > 0.0
        };
        let found = Self {
            transmission: share(transmission, "transmissionFactor", 0.0),
            diffuse_transmission: share(diffuse, "diffuseTransmissionFactor", 0.0),
            diffuse_colour: single(colour(diffuse, ["diffuseTransmissionColorFactor"; 2], 1.0)),
            scatter_colour: single(colour(
                both,
                ["multiscatterColorFactor", "multiscatterColor"],
                if scatter.is_some() { 1.0 } else { 0.0 },
            )),
            scatter_strength: scatter.map_or(1.0, |of| share(Some(of), "scatterStrengthFactor", 0.0)),
            volume: volume.filter(is_volume).map(|volume| Volume {
                colour: colour(Some(volume), ["attenuationColor"; 2], 1.0),
                distance: number(Some(volume), "attenuationDistance", f64::INFINITY),
            }),
            scattering: both.map(|of| Scattering {
                anisotropy: number(Some(of), "scatterAnisotropy", 0.0).clamp(-0.99, 0.99),
                by_anisotropy: scatter.is_some(),
            }),
            textures,
        };
        (found.transmission > 0.0 || found.diffuse_transmission > 0.0).then_some(found)
    }

    /// Whether the albedo is the base colour, whatever that is.
    pub(super) fn keeps_base_colour(&self) -> bool {
        let tints = self.diffuse_transmission > 0.0 || (self.scattering.is_some() && self.scatter_strength > 0.0);
        self.volume.is_none() && !tints
    }

    /// Whether light goes through a volume that nothing scatters it in.
    pub(super) fn is_clear(&self) -> bool {
        self.volume.is_some() && (self.scattering.is_none() || self.scatter_strength == 0.0)
    }

    /// The factors where textures multiply them; a texture's texel has R, G, B in linear light and A.
    pub(super) fn at(&self, texels: impl IntoIterator<Item = (Slot, [f32; 4])>) -> Self {
        let mut here = self.clone();
        for (slot, [r, g, b, a]) in texels {
            let tint = |colour: &mut [f32; 3]| colour.iter_mut().zip([r, g, b]).for_each(|(c, by)| *c *= by);
            match slot {
                Slot::Transmission => here.transmission *= r,
                Slot::DiffuseTransmission => here.diffuse_transmission *= a,
                Slot::DiffuseColour => tint(&mut here.diffuse_colour),
                Slot::ScatterColour => tint(&mut here.scatter_colour),
                Slot::ScatterStrength => here.scatter_strength *= a,
            }
        }
        here
    }

    /// The albedo over a base colour, linear.
    pub(super) fn albedo(&self, base: [f32; 3]) -> [f32; 3] {
        let (s, d, strength) = (self.transmission, self.diffuse_transmission, self.scatter_strength);
        std::array::from_fn(|c| {
            let turned = (1.0 - s) * (1.0 - d) * base[c];
            let through = s * base[c] + (1.0 - s) * d * self.diffuse_colour[c];
            match (&self.volume, &self.scattering) {
                (None, Some(_)) => {
                    let scattered = strength * self.scatter_colour[c] + (1.0 - strength) * base[c];
                    turned + s * scattered + (1.0 - s) * d * self.diffuse_colour[c]
                }
                (None, None) => turned + through,
                (Some(volume), _) if self.is_clear() => turned + through * volume.colour[c] as f32,
                (Some(_), _) => {
                    let within = strength * self.scatter_colour[c];
                    // 0/0 is where no light leaves that has entered, and all that has not comes back.
                    turned + through * through * within / (1.0 - turned * within).max(f32::MIN_POSITIVE)
                }
            }
            .clamp(0.0, 1.0)
        })
    }

    /// 1/σt of the isotropic medium that looks alike, per channel, in the file's unit; `None` where the material does
    /// not say.
    pub(super) fn mean_free_path(&self) -> Option<[f64; 3]> {
        let volume = self.volume?;
        if self.is_clear() {
            return volume.distance.is_finite().then_some([volume.distance.clamp(0.0, LONGEST); 3]);
        }
        if !volume.distance.is_finite() {
            return None;
        }
        let scattering = self.scattering?;
        Some(std::array::from_fn(|c| {
            let attenuation = -libm::log(volume.colour[c].max(f64::MIN_POSITIVE)) / volume.distance;
            let s = similarity(f64::from(self.scatter_strength * self.scatter_colour[c])).max(0.0);
            let g = scattering.anisotropy;
            let single = if scattering.by_anisotropy { (1.0 - s * s) / (1.0 - g * s * s) } else { 1.0 - s * s };
            (1.0 / (attenuation * (1.0 - g * single))).clamp(0.0, LONGEST)
        }))
    }
}

/// The texture by which a material lies on its surface: the base colour's, or else the first that goes into its albedo.
pub(super) fn leading(material: &Material, base: Option<&gltf::texture::Info>) -> Option<TextureUse> {
    base.map(TextureUse::of_base).or_else(|| Some(Interior::of(material)?.textures.first()?.1.clone()))
}

/// The image of a texture that is there.
pub(super) fn image_of(document: &Document, used: &TextureUse) -> Option<usize> {
    Some(document.textures().nth(used.index)?.source()?.index())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One with all extensions at their defaults.
    fn interior(extensions: Value) -> Option<Interior> {
        let root = serde_json::json!({ "asset": { "version": "2.0" }, "materials": [{ "extensions": extensions }] });
        let document = gltf::Gltf::from_slice(root.to_string().as_bytes()).unwrap().document;
        let material = document.materials().next().unwrap();
        Interior::of(&material)
    }

    fn near(found: [f32; 3], expected: [f64; 3]) {
        for (found, expected) in found.into_iter().zip(expected) {
            assert!((f64::from(found) - expected).abs() < 1e-5, "{found} in place of {expected}");
        }
    }

    /// The material of the sample asset ScatteringSkull, by hand: σt = −ln c / a = 59.20, 42.75, 54.78 per metre.
    #[test]
    fn a_skull_that_scatters() {
        let skull = interior(serde_json::json!({
            "KHR_materials_transmission": { "transmissionFactor": 1 },
            "KHR_materials_volume": {
                "attenuationColor": [0.3678794503211975, 0.4857314527034759, 0.3964099884033203],
                "attenuationDistance": 0.016891848295927049,
                "thicknessFactor": 1
            },
            "KHR_materials_volume_scatter": {
                "multiscatterColor": [0.16827136278152467, 0.5271198749542236, 0.5906253457069397]
            },
        }))
        .unwrap();
        near(skull.albedo([1.0; 3]), [0.168_271, 0.527_120, 0.590_625]);
        let path = skull.mean_free_path().unwrap();
        for (found, expected) in path.into_iter().zip([0.016_891_848, 0.023_391_98, 0.018_255_01]) {
            assert!((found - expected).abs() < 2e-6, "{found} in place of {expected}");
        }
    }

    /// DragonAttenuation absorbs and does not scatter: its colour at its distance.
    #[test]
    fn a_dragon_of_glass() {
        let dragon = interior(serde_json::json!({
            "KHR_materials_transmission": { "transmissionFactor": 1 },
            "KHR_materials_volume": {
                "attenuationColor": [0.921, 0.640, 0.064], "attenuationDistance": 0.155, "thicknessFactor": 2.27
            },
        }))
        .unwrap();
        assert!(dragon.is_clear());
        near(dragon.albedo([1.0; 3]), [0.921, 0.640, 0.064]);
        assert_eq!(dragon.mean_free_path(), Some([0.155; 3]));
    }

    /// Leaves of DiffuseTransmissionPlant: four tenths go through in red. Its base colour here is 0.2, 0.5, 0.1.
    #[test]
    fn leaves_are_thin() {
        let leaf = interior(serde_json::json!({
            "KHR_materials_diffuse_transmission": {
                "diffuseTransmissionFactor": 0.4, "diffuseTransmissionColorFactor": [1, 0, 0]
            },
        }))
        .unwrap();
        near(leaf.albedo([0.2, 0.5, 0.1]), [0.6 * 0.2 + 0.4, 0.6 * 0.5, 0.6 * 0.1]);
        assert_eq!((leaf.mean_free_path(), leaf.is_clear()), (None, false));
        // Where the alpha of its texture halves the factor.
        let half = leaf.at([(Slot::DiffuseTransmission, [0.0, 0.0, 0.0, 0.5])]);
        near(half.albedo([0.2, 0.5, 0.1]), [0.8 * 0.2 + 0.2, 0.8 * 0.5, 0.8 * 0.1]);
    }

    /// The candle of KHR_materials_scatter's draft, at half its strength: ρ = 0.4, 0.3, 0.25 and g = 0.2.
    #[test]
    fn a_candle_by_the_newer_draft() {
        let candle = |strength: f64| {
            interior(serde_json::json!({
                "KHR_materials_scatter": {
                    "scatterStrengthFactor": strength,
                    "multiscatterColorFactor": [0.8, 0.6, 0.5],
                    "scatterAnisotropy": 0.2
                },
                "KHR_materials_transmission": { "transmissionFactor": 0.5 },
                "KHR_materials_volume": {
                    "thicknessFactor": 1.0, "attenuationDistance": 0.01, "attenuationColor": [0.95, 0.85, 0.75]
                },
            }))
            .unwrap()
        };
        // Half turns round at once; of the half that enters, ρ · ½/(1 − ½ρ) comes out.
        let within = |rho: f64| 0.5 + 0.25 * rho / (1.0 - 0.5 * rho);
        near(candle(0.5).albedo([1.0; 3]), [within(0.4), within(0.3), within(0.25)]);
        // ρ = 0.4: s = 0.387817, ρ₁ = (1 − s²)/(1 − 0.2 s²) = 0.875945; σt = 5.129329 per metre.
        let [red, ..] = candle(0.5).mean_free_path().unwrap();
        assert!((red - 1.0 / (5.129_329 * (1.0 - 0.2 * 0.875_945))).abs() < 1e-4, "{red}");
        assert!(candle(0.0).is_clear());
    }

    #[test]
    fn what_light_cannot_enter_says_nothing() {
        let closed = serde_json::json!({ "KHR_materials_volume": { "thicknessFactor": 1.0 } });
        assert!(interior(closed).is_none());
        let glass = interior(serde_json::json!({ "KHR_materials_transmission": { "transmissionFactor": 0.7 } }));
        assert!(glass.is_some_and(|glass| glass.keeps_base_colour()));
        // Nothing is lost where nothing absorbs.
        let white = interior(serde_json::json!({
            "KHR_materials_diffuse_transmission": { "diffuseTransmissionFactor": 0.3 },
            "KHR_materials_volume": { "thicknessFactor": 1.0, "attenuationDistance": 1.0 },
            "KHR_materials_volume_scatter": { "multiscatterColor": [1, 1, 1] },
        }))
        .unwrap();
        near(white.albedo([1.0; 3]), [1.0; 3]);
    }
}
