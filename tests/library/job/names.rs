//! Names of files, printers, resins and features that nothing bears.

use lumislice::job::Job;

use super::{GOOD, check, inputs};

#[test]
fn inputs_that_are_not_there() {
    check(&[
        (
            "rabbit.glb",
            "hare.glb",
            "bad.toml:2:8: object[0].mesh: found \"hare.glb\", which does not exist, expected a mesh file (looked at \
                DIR/hare.glb)",
        ),
        (
            "rabbit.glb",
            "factored",
            "bad.toml:2:8: object[0].mesh: found \"factored\", which is a folder, expected a mesh file (looked at \
                DIR/factored)",
        ),
        (
            "\"albedo.png\"",
            "\"white.png\"",
            "bad.toml:13:10: target.albedo: found \"white.png\", which does not exist, expected an albedo texture \
                (looked at DIR/white.png)",
        ),
        (
            "\"albedo.png\"",
            "\"albedo.png\"\nmean-free-path = \"mfp.png\"",
            "bad.toml:14:18: target.mean-free-path: found \"mfp.png\", which does not exist, expected a \
                mean-free-path texture (looked at DIR/mfp.png)",
        ),
        (
            "set = \"synthetic\"",
            "file = \"none.toml\"",
            "bad.toml:9:8: materials.file: found \"none.toml\", which does not exist, expected a material file \
                (looked at DIR/none.toml)",
        ),
        (
            "kind = \"texture\"\nalbedo = \"albedo.png\"",
            "kind = \"profile\"\nprofile = \"q.csv\"",
            "bad.toml:13:11: target.profile: found \"q.csv\", which does not exist, expected a profile CSV (looked at \
                DIR/q.csv)",
        ),
        (
            "kind = \"texture\"\nalbedo = \"albedo.png\"",
            "kind = \"clusters\"\nlabels = \"labels.png\"\nprofiles = [\"p.csv\", \"q.csv\"]",
            "bad.toml:14:22: target.profiles[1]: found \"q.csv\", which does not exist, expected a profile CSV \
                (looked at DIR/q.csv)",
        ),
        (
            "kind = \"texture\"\nalbedo = \"albedo.png\"",
            "kind = \"clusters\"\nlabels = \"labels.png\"\nprofiles = []",
            "bad.toml:14:12: target.profiles: found an empty array, expected 1 to 65535 paths of profile CSVs",
        ),
        (
            "kind = \"texture\"\nalbedo = \"albedo.png\"",
            "kind = \"bssrdf\"\nmap = \"p.csv\"",
            "bad.toml:13:7: target.map: found \"p.csv\", which is not a folder, expected a folder of factored \
                profiles (looked at DIR/p.csv)",
        ),
    ]);
}

#[test]
#[cfg(unix)]
fn inputs_that_unix_refuses() {
    check(&[
        (
            "rabbit.glb",
            "/dev/null",
            "bad.toml:2:8: object[0].mesh: found \"/dev/null\", which is not a regular file, expected a mesh file \
                (looked at /dev/null)",
        ),
        (
            "rabbit.glb",
            "rabbit.glb/x",
            "bad.toml:2:8: object[0].mesh: found \"rabbit.glb/x\", which cannot be opened (Not a directory (os error \
                20)), expected a mesh file (looked at DIR/rabbit.glb/x)",
        ),
        (
            "rabbit.glb",
            "a\\u0000\\nb",
            "bad.toml:2:8: object[0].mesh: found \"a\\u{0}\\nb\", which cannot be opened (file name contained an \
                unexpected NUL byte), expected a mesh file (looked at DIR/a\\u{0}\\nb)",
        ),
    ]);
}

