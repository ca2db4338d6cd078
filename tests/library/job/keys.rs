//! Keys that are unknown, missing or at odds, and text that is no TOML.

use super::check;

#[test]
fn unknown_keys() {
    check(&[
        ("[field]", "[feild]", "bad.toml:21:2: feild: found an unknown key; did you mean `field`?"),
        (
            "[field]",
            "[colour]",
            "bad.toml:21:2: colour: found an unknown key; expected one of object, printer, materials, target, \
                clusters, stacking, appearance, field, output, overlap, arrange, gap-mm",
        ),
        (
            "height-mm",
            "heigth-mm",
            "bad.toml:3:1: object[0].heigth-mm: found an unknown key; did you mean `height-mm`?",
        ),
        ("mesh =", "mehs =", "bad.toml:2:1: object[0].mehs: found an unknown key; did you mean `mesh`?"),
        (
            "height-mm = 30",
            "\"two words\" = 30",
            "bad.toml:3:1: object[0].\"two words\": found an unknown key; expected one of mesh, unit, scale, \
                height-mm, rotate-deg, position-mm, count, depth-from, target",
        ),
        ("preset =", "pre-set =", "bad.toml:6:1: printer.pre-set: found an unknown key; did you mean `preset`?"),
        (
            "set = \"synthetic\"",
            "sets = \"synthetic\"",
            "bad.toml:9:1: materials.sets: found an unknown key; did you mean `set`?",
        ),
        ("albedo =", "albdeo =", "bad.toml:13:1: target.albdeo: found an unknown key; did you mean `albedo`?"),
        (
            "albedo =",
            "profile =",
            "bad.toml:13:1: target.profile: found a key of kind = \"profile\", expected only keys of kind \
                = \"texture\": preset, albedo, albedo-value, albedo-colour, mean-free-path, mean-free-path-mm, \
                subsurface-colour, subsurface-radius-mm, subsurface-scale, subsurface-anisotropy, projection, tile-mm, \
                max-albedo, gamut-map",
        ),
        ("k = 100", "K = 100", "bad.toml:16:1: clusters.K: found an unknown key; did you mean `k`?"),
        ("units = 64", "unit = 64", "bad.toml:19:1: stacking.unit: found an unknown key; did you mean `units`?"),
        (
            "units = 64",
            "[[stacking.limit]]\nresin = \"a\"\nmindepth-mm = 1",
            "bad.toml:21:1: stacking.limit[0].mindepth-mm: found an unknown key; did you mean `min-depth-mm`?",
        ),
        ("distance =", "distanse =", "bad.toml:22:1: field.distanse: found an unknown key; did you mean `distance`?"),
        ("formats =", "format =", "bad.toml:25:1: output.format: found an unknown key; did you mean `formats`?"),
        (
            "height-mm = 30",
            "zz = 1\naa = 1",
            "bad.toml:3:1: object[0].zz: found an unknown key; expected one of mesh, unit, scale, height-mm, \
                rotate-deg, position-mm, count, depth-from, target",
        ),
    ]);
}

