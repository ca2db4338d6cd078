//! Values of the wrong type or out of range.

use super::check;

#[test]
fn wrong_types() {
    check(&[
        ("[[object]]", "[object]", "bad.toml:1:1: object: found a table, expected one or several [[object]] tables"),
        (
            "[[object]]\nmesh = \"rabbit.glb\"\nheight-mm = 30\n",
            "object = []",
            "bad.toml:1:10: object: found an empty array, expected one or several [[object]] tables",
        ),
        (
            "[[object]]\nmesh = \"rabbit.glb\"\nheight-mm = 30\n",
            "object = [3]",
            "bad.toml:1:11: object[0]: found 3, expected a table",
        ),
        (
            "[field]\ndistance = \"exact\"",
            "[[field]]",
            "bad.toml:21:1: field: found an array of 1 value, expected a table",
        ),
        ("\"rabbit.glb\"", "3", "bad.toml:2:8: object[0].mesh: found 3, expected the path of a mesh file"),
        ("\"rabbit.glb\"", "\"  \"", "bad.toml:2:8: object[0].mesh: found \"  \", expected the path of a mesh file"),
        (
            "= 30",
            "= \"30\"",
            "bad.toml:3:13: object[0].height-mm: found \"30\", expected a height in mm from 0.01 to 2000",
        ),
        (
            "= 30",
            "= 30\nunit = \"feet\"",
            "bad.toml:4:8: object[0].unit: found \"feet\", expected one of \"mm\", \"cm\", \"m\", \"inch\", \"um\"",
        ),
        (
            "= 30",
            "= 30\nunit = \"inches\"",
            "bad.toml:4:8: object[0].unit: found \"inches\", expected one of \"mm\", \"cm\", \"m\", \"inch\", \"um\"; \
                did you mean `inch`?",
        ),
        (
            "= 30",
            "= 30\nunit = \"MM\"",
            "bad.toml:4:8: object[0].unit: found \"MM\", expected one of \"mm\", \"cm\", \"m\", \"inch\", \"um\"; did \
                you mean `mm`?",
        ),
        (
            "= 30",
            "= 30\nrotate-deg = 90",
            "bad.toml:4:14: object[0].rotate-deg: found 90, expected three numbers [x, y, z], each an angle in \
                degrees from -360 to 360",
        ),
        (
            "= 30",
            "= 30\nrotate-deg = [0, 90]",
            "bad.toml:4:14: object[0].rotate-deg: found an array of 2 values, expected three numbers [x, y, z], each \
                an angle in degrees from -360 to 360",
        ),
        (
            "= 30",
            "= 30\nposition-mm = [0, \"left\", 0]",
            "bad.toml:4:19: object[0].position-mm[1]: found \"left\", expected a position in mm from -2000 to 2000",
        ),
        ("\"j750-27um\"", "27", "bad.toml:6:10: printer.preset: found 27, expected the name of a printer"),
        (
            "\"synthetic\"",
            "true",
            "bad.toml:9:7: materials.set: found true, expected the name of a built-in set of resins",
        ),
        (
            "set = \"synthetic\"",
            "file = 1979-05-27",
            "bad.toml:9:8: materials.file: found the date or time 1979-05-27, expected the path of a material file",
        ),
        (
            "\"texture\"",
            "[\"texture\"]",
            "bad.toml:12:8: target.kind: found an array of 1 value, expected one \
                of \"stacking\", \"profile\", \"texture\", \"clusters\", \"bssrdf\"",
        ),
        (
            "\"texture\"",
            "\"textures\"",
            "bad.toml:12:8: target.kind: found \"textures\", expected one \
                of \"stacking\", \"profile\", \"texture\", \"clusters\", \"bssrdf\"; did you mean `texture`?",
        ),
        (
            "k = 100",
            "k = 100.0",
            "bad.toml:16:5: clusters.k: found 100.0, expected a number of clusters from 1 to 65535",
        ),
        ("units = 64", "core = 3", "bad.toml:19:8: stacking.core: found 3, expected the name of a resin"),
        ("units = 64", "core = \" \"", "bad.toml:19:8: stacking.core: found \" \", expected the name of a resin"),
        (
            "units = 64",
            "limit = \"support:0.2\"",
            "bad.toml:19:9: stacking.limit: found \"support:0.2\", expected one or several [[stacking.limit]] tables",
        ),
        (
            "\"exact\"",
            "\"exakt\"",
            "bad.toml:22:12: field.distance: found \"exakt\", expected one of \"exact\", \"grid\", \"lp\"; did you \
                mean `exact`?",
        ),
        (
            "[\"png\"]",
            "\"png\"",
            "bad.toml:25:11: output.formats: found \"png\", expected an array of formats \
                from \"png\", \"masks\", \"stl\", \"3mf\", \"preview\", \"heights\", \"gcvf\", \
                \"bmp\", \"vti\", \"nrrd\", \"vdb\"",
        ),
        (
            "[\"png\"]",
            "[\"pgn\"]",
            "bad.toml:25:12: output.formats[0]: found \"pgn\", expected one \
                of \"png\", \"masks\", \"stl\", \"3mf\", \"preview\", \"heights\", \"gcvf\", \
                \"bmp\", \"vti\", \"nrrd\", \"vdb\"; did you mean `png`?",
        ),
        (
            "[\"png\"]",
            "[]",
            "bad.toml:25:11: output.formats: found an empty array, expected an array of formats \
                from \"png\", \"masks\", \"stl\", \"3mf\", \"preview\", \"heights\", \"gcvf\", \
                \"bmp\", \"vti\", \"nrrd\", \"vdb\"",
        ),
    ]);
}

