//! From textures to profiles: what albedo and mean free path every texel asks for.
//!
//! Both are kept as codes of a few bits, so that a texture of millions of texels is a few thousand distinct
//! appearances, each with the surface that has it, which is what clustering works on.

use std::collections::BTreeMap;

use super::charts::Atlas;

/// What one page asks for, texel by texel, row 0 on top.
#[derive(Debug, Clone, PartialEq)]
pub struct AppearancePage {
    /// Texels per row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Diffuse albedo per texel and channel, linear, 0 to 1: `channels` values per texel.
    pub albedo: Vec<f32>,
    /// Mean free path per texel in units of the target's, 0 to 1: one value for all channels, or one for each; as many
    /// in all pages.
    pub mean_free_path: Vec<f32>,
}

/// A distinct appearance.
#[derive(Debug, Clone, PartialEq)]
pub struct Appearance {
    /// Albedo per channel, 0 to 1.
    pub albedo: Vec<f64>,
    /// Mean free path in units of the target's, 0 to 1: one value for all channels, or one for each.
    pub mean_free_path: Vec<f64>,
    /// Surface that has it, mm².
    pub area_mm2: f64,
}

/// The distinct appearances of an atlas, and which one every covered texel has.
#[derive(Debug, Clone, PartialEq)]
pub struct Appearances {
    /// Sorted by code.
    pub distinct: Vec<Appearance>,
    /// Index into `distinct` per page and texel; 0 where no triangle covers the texel.
    pub index: Vec<Vec<u32>>,
    /// Bits per code that were enough.
    pub bits: u32,
}

/// Most distinct appearances; more are told apart with one bit less. Clustering 20,000 spectra of 128 coefficients
/// takes 2 s.
const MAX_DISTINCT: usize = 20_000;
/// Finest codes: on the square-root scale half a step is 0.0002 of the albedo.
const MAX_BITS: u32 = 12;
const MIN_BITS: u32 = 4;

/// Groups the covered texels of `pages` by appearance; `areas` are those of [`Atlas::areas`]. The albedo is multiplied
/// by `albedo_scale` first.
pub fn distinct_appearances(
    atlas: &Atlas,
    pages: &[AppearancePage],
    areas: &[Vec<f64>],
    channels: usize,
    albedo_scale: f64,
) -> Appearances {
    for bits in (MIN_BITS..=MAX_BITS).rev() {
        // Where even the fewest bits leave more (channels full of noise), the cap is given up.
        let cap = if bits == MIN_BITS { usize::MAX } else { MAX_DISTINCT };
        if let Some(found) = with_bits(atlas, pages, areas, channels, albedo_scale, bits, cap) {
            return found;
        }
    }
    unreachable!("the last round has no cap")
}

/// `None` when there are more than `cap`.
fn with_bits(
    atlas: &Atlas,
    pages: &[AppearancePage],
    areas: &[Vec<f64>],
    channels: usize,
    albedo_scale: f64,
    bits: u32,
    cap: usize,
) -> Option<Appearances> {
    let steps = f64::from((1_u32 << bits) - 1);
    // The square root spends codes where differences show: on dark and short-ranged texels.
    let encode = |value: f64| (value.clamp(0.0, 1.0).sqrt() * steps).round() as u16;
    let decode = |code: u16| (f64::from(code) / steps).powi(2);
    let mut codes: BTreeMap<Vec<u16>, (u32, f64)> = BTreeMap::new();
    let mut index = Vec::with_capacity(pages.len());
    let texels = |page: &AppearancePage| page.width as usize * page.height as usize;
    let paths = pages.iter().map(|page| page.mean_free_path.len() / texels(page).max(1)).max().unwrap_or(1);
    let mut code = vec![0_u16; channels + paths];
    for ((map, page), areas) in atlas.pages().iter().zip(pages).zip(areas) {
        let mut of_texel = vec![0_u32; texels(page)];
        for texel in map.covered() {
            let albedo = &page.albedo[texel * channels..(texel + 1) * channels];
            for (code, &albedo) in code.iter_mut().zip(albedo) {
                *code = encode(f64::from(albedo) * albedo_scale);
            }
            let path = &page.mean_free_path[texel * paths..(texel + 1) * paths];
            for (code, &path) in code[channels..].iter_mut().zip(path) {
                *code = encode(f64::from(path));
            }
            let next = codes.len() as u32;
            let entry = match codes.get_mut(&code) {
                Some(entry) => entry,
                None if next as usize == cap => return None,
                None => codes.entry(code.clone()).or_insert((next, 0.0)),
            };
            entry.1 += areas[texel];
            of_texel[texel] = entry.0;
        }
        index.push(of_texel);
    }
    // Numbers in order of code rather than of first texel, so that the result does not hang on the layout of the atlas.
    let mut rank = vec![0; codes.len()];
    let mut distinct = Vec::with_capacity(codes.len());
    for (number, (code, (first_seen, area_mm2))) in (0..).zip(codes) {
        rank[first_seen as usize] = number;
        let [albedo, mean_free_path] =
            [&code[..channels], &code[channels..]].map(|codes| codes.iter().map(|&code| decode(code)).collect());
        distinct.push(Appearance { albedo, mean_free_path, area_mm2 });
    }
    for (map, page) in atlas.pages().iter().zip(&mut index) {
        for texel in map.covered() {
            page[texel] = rank[page[texel] as usize];
        }
    }
    Some(Appearances { distinct, index, bits })
}
