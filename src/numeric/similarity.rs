//! What a medium shows in depth, and what its particles do: van de Hulst's albedo, turned round.

/// Single-scattering quantities of a medium from the colour that it shows in depth, for isotropic scattering: the
/// inverse of van de Hulst's albedo as Kulla and Conty give it (*Revisiting Physically Based Shading at Imageworks*,
/// SIGGRAPH 2017 course), which OpenPBR and glTF's scattering extensions use. s² is the absorbed share of what meets a
/// particle, 1 − albedo of a single scattering.
pub fn similarity(albedo: f64) -> f64 {
    4.09712 + 4.20863 * albedo - (9.59217 + 41.6808 * albedo + 17.7126 * albedo * albedo).sqrt()
}

/// By what a mean free path between particles that scatter forwards (mean cosine `anisotropy`, −1 to 1 exclusive) is to
/// be multiplied for the isotropic medium that looks alike: (1 − g s²)/(1 − g), with the [`similarity`] s of the albedo
/// that it shows.
pub fn isotropic_path_factor(albedo: f64, anisotropy: f64) -> f64 {
    let s = similarity(albedo);
    (1.0 - anisotropy * s * s) / (1.0 - anisotropy)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_inverse_of_van_de_hulst() {
        for albedo in [0.05, 0.2, 0.5, 0.8, 0.95] {
            let s = similarity(albedo);
            let shown = (1.0 - s) * (1.0 - 0.139 * s) / (1.0 + 1.17 * s);
            assert!((shown - albedo).abs() < 2e-3, "{albedo}: {shown}");
        }
        // Nothing is scattered from a black medium, everything from a white one.
        assert!((isotropic_path_factor(0.0, 0.5) - 1.0).abs() < 2e-3);
        assert!((isotropic_path_factor(1.0, 0.5) - 2.0).abs() < 2e-3);
        assert_eq!(isotropic_path_factor(0.3, 0.0), 1.0);
    }
}