#[test]
fn numbers_out_of_range() {
    check(&[
        ("= 30", "= 0", "bad.toml:3:13: object[0].height-mm: found 0, expected a height in mm from 0.01 to 2000"),
        ("= 30", "= -30", "bad.toml:3:13: object[0].height-mm: found -30, expected a height in mm from 0.01 to 2000"),
        ("= 30", "= nan", "bad.toml:3:13: object[0].height-mm: found nan, expected a height in mm from 0.01 to 2000"),
        ("= 30", "= inf", "bad.toml:3:13: object[0].height-mm: found inf, expected a height in mm from 0.01 to 2000"),
        ("= 30", "= 3e6", "bad.toml:3:13: object[0].height-mm: found 3e6, expected a height in mm from 0.01 to 2000"),
        (
            "= 30",
            "= 1e999",
            "bad.toml:3:13: object[0].height-mm: found 1e999, expected a height in mm from 0.01 to 2000",
        ),
        (
            "height-mm = 30",
            "scale = 0",
            "bad.toml:3:9: object[0].scale: found 0, expected a factor from 0.000001 to 1000000",
        ),
        (
            "= 30",
            "= 30\nrotate-deg = [0, 0, 1e4]",
            "bad.toml:4:21: object[0].rotate-deg[2]: found 1e4, expected an angle in degrees from -360 to 360",
        ),
        (
            "= 30",
            "= 30\nposition-mm = [-3000, 0, 0]",
            "bad.toml:4:16: object[0].position-mm[0]: found -3000, expected a position in mm from -2000 to 2000",
        ),
        (
            "preset = \"j750-27um\"",
            "pitch-mm = [5000, 0.1, 0.1]",
            "bad.toml:6:13: printer.pitch-mm[0]: found 5000, expected a voxel size in mm from 0.001 to 10",
        ),
        (
            "preset = \"j750-27um\"",
            "pitch-mm = [0.1, 0.1, 0]",
            "bad.toml:6:23: printer.pitch-mm[2]: found 0, expected a voxel size in mm from 0.001 to 10",
        ),
        (
            "\"j750-27um\"",
            "\"j750-27um\"\ntray-mm = [0, 390, 200]",
            "bad.toml:7:12: printer.tray-mm[0]: found 0, expected a tray size in mm from 1 to 2000",
        ),
        (
            "preset = \"j750-27um\"",
            "pitch-mm = [2, 2, 2]\ntray-mm = [1, 9, 9]",
            "bad.toml:7:11: printer.tray-mm: found a tray smaller than one voxel, expected a tray at least as large \
                as pitch-mm",
        ),
        (
            "\"j750-27um\"",
            "\"j750-27um\"\nmax-colors = 0",
            "bad.toml:7:14: printer.max-colors: found 0, expected a number of colours from 1 to 255",
        ),
        (
            "\"j750-27um\"",
            "\"j750-27um\"\nmin-slices = -1",
            "bad.toml:7:14: printer.min-slices: found -1, expected a number of slices from 1 to 100000",
        ),
        (
            "albedo = \"albedo.png\"",
            "albedo-value = 1.2",
            "bad.toml:13:16: target.albedo-value: found 1.2, expected an albedo from 0 to 1",
        ),
        (
            "albedo = \"albedo.png\"",
            "max-albedo = 0",
            "bad.toml:13:14: target.max-albedo: found 0, expected an albedo from 0.001 to 1",
        ),
        (
            "albedo = \"albedo.png\"",
            "mean-free-path-mm = 0.0",
            "bad.toml:13:21: target.mean-free-path-mm: found 0.0, expected a mean free path in mm from 0.0001 to 1000",
        ),
        ("k = 100", "k = 0", "bad.toml:16:5: clusters.k: found 0, expected a number of clusters from 1 to 65535"),
        (
            "k = 100",
            "seed = -1",
            "bad.toml:16:8: clusters.seed: found -1, expected a whole number from 0 to 9223372036854775807",
        ),
        (
            "k = 100",
            "seed = 99999999999999999999999999999999999999999999",
            "bad.toml:16:8: clusters.seed: found 99999999999999999999999999999999999999999999, expected a whole \
                number from 0 to 9223372036854775807",
        ),
        (
            "units = 64",
            "max-thickness-mm = 5000",
            "bad.toml:19:20: stacking.max-thickness-mm: found 5000, expected a thickness in mm from 0.01 to 100",
        ),
        (
            "units = 64",
            "units = 48",
            "bad.toml:19:9: stacking.units: found 48, expected a power of two from 2 to 4096: 32 or 64 is next to it",
        ),
        (
            "units = 64",
            "units = 8192",
            "bad.toml:19:9: stacking.units: found 8192, expected a power of two from 2 to 4096",
        ),
        (
            "units = 64",
            "depth = 13",
            "bad.toml:19:9: stacking.depth: found 13, expected a number of blocks from 1 to 12",
        ),
        (
            "units = 64",
            "dc-weight = -1",
            "bad.toml:19:13: stacking.dc-weight: found -1, expected a weight from 0 to 1000000",
        ),
        (
            "units = 64",
            "[[stacking.limit]]\nresin = \"a\"\nmin-depth-mm = -0.2",
            "bad.toml:21:16: stacking.limit[0].min-depth-mm: found -0.2, expected a depth in mm from 0 to 100",
        ),
        (
            "units = 64",
            "[[stacking.limit]]\nresin = \"a\"\nmax-mm = 0",
            "bad.toml:21:10: stacking.limit[0].max-mm: found 0, expected a thickness in mm from 0.0001 to 100",
        ),
        (
            "units = 64",
            "[[stacking.limit]]\nresin = \"a\"\nmin-mm = 2\nmax-mm = 1",
            "bad.toml:22:10: stacking.limit[0].max-mm: found 1, expected at least min-mm, which is 2",
        ),
        (
            "\"exact\"",
            "\"lp\"\nlp-exponent = 2",
            "bad.toml:23:15: field.lp-exponent: found 2, expected an exponent from 2.1 to 64",
        ),
        (
            "[\"png\"]",
            "[\"png\"]\nmesh-pitch-mm = 100",
            "bad.toml:26:17: output.mesh-pitch-mm: found 100, expected a voxel size in mm from 0.001 to 10",
        ),
    ]);
}
