//! Laws of layers that are mixtures.

use super::*;

/// White with a tenth of black, and support, of the set `synthetic`.
pub(super) fn mixed_layers(index: f64) -> [VolumeCoefficients; 4] {
    let of = |sigma_s, sigma_a, g| VolumeCoefficients { sigma_s, sigma_a, g, refractive_index: index };
    let (white, black, support) = (of(8.0, 0.17, 0.5), of(2.5, 4.0, 0.5), of(1.6, 0.025, 0.75));
    [VolumeCoefficients::mixed([(white, 0.9), (black, 0.1)]), support, white, black]
}

#[test]
fn slopes_of_mixtures_are_differences() {
    for (index, base) in [(1.0, false), (1.0, true), (1.5, false)] {
        let [grey, support, white, black] = mixed_layers(index);
        let k = [0.0, 0.3, 2.0, 15.0];
        let options = TransportOptions { polar: 4, orders: 4 };
        let base = if base { Base::Mirror } else { Base::HalfSpace(black) };
        let model = LayeredReflection::new(&[None, Some(support), None, Some(white)], &[index], base, &k, options);
        // Thick enough for nothing to come through at some frequencies.
        let mm = if index == 1.0 { [0.4, 0.7, 0.2, 0.5] } else { [0.4, 0.7, 4.0, 0.5] };
        let tangents = vec![[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [-5.5, 3.8, 0.1]];
        let mixtures = [grey, VolumeCoefficients { sigma_a: 1.0, g: 0.8, ..grey }];
        let mixed = mixtures.map(|volume| Mixed { volume, tangents: tangents.clone() });
        let slope = model.slope(&mm, &mixed);
        let same = |a: &[f64], b: &[f64], what: &str| {
            for (a, b) in a.iter().zip(b) {
                assert!((a - b).abs() < 2e-7 * (1.0 + 10.0 * b.abs()), "{what}, n {index}: {a} against {b}");
            }
        };
        same(&slope.reflection, &model.reflection(&mm, &mixtures), "R̂");
        const STEP: f64 = 1e-4;
        let difference = |more: Vec<f64>, less: Vec<f64>| -> Vec<f64> {
            more.iter().zip(&less).map(|(more, less)| (more - less) / (2.0 * STEP)).collect()
        };
        for layer in 0..mm.len() {
            let [more, less] = [STEP, -STEP].map(|by| {
                let mut moved = mm;
                moved[layer] += by;
                model.reflection(&moved, &mixtures)
            });
            same(&slope.per_mm[layer], &difference(more, less), "per mm");
        }
        for mixture in 0..2 {
            for (tangent, [s, a, g]) in tangents.iter().enumerate() {
                let [more, less] = [STEP, -STEP].map(|by| {
                    let mut moved = mixtures;
                    moved[mixture].sigma_s += by * s;
                    moved[mixture].sigma_a += by * a;
                    moved[mixture].g += by * g;
                    model.reflection(&mm, &moved)
                });
                same(&slope.along[mixture][tangent], &difference(more, less), &format!("mixture {mixture} {tangent}"));
            }
        }
    }
}

/// Layers of one order are what they are to every model, and over a mirror what their symmetric slab reflects and lets
/// through.
#[test]
fn layers_in_order_are_a_stack() {
    let [grey, support, white, black] = mixed_layers(1.0);
    let grid = FrequencyGrid::linear(8, 6.0);
    let options = TransportOptions { polar: 4, orders: 4 };
    let layers = [(grey, 0.4), (support, 0.7), (white, 0.5)];
    let places = [None, Some(support), Some(white)];
    let mm = layers.map(|layer| layer.1);
    let close = |found: &[f64], expected: &[f64]| {
        for (a, b) in found.iter().zip(expected) {
            assert!((a - b).abs() < 1e-7, "{a} against {b}");
        }
    };
    let over = |base| LayeredReflection::new(&places, &[1.0], base, grid.as_slice(), options).reflection(&mm, &[grey]);
    let spectra =
        |stack: &Stack<VolumeCoefficients>| Transport { stack, light: Light::Diffuse, options }.spectra(&grid);
    close(&over(Base::HalfSpace(black)), &spectra(&Stack::new(layers).over(black)).reflection);
    close(&over(Base::Nothing), &spectra(&Stack::new(layers)).reflection);
    let symmetric = layers.into_iter().chain(layers.into_iter().rev());
    let indices: Vec<_> = symmetric.clone().map(|layer| layer.0).collect();
    let modal = ModalReflection::new(&indices, None, grid.as_slice(), options);
    let slab: Vec<_> = symmetric.enumerate().map(|(place, layer)| (place, layer.1)).collect();
    let through = modal.discrete(&slab);
    let both: Vec<_> = through.reflection.iter().zip(&through.transmission).map(|(r, t)| r + t).collect();
    close(&over(Base::Mirror), &both);
}
