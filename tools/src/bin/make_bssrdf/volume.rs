//! Datasets by Monte Carlo through a volume that varies: light enters by one texel after the other and is counted where
//! it leaves. Nothing here knows of equation 7. Beyond the patch the volume goes on as its own mirror image, as
//! `lumislice compare` takes it to.
//!
//! - `chess`: squares of a dense white and of a dark, duller material, 1.6 mm wide and sharp-edged: high contrast.
//! - `marble`: a bright, fairly translucent ground with soft dark veins that run into the depth.
//! - `stone`: very translucent, clear ground with small white grains: beyond what the resins of a printer can do.

use lumislice::look::{Photons, Sides, TexelGrid, VoxelGrid, VoxelScene, Windows};
use lumislice::optics::{Light, VolumeCoefficients};

use super::{Request, files};

/// Scattering and absorption per mm, mean cosine.
type Medium = (f64, f64, f64);

/// The two media of a kind, and depth of the volume in mm.
fn media(kind: &str) -> (Medium, Medium, f64) {
    match kind {
        "chess" => ((8.0, 0.1, 0.5), (3.0, 1.0, 0.5), 6.0),
        "marble" => ((4.0, 0.02, 0.6), (4.0, 0.8, 0.6), 8.0),
        _ => ((0.7, 0.004, 0.6), (8.0, 0.05, 0.5), 12.0),
    }
}

/// Steps between the two media.
const STEPS: usize = 32;
/// Size of a voxel, mm.
const VOXEL_MM: f64 = 0.1;

/// Share of the second medium at a place of the patch, mm, that is `size` wide and high.
fn share(kind: &str, [x, y, z]: [f64; 3], size: [f64; 2], seed: u64) -> f64 {
    let wave = |i: u64, fx: f64, fy: f64, fz: f64| {
        // A phase from the seed: fractions of the golden ratio.
        let phase = ((seed * 31 + i) as f64 * 0.618_033_988_75).fract();
        let turns = fx * x / size[0] + fy * y / size[1] + fz * z / 8.0 + phase;
        (std::f64::consts::TAU * turns).cos()
    };
    match kind {
        "chess" => ((x / 1.6).floor() + (y / 1.6).floor()).rem_euclid(2.0),
        "marble" => {
            let bend = wave(1, 1.0, 2.0, 1.0) + 0.6 * wave(2, 3.0, -1.0, 2.0) + 0.3 * wave(3, 4.0, 5.0, 3.0);
            let turns = 2.0 * x / size[0] + y / size[1] + 0.35 * bend;
            (1.0 - (std::f64::consts::TAU * turns).sin().abs()).powi(3)
        }
        _ => {
            let grains =
                wave(1, 5.0, 3.0, 6.0) + wave(2, -3.0, 5.0, 5.0) + wave(3, 4.0, -4.0, -7.0) + wave(4, 2.0, 6.0, 4.0);
            (0.8 * (grains - 0.6)).clamp(0.0, 1.0)
        }
    }
}

pub fn make(request: &Request) -> Result<(), String> {
    let (first, second, depth) = media(&request.kind);
    let coefficients: Vec<VolumeCoefficients> = (0..=STEPS)
        .map(|step| {
            let t = step as f64 / STEPS as f64;
            let mix = |a: f64, b: f64| a + t * (b - a);
            let scattering = mix(first.0, second.0);
            let g = mix(first.0 * first.2, second.0 * second.2) / scattering;
            VolumeCoefficients::new(scattering, mix(first.1, second.1), g).map_err(|error| error.to_string())
        })
        .collect::<Result<_, _>>()?;
    let [columns, rows] = request.texels;
    let size = [columns, rows].map(|n| n as f64 * request.pitch_mm);
    // Whole voxels, as near to the wanted size as they can be.
    let counts = size.map(|mm| (mm / VOXEL_MM).round().max(1.0) as usize);
    let pitch = [size[0] / counts[0] as f64, size[1] / counts[1] as f64, VOXEL_MM];
    let layers = (depth / VOXEL_MM).round() as usize;
    let mut patch = Vec::with_capacity(counts[0] * counts[1] * layers);
    for k in 0..layers {
        for j in 0..counts[1] {
            for i in 0..counts[0] {
                let centre = [i, j, k].map(|n| n as f64 + 0.5);
                let at = [centre[0] * pitch[0], centre[1] * pitch[1], centre[2] * pitch[2]];
                patch.push((share(&request.kind, at, size, request.seed) * STEPS as f64).round() as u8);
            }
        }
    }
    // Patch and mirror image together repeat without a seam.
    let mut ids = Vec::with_capacity(4 * patch.len());
    for layer in patch.chunks(counts[0] * counts[1]) {
        let rows: Vec<&[u8]> = layer.chunks(counts[0]).collect();
        for row in rows.iter().chain(rows.iter().rev()) {
            ids.extend(row.iter().chain(row.iter().rev()));
        }
    }
    let dims = [2 * counts[0], 2 * counts[1], layers];
    let grid = VoxelGrid::new(dims, pitch, ids).map_err(|error| error.to_string())?;
    let scene = VoxelScene::new(&grid, &coefficients, Sides::Periodic, None).map_err(|error| error.to_string())?;
    let windows = Windows {
        texels: TexelGrid { origin_mm: [0.0; 2], pitch_mm: [request.pitch_mm; 2], dims: request.texels },
        reach: [request.window / 2; 2],
    };
    let photons = Photons { light: Light::Diffuse, count: request.photons, seed: request.seed };
    let area = (request.pitch_mm * request.pitch_mm) as f32;
    let mut out = files::Windows::create(request)?;
    let (mut albedo, mut noise, mut signal) = (Vec::new(), 0.0, 0.0);
    let mut total = 0.0;
    // The tracer's rows run upwards, a dataset's downwards; so do those of a window.
    for row in (0..rows).rev() {
        let responses = scene.responses(&windows, row, photons).map_err(|error| error.to_string())?;
        for response in responses {
            let lines = response.share.chunks(request.window).rev();
            let values: Vec<f32> = lines.flatten().map(|share| share / area).collect();
            out.write(&values)?;
            albedo.push(response.reflection.mean as f32);
            noise += response.standard_error.iter().map(|e| f64::from(*e).powi(2)).sum::<f64>();
            total += response.share.iter().map(|v| f64::from(*v)).sum::<f64>();
            signal += response.share.iter().map(|v| f64::from(*v).powi(2)).sum::<f64>();
        }
    }
    eprintln!("noise of the photons: {:.2}% of the data, root of the sums of squares", 100.0 * (noise / signal).sqrt());
    // A photon that leaves carries about this weight: variance per value, per mm².
    let gain = noise / (total * f64::from(area));
    files::finish(request, out, &albedo, &format!("noise-gain-per-mm2 = {gain:.3e}\n"))
}
