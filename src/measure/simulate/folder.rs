//! A folder of photographs with its capture file.

use std::fmt::Write as _;
use std::io;
use std::path::{Path, PathBuf};

use rand_xoshiro::Xoshiro256PlusPlus;
use rand_xoshiro::rand_core::{Rng, SeedableRng};

use super::{Defects, Scene, SimulatedCamera, Truth};
use crate::measure::{Aperture, ResinFacts};
use crate::picture::{Pixels, fast_png};

/// A place where a resin is photographed.
#[derive(Debug, Clone, PartialEq)]
pub struct Laboratory {
    /// The camera.
    pub camera: SimulatedCamera,
    /// Exposure times of the brackets, s, rising.
    pub exposures_s: Vec<f64>,
    /// The spot is this full of electrons in the shortest exposure, as a share of the full well.
    pub filled: f64,
    /// Light of the projector's black pixels in every pixel, electrons/s; in the dark series too.
    pub leak_e_per_s: f64,
    /// Albedo of the grey card.
    pub card_albedo: f64,
    /// Whether the capture file says what black level, saturation level, gain and read noise are.
    pub camera_known: bool,
    /// Whether both series have a flat field: an even surface under even light, by the same lens.
    pub flat_field: bool,
    /// What is wrong, in both brackets.
    pub defects: Defects,
    /// Seed of all noise.
    pub seed: u64,
}

impl Default for Laboratory {
    /// The paper's: 12 exposures of 1/15 to 30 s.
    fn default() -> Self {
        Self {
            camera: SimulatedCamera::default(),
            exposures_s: (0..12).map(|i| libm::pow(450_f64, f64::from(i) / 11.0) / 15.0).collect(),
            filled: 0.6,
            leak_e_per_s: 1.5,
            card_albedo: 0.18,
            camera_known: true,
            flat_field: false,
            defects: Defects::default(),
            seed: 1,
        }
    }
}

/// Photographs a resin and writes pictures and `capture.toml` into a folder; returns the path of the latter. Scene and
/// truth are given for reflection and transmission.
///
/// # Errors
/// What the disk says.
pub fn write_capture(
    laboratory: &Laboratory,
    resin: &ResinFacts,
    reflection: (&Scene, &Truth),
    transmission: (&Scene, &Truth),
    folder: &Path,
) -> io::Result<PathBuf> {
    std::fs::create_dir_all(folder)?;
    let mut seeds = laboratory.seed.wrapping_mul(1000);
    let camera = &laboratory.camera;
    let [r, g, b, _] = resin.rgba;
    let mut toml = format!(
        "# Simulated photographs, not a measurement.\n[resin]\nname = \"{}\"\nrgba = [{r}, {g}, {b}]\n\
         density-g-per-cm3 = {}\nthickness-mm = {}\n{}date = \"2010-05-01\"\nnotes = \"simulated photographs\"\n\n\
         [camera]\nmodel = \"a simulated camera\"\ndistance-mm = {}\n",
        resin.name,
        resin.density_g_per_cm3,
        resin.thickness_mm,
        if resin.print_as_background { "print-as = \"background\"\n" } else { "" },
        reflection.0.distance_mm,
    );
    if laboratory.camera_known {
        let _ = write!(
            toml,
            "black-level = {}\nsaturation-level = {}\ngain-e-per-dn = {}\nread-noise-e = {}\n",
            camera.black_level,
            (camera.full_well_e / camera.gain_e_per_dn + camera.black_level).min(camera.largest_dn).floor(),
            camera.gain_e_per_dn,
            camera.read_noise_e,
        );
    }
    toml.push('\n');
    let card = laboratory.grey_card(reflection.1.integral(), &mut seeds, folder)?;
    let series = [("reflection", reflection, card)];
    let screen = laboratory.screen(transmission.1.integral(), &mut seeds, folder)?;
    for (name, (scene, truth), albedo) in series.into_iter().chain([("transmission", transmission, screen)]) {
        laboratory.bracket(scene, truth, name, &mut seeds, folder)?;
        let mut times: Vec<String> = laboratory.exposures_s.iter().map(|time| format!("{time:.6}")).collect();
        if laboratory.defects.labels_reversed {
            times.reverse();
        }
        let times = times.join(", ");
        let (shape, size) = match scene.spot {
            Aperture::Square { side_mm } => ("square", side_mm),
            Aperture::Disc { diameter_mm } => ("disc", diameter_mm),
        };
        let flat = if laboratory.flat_field {
            laboratory.flat(scene, &mut seeds, &folder.join(format!("{name}_flat.png")))?;
            format!("flat = \"{name}_flat.png\"\n")
        } else {
            String::new()
        };
        let _ = write!(
            toml,
            "[{name}]\nframes = [\"{name}-*.png\"]\nexposures-s = [{times}]\ndark = [\"{name}_dark-*.png\"]\n\
             dark-exposures-s = [{times}]\nmm-per-pixel = {}\naperture = \"{shape}\"\naperture-mm = {size}\n\
             {flat}[{name}.albedo]\n{albedo}\n",
            scene.mm_per_pixel,
        );
    }
    let path = folder.join("capture.toml");
    std::fs::write(&path, toml)?;
    Ok(path)
}

