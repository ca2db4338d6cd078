//! A flat slab of the patch's size and the jobs that print it.

use crate::appearance::bssrdf::Dataset;

/// Name of the mesh.
pub(super) const MESH: &str = "slab.obj";
/// Name of the job with the paper's settings.
pub(super) const JOB: &str = "slab.toml";
/// Name of the job with ours.
pub(super) const REFINED: &str = "refined.toml";
/// Height, mm: the search's 5 mm of layers and a floor.
const HEIGHT_MM: f64 = 6.0;

/// A box whose texture coordinates lay the label map over its top as seen from above.
pub(super) fn mesh(dataset: &Dataset) -> String {
    let (x, y) = (dataset.width as f64 * dataset.pitch_mm, dataset.height as f64 * dataset.pitch_mm);
    let mut text = format!("# {x} x {y} x {HEIGHT_MM} mm\n");
    for z in [0.0, HEIGHT_MM] {
        for [u, v] in [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]] {
            text += &format!("v {} {} {z}\n", u * x, v * y);
        }
    }
    text += "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n";
    // Bottom, top, sides; a corner's texture coordinates are those of its place seen from above.
    for quad in [[4, 3, 2, 1], [5, 6, 7, 8], [1, 2, 6, 5], [2, 3, 7, 6], [3, 4, 8, 7], [4, 1, 5, 8]] {
        let corners = quad.map(|corner| format!("{corner}/{}", (corner - 1) % 4 + 1));
        text += &format!("f {}\n", corners.join(" "));
    }
    text
}

/// The job with the settings of the paper's section 8.3.
pub(super) fn paper(dc_weight: f64) -> String {
    job(
        JOB,
        "with the settings of Hašan et al. 2010, section 8.3",
        "",
        &format!(
            "max-thickness-mm = 5.0\nunits = 64\ndepth = 6\n\
             objective = \"l2\"\nmodel = \"km\"\ndc-weight = {dc_weight:?}\n"
        ),
        r#""png", "preview", "heights""#,
    )
}

/// The same with all that was found since: mixtures and layers of any thickness, fitted in the transport model to
/// targets that the resins can reach, and corrected by how the print looks.
pub(super) fn refined(dc_weight: f64) -> String {
    job(
        REFINED,
        "with mixtures, found in the transport model and corrected by how the print looks; `lumislice compare` holds \
         it against the other",
        "gamut-map = true\n",
        &format!("model = \"transport\"\ndc-weight = {dc_weight:?}\n"),
        r#""png", "preview""#,
    )
}

fn job(name: &str, how: &str, target: &str, stacking: &str, formats: &str) -> String {
    format!(
        r#"# Prints the factored patch as a slab, seen from above, {how}:
#     lumislice slice {name}

[[object]]
mesh = "{MESH}"
unit = "mm"
depth-from = "top"

[printer]
preset = "j750-27um"

[materials]
set = "synthetic"

[target]
kind = "bssrdf"
map = "."
max-albedo = 0.6
{target}
[stacking]
core = "black"
{stacking}
[output]
formats = [{formats}]
"#
    )
}
