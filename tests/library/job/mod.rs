//! Every way a job can be wrong, and the one line that says so.

mod contradictions;
mod keys;
mod names;
mod reads;
mod targets;
mod values;

use std::fs;
use std::path::Path;

use lumislice::job::Job;

/// A good job; each case spoils one part of it.
const GOOD: &str = r#"[[object]]
mesh = "rabbit.glb"
height-mm = 30

[printer]
preset = "j750-27um"

[materials]
set = "synthetic"

[target]
kind = "texture"
albedo = "albedo.png"

[clusters]
k = 100

[stacking]
units = 64

[field]
distance = "exact"

[output]
formats = ["png"]
"#;

/// A folder with the inputs that jobs here name.
fn inputs() -> tempfile::TempDir {
    let dir = tempfile::tempdir().unwrap();
    for name in ["rabbit.glb", "albedo.png", "p.csv", "labels.png", "resins.toml"] {
        fs::write(dir.path().join(name), "").unwrap();
    }
    fs::create_dir(dir.path().join("factored")).unwrap();
    dir
}

/// The message about `text`, with the inputs' folder as DIR.
fn message(text: &str, dir: &Path) -> String {
    match Job::from_toml(text, "bad.toml", dir) {
        Ok(_) => "no error".to_owned(),
        Err(error) => error.to_string().replace(&dir.display().to_string(), "DIR"),
    }
}

/// Replaces one part of [`GOOD`] in each case and compares the whole message.
fn check(cases: &[(&str, &str, &str)]) {
    let dir = inputs();
    assert_eq!(message(GOOD, dir.path()), "no error");
    let mut wrong = String::new();
    for (part, spoilt, expected) in cases {
        assert_eq!(GOOD.matches(part).count(), 1, "{part:?} must stand once in the good job");
        let found = message(&GOOD.replace(part, spoilt), dir.path());
        assert!(!found.contains('\n'), "{found:?} is one line");
        if found != *expected {
            wrong += &format!("{part:?} → {spoilt:?}\n    found    {found}\n    expected {expected}\n");
        }
    }
    assert!(wrong.is_empty(), "\n{wrong}");
}