#[test]
fn missing_keys() {
    check(&[
        (
            "mesh = \"rabbit.glb\"\n",
            "",
            "bad.toml:1:1: object[0].mesh: found nothing, expected the path of a mesh file",
        ),
        (
            "[[object]]\nmesh = \"rabbit.glb\"\nheight-mm = 30\n",
            "",
            "bad.toml:1:1: object: found nothing, expected one or several [[object]] tables",
        ),
        (
            "[printer]\npreset = \"j750-27um\"\n",
            "",
            "bad.toml:1:1: printer: found nothing, expected a [printer] table with a preset or a pitch-mm",
        ),
        (
            "preset = \"j750-27um\"",
            "",
            "bad.toml:5:1: printer.pitch-mm: found nothing, expected a pitch-mm, or a preset in its place",
        ),
        (
            "[materials]\nset = \"synthetic\"\n",
            "",
            "bad.toml:1:1: materials: found nothing, expected a [materials] table with a set or a file",
        ),
        (
            "set = \"synthetic\"",
            "",
            "bad.toml:8:1: materials.set: found nothing, expected the name of a built-in set of resins, or a file in \
                its place",
        ),
        (
            "[target]\nkind = \"texture\"\nalbedo = \"albedo.png\"\n",
            "",
            "bad.toml:1:1: object[0].target: found nothing, expected a [target] for the whole job or an \
                [object.target] of its own",
        ),
        (
            "kind = \"texture\"\n",
            "",
            "bad.toml:11:1: target.kind: found nothing, expected one \
                of \"stacking\", \"profile\", \"texture\", \"clusters\", \"bssrdf\"",
        ),
        (
            "kind = \"texture\"\nalbedo = \"albedo.png\"",
            "kind = \"stacking\"",
            "bad.toml:11:1: target.stack: found nothing, expected layers like \"white:0.5,support:1.0\"",
        ),
        (
            "kind = \"texture\"\nalbedo = \"albedo.png\"",
            "kind = \"profile\"",
            "bad.toml:11:1: target.profile: found nothing, expected the path of a profile CSV, or an array of one for \
                each channel",
        ),
        (
            "kind = \"texture\"\nalbedo = \"albedo.png\"",
            "kind = \"clusters\"",
            "bad.toml:11:1: target.labels: found nothing, expected the path of an image of labels",
        ),
        (
            "units = 64",
            "[[stacking.limit]]\nmin-mm = 1",
            "bad.toml:19:1: stacking.limit[0].resin: found nothing, expected the name of a resin",
        ),
    ]);
}

#[test]
fn contradictions() {
    check(&[
        (
            "= 30",
            "= 30\nscale = 1",
            "bad.toml:4:1: object[0].scale: found together with `height-mm`, expected only one of the two",
        ),
        (
            "height-mm = 30",
            "scale = 1\nheight-mm = 30",
            "bad.toml:4:1: object[0].height-mm: found together with `scale`, expected only one of the two",
        ),
        (
            "\"j750-27um\"",
            "\"j750-27um\"\npitch-mm = [1, 1, 1]",
            "bad.toml:7:1: printer.pitch-mm: found together with `preset`, expected only one of the two",
        ),
        (
            "\"j750-27um\"",
            "\"j750-27um\"\nname = \"ours\"",
            "bad.toml:7:1: printer.name: found together with `preset`, expected only one of the two",
        ),
        (
            "\"synthetic\"",
            "\"synthetic\"\nfile = \"resins.toml\"",
            "bad.toml:10:1: materials.file: found together with `set`, expected only one of the two",
        ),
        (
            "\"albedo.png\"",
            "\"albedo.png\"\nalbedo-value = 1",
            "bad.toml:14:1: target.albedo-value: found together with `albedo`, expected only one of the two",
        ),
        (
            "\"exact\"",
            "\"exact\"\nlp-exponent = 4",
            "bad.toml:23:15: field.lp-exponent: found an exponent that nothing uses, expected distance = \"lp\" \
                beside it",
        ),
        (
            "units = 64",
            "[[stacking.limit]]\nresin = \"a\"\n[[stacking.limit]]\nresin = \"a\"",
            "bad.toml:22:9: stacking.limit[1].resin: found a second limit for \"a\", expected one limit for each resin",
        ),
        (
            "[\"png\"]",
            "[\"png\", \"stl\", \"png\"]",
            "bad.toml:25:26: output.formats[2]: found \"png\" a second time, expected each format once",
        ),
    ]);
}

#[test]
fn text_that_is_not_toml() {
    check(&[
        (
            "= 30",
            "= 30 mm",
            "bad.toml:3:13: found text that is not valid TOML: string values must be quoted, expected literal string",
        ),
        (
            "= 30",
            "=",
            "bad.toml:3:12: found text that is not valid TOML: string values must be quoted, expected literal string",
        ),
        ("= 30", "= 30\nheight-mm = 31", "bad.toml:4:1: found text that is not valid TOML: duplicate key"),
        ("[printer]", "[printer", "bad.toml:5:9: found text that is not valid TOML: unclosed table, expected `]`"),
    ]);
}