impl Laboratory {
    /// The lit and the dark bracket.
    fn bracket(&self, scene: &Scene, truth: &Truth, name: &str, seeds: &mut u64, folder: &Path) -> io::Result<()> {
        let width = scene.size[0];
        let hot = self.hot_pixels(scene, seeds);
        let mut dark = vec![self.leak_e_per_s as f32; width * scene.size[1]];
        hot.iter().for_each(|(place, electrons)| dark[*place] += electrons);
        let still = scene.picture(truth, &self.defects, [0.0; 2]);
        let brightest = still.iter().copied().fold(0.0, f32::max);
        let shortest = self.exposures_s.iter().copied().fold(f64::INFINITY, f64::min);
        let electrons = (self.filled * self.camera.full_well_e / shortest) as f32 / brightest;
        let lit = |light: &[f32]| -> Vec<f32> { light.iter().zip(&dark).map(|(l, d)| l * electrons + d).collect() };
        let still_lit = lit(&still);
        for (i, &label) in self.exposures_s.iter().enumerate() {
            let seconds = match self.defects.mislabelled {
                Some((odd, factor)) if odd == i => label * factor,
                _ => label,
            };
            let moved = match self.defects.shifted {
                Some((odd, shift)) if odd == i => Some(lit(&scene.picture(truth, &self.defects, shift))),
                _ => None,
            };
            let mut light = moved.unwrap_or_else(|| still_lit.clone());
            if let Some((odd, share)) = self.defects.lit_up
                && odd == i
            {
                let own = (share * self.camera.full_well_e / seconds) as f32;
                light.iter_mut().for_each(|light| *light += own);
            }
            let mut take = |light: &[f32], name: &str, seconds: f64| {
                *seeds += 1;
                let mut values = self.camera.expose(light, width, seconds, *seeds);
                if self.defects.encoded {
                    values.iter_mut().for_each(|value| *value = self.camera.encoded(*value));
                }
                write_png(&folder.join(format!("{name}-{i:02}.png")), &values, width)
            };
            take(&light, name, seconds)?;
            take(&dark, &format!("{name}_dark"), label)?;
        }
        Ok(())
    }

    /// An even surface through the same lens, two thirds full.
    fn flat(&self, scene: &Scene, seeds: &mut u64, path: &Path) -> io::Result<()> {
        let full = self.camera.full_well_e / 1.5;
        let at = |i: usize| [i % scene.size[0], i / scene.size[0]];
        let light = |i: usize| (full * self.defects.shading(at(i), scene.size)) as f32;
        let light: Vec<f32> = (0..scene.size[0] * scene.size[1]).map(light).collect();
        *seeds += 1;
        write_png(path, &self.camera.expose(&light, scene.size[0], 1.0, *seeds), scene.size[0])
    }

    /// Places and electrons/s.
    fn hot_pixels(&self, scene: &Scene, seeds: &mut u64) -> Vec<(usize, f32)> {
        *seeds += 1;
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(*seeds);
        let pixels = (scene.size[0] * scene.size[1]) as u64;
        let pixel = |_| ((rng.next_u64() % pixels) as usize, 500.0 + (rng.next_u64() % 7500) as f32);
        (0..self.defects.hot_pixels).map(pixel).collect()
    }

    /// A card on the left, the sample on the right, the brighter one two thirds full.
    fn grey_card(&self, albedo: f64, seeds: &mut u64, folder: &Path) -> io::Result<String> {
        const SIZE: [usize; 2] = [320, 200];
        let full = self.camera.full_well_e / 1.5 / albedo.max(self.card_albedo);
        let albedo_at = |x: usize| match x {
            20..140 => self.card_albedo,
            180..300 => albedo,
            _ => 0.04,
        };
        let lit = |x: usize| {
            let gradient = self.defects.card_gradient;
            (1.0 + gradient * x as f64 / SIZE[0] as f64) / (1.0 + gradient)
        };
        let light: Vec<f32> =
            (0..SIZE[0] * SIZE[1]).map(|i| (full * albedo_at(i % SIZE[0]) * lit(i % SIZE[0])) as f32).collect();
        *seeds += 1;
        let values = self.camera.expose(&light, SIZE[0], 1.0, *seeds);
        write_png(&folder.join("card.png"), &values, SIZE[0])?;
        let (card, sample) = if self.defects.card_swapped { ("sample", "card") } else { ("card", "sample") };
        Ok(format!(
            "picture = \"card.png\"\n{card} = [30, 30, 100, 140]\n{sample} = [190, 30, 100, 140]\n\
             card-albedo = {}\ncard-error = 0.0003\n",
            self.card_albedo
        ))
    }

    /// The screen alone, and through the sample, both two thirds full if 60 s suffice.
    fn screen(&self, transmittance: f64, seeds: &mut u64, folder: &Path) -> io::Result<String> {
        const SIZE: [usize; 2] = [200, 200];
        const BARE_S: f64 = 1.0 / 60.0;
        let rate = self.camera.full_well_e / 1.5 / BARE_S;
        let with_s = (BARE_S / transmittance).min(60.0);
        for (name, light, seconds) in [("screen-without", rate, BARE_S), ("screen-with", rate * transmittance, with_s)]
        {
            *seeds += 1;
            let values = self.camera.expose(&vec![light as f32; SIZE[0] * SIZE[1]], SIZE[0], seconds, *seeds);
            write_png(&folder.join(format!("{name}.png")), &values, SIZE[0])?;
        }
        let (with, without) = if self.defects.screen_swapped { ("without", "with") } else { ("with", "without") };
        Ok(format!(
            "{with} = \"screen-with.png\"\n{with}-exposure-s = {with_s:.6}\n{without} = \"screen-without.png\"\n\
             {without}-exposure-s = {BARE_S:.6}\nregion = [40, 40, 120, 120]\n"
        ))
    }
}

fn write_png(path: &Path, values: &[u16], width: usize) -> io::Result<()> {
    std::fs::write(path, fast_png(width, Pixels::Grey16(values)).map_err(io::Error::other)?)
}