#[test]
fn names_and_stacks_and_what_is_not_built() {
    check(&[
        (
            "j750-27um",
            "j750-27",
            "bad.toml:6:10: printer.preset: found the unknown printer \"j750-27\"; did you mean `j750-27um`?",
        ),
        (
            "j750-27um",
            "mimaki",
            "bad.toml:6:10: printer.preset: found the unknown printer \"mimaki\"; expected one of j750-14um, \
                j750-27um, j750-hs-27um, j850-14um, j850-27um, j850-hs-27um, j835-14um, j835-27um, connex500-16um, \
                connex500-30um, connex350-16um, connex350-30um",
        ),
        (
            "kind = \"texture\"\nalbedo = \"albedo.png\"",
            "kind = \"stacking\"\nstack = \"white:0.5,support\"",
            "bad.toml:13:9: target.stack: layer 2 of the stack: found \"support\", expected name:thickness, the \
                thickness in mm",
        ),
        (
            "kind = \"texture\"\nalbedo = \"albedo.png\"",
            "kind = \"stacking\"\nstack = \"\"",
            "bad.toml:13:9: target.stack: found an empty stack, expected layers like white:0.5,support:1.0 \
                (name:thickness in mm, top first)",
        ),
        (
            "kind = \"texture\"\nalbedo = \"albedo.png\"",
            "kind = \"bssrdf\"\nmap = \"factored\"\nmax-albedo = 60",
            "bad.toml:14:14: target.max-albedo: found 60, expected an albedo from 0.001 to 1",
        ),
        (
            "[\"png\"]",
            "[\"png\", \"svx\"]",
            "bad.toml:25:19: output.formats[1]: found \"svx\", which is not built yet; expected one \
                of \"png\", \"masks\", \"stl\", \"3mf\", \"preview\", \"heights\", \"gcvf\", \"bmp\", \
                \"vti\", \"nrrd\", \"vdb\"",
        ),
        (
            "= 30",
            "= 30\n[object.target]\nkind = \"profile\"\nprofile = 1",
            "bad.toml:6:11: object[0].target.profile: found 1, expected the path of a profile CSV",
        ),
    ]);
}

#[test]
fn resins_are_checked_once_they_are_known() {
    let dir = inputs();
    let names = ["white", "black", "support"];
    let load = |part: &str, new: &str| Job::from_toml(&GOOD.replace(part, new), "bad.toml", dir.path()).unwrap();
    let stack = "kind = \"texture\"\nalbedo = \"albedo.png\"";
    for (part, new, expected) in [
        (
            "units = 64",
            "core = \"blak\"",
            "bad.toml:19:8: stacking.core: found the unknown resin \"blak\"; did you mean `black`?",
        ),
        (
            "units = 64",
            "[[stacking.limit]]\nresin = \"cyan\"",
            "bad.toml:20:9: stacking.limit[0].resin: found the unknown resin \"cyan\"; expected one of white, black, \
                support",
        ),
        (
            stack,
            "kind = \"stacking\"\nstack = \"white:1,suport:1\"",
            "bad.toml:13:9: target.stack: found the unknown resin \"suport\"; did you mean `support`?",
        ),
        (
            "= 30",
            "= 30\ntarget = { kind = \"stacking\", stack = \"wite:1\" }",
            "bad.toml:4:39: object[0].target.stack: found the unknown resin \"wite\"; did you mean `white`?",
        ),
        (
            "[\"png\"]",
            "[\"png\"]\nbackground-as = \"clear\"",
            "bad.toml:26:17: output.background-as: found the unknown resin \"clear\"; expected one of white, black, \
                support",
        ),
    ] {
        assert_eq!(load(part, new).check_resins(&names).unwrap_err().to_string(), expected);
    }
    let good = load("units = 64", "core = \"black\"");
    assert_eq!(good.check_resins(&names), Ok(()));
    let without_support = good.check_resins(&["white", "black"]);
    assert_eq!(without_support, Ok(()), "support's default limit is no mention of it");
    assert_eq!(
        load("synthetic", "sinthetic").check_material_set(&["synthetic"]).unwrap_err().to_string(),
        "bad.toml:9:7: materials.set: found the unknown material set \"sinthetic\"; did you mean `synthetic`?"
    );
    assert_eq!(good.check_material_set(&["synthetic"]), Ok(()));
}

#[test]
fn late_errors_still_know_their_place() {
    let dir = inputs();
    let job = Job::from_toml(GOOD, "bad.toml", dir.path()).unwrap();
    let error = job.refuse("object[0].height-mm", "900 mm", "a height that fits the tray").to_string();
    assert_eq!(error, "bad.toml:3:13: object[0].height-mm: found 900 mm, expected a height that fits the tray");
    assert_eq!(job.place("object[0].scale").line, 1, "the table around a key that is left out");
    assert_eq!(job.place("output.mesh-pitch-mm").line, 24);
    assert_eq!(job.place("nothing").to_string(), "bad.toml:1:1");
}
