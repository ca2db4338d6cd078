//! A folder with a mesh and a job, the program, and what it said.

use std::{
    collections::BTreeMap,
    ffi::OsStr,
    fs,
    path::{Path, PathBuf},
    process::{Command, Output},
};

use glam::DVec3;
use serde_json::Value;
use tempfile::TempDir;

use crate::shapes::{self, box_triangles};

/// A job on a cube of 4 mm: 20 × 20 × 20 voxels.
pub const JOB: &str = r#"
[[object]]
mesh = "cube.stl"
[printer]
pitch-mm = [0.2, 0.2, 0.2]
[materials]
set = "synthetic"
[target]
kind = "stacking"
stack = "white:0.5,support:0.6"
[stacking]
core = "black"
[output]
formats = ["png", "masks"]
"#;

/// What the program did.
pub struct Ran {
    pub code: Option<i32>,
    pub stdout: String,
    pub stderr: String,
}

impl Ran {
    pub fn from(output: Output) -> Self {
        let text = |bytes: Vec<u8>| String::from_utf8(bytes).expect("UTF-8 only");
        Self { code: output.status.code(), stdout: text(output.stdout), stderr: text(output.stderr) }
    }

    /// The same, after checking the exit code.
    #[track_caller]
    pub fn exits(self, code: i32) -> Self {
        assert_eq!(self.code, Some(code), "stdout:\n{}\nstderr:\n{}", self.stdout, self.stderr);
        self
    }

    /// Checks that a refusal is one `error:` line that holds every one of `parts`, with no data.
    #[track_caller]
    pub fn refuses(self, code: i32, parts: &[&str]) {
        let ran = self.exits(code);
        assert_eq!(ran.stdout, "");
        let errors: Vec<_> = ran.stderr.lines().filter(|line| line.starts_with("error: ")).collect();
        assert_eq!(errors.len(), 1, "{}", ran.stderr);
        let others = ran.stderr.lines().filter(|line| !line.starts_with("error: ") && !line.starts_with("note: "));
        assert_eq!(others.collect::<Vec<_>>(), Vec::<&str>::new());
        for part in parts {
            assert!(errors[0].contains(part), "{}\nlacks: {part}", errors[0]);
        }
    }

    /// stdout as the one JSON document it must be.
    #[track_caller]
    pub fn json(&self) -> Value {
        serde_json::from_str(&self.stdout).unwrap_or_else(|error| panic!("{error}:\n{}", self.stdout))
    }
}

/// The program, without a cache: what a test searches is searched.
pub fn lumislice() -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_lumislice"));
    command.env("LUMISLICE_CACHE", "");
    command
}

/// Runs the program in no particular folder.
pub fn run<S: AsRef<OsStr>>(args: impl IntoIterator<Item = S>) -> Ran {
    Ran::from(lumislice().args(args).output().unwrap())
}

/// Keys of a JSON object in their order.
pub fn keys(value: &Value) -> Vec<&str> {
    value.as_object().expect("an object").keys().map(String::as_str).collect()
}

/// A folder of its own for a test.
pub struct Bench {
    folder: TempDir,
    /// Whether what was searched in it is not searched again.
    remembers: bool,
}

impl Bench {
    /// With `cube.stl` and `job.toml`.
    pub fn new() -> Self {
        let bench = Self { folder: tempfile::tempdir().unwrap(), remembers: false };
        bench.write("cube.stl", &stl(&cube(4.0)));
        bench.write("job.toml", JOB.as_bytes());
        bench
    }

    /// The same, with a cache of its own: for tests that ask the same more than once, and not how it is found.
    pub fn that_remembers() -> Self {
        Self { remembers: true, ..Self::new() }
    }

    pub fn path(&self, name: impl AsRef<Path>) -> PathBuf {
        self.folder.path().join(name)
    }

    pub fn write(&self, name: impl AsRef<Path>, content: &[u8]) {
        let path = self.path(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, content).unwrap();
    }

    /// `job.toml` with some text replaced.
    pub fn job_with(&self, from: &str, to: &str) {
        assert!(JOB.contains(from), "{from}");
        self.write("job.toml", JOB.replacen(from, to, 1).as_bytes());
    }

    /// Writes the job with several changes, each `from` something `to` something else that is found in it.
    pub fn job_with_all(&self, changes: &[[&str; 2]]) {
        let job = changes.iter().fold(JOB.to_owned(), |job, [from, to]| {
            assert!(job.contains(from), "{from}");
            job.replace(from, to)
        });
        self.write("job.toml", job.as_bytes());
    }

    /// The program, to run in the folder.
    pub fn command<S: AsRef<OsStr>>(&self, args: impl IntoIterator<Item = S>) -> Command {
        let mut command = lumislice();
        command.current_dir(self.folder.path()).args(args);
        if self.remembers {
            command.env("LUMISLICE_CACHE", self.path("cache"));
        }
        command
    }

    pub fn run<S: AsRef<OsStr>>(&self, args: impl IntoIterator<Item = S>) -> Ran {
        Ran::from(self.command(args).output().unwrap())
    }

    /// Slices `job.toml` into `out`.
    #[track_caller]
    pub fn slice(&self, out: &str) -> Ran {
        self.run(["slice", "job.toml", "-o", out]).exits(0)
    }

    pub fn manifest(&self, out: &str) -> Value {
        serde_json::from_slice(&fs::read(self.path(out).join("manifest.json")).unwrap()).unwrap()
    }

    /// Every file of a folder but the timings, by path.
    pub fn files(&self, folder: &str) -> BTreeMap<String, Vec<u8>> {
        let root = self.path(folder);
        let mut found = BTreeMap::new();
        let mut folders = vec![root.clone()];
        while let Some(folder) = folders.pop() {
            for entry in fs::read_dir(folder).unwrap().map(Result::unwrap) {
                let relative = entry.path().strip_prefix(&root).unwrap().to_str().unwrap().to_owned();
                if entry.file_type().unwrap().is_dir() {
                    folders.push(entry.path());
                } else if relative != "timings.json" {
                    found.insert(relative, fs::read(entry.path()).unwrap());
                }
            }
        }
        found
    }
}

pub type Triangle = [[f32; 3]; 3];

/// An axis-aligned cube with a corner at the origin.
pub fn cube(edge: f32) -> Vec<Triangle> {
    single(&box_triangles(DVec3::ZERO, DVec3::splat(edge.into())))
}

/// A sphere of `2·steps` meridians and `steps` parallels that touches the three planes of the axes.
pub fn sphere(radius: f32, steps: usize) -> Vec<Triangle> {
    single(&shapes::sphere(DVec3::splat(radius.into()), radius.into(), steps))
}

fn single(triangles: &[[DVec3; 3]]) -> Vec<Triangle> {
    triangles.iter().map(|t| t.map(|p| p.as_vec3().to_array())).collect()
}

/// A binary STL file.
pub fn stl(triangles: &[Triangle]) -> Vec<u8> {
    let mut file = vec![b' '; 80];
    file.extend((triangles.len() as u32).to_le_bytes());
    for triangle in triangles {
        file.extend([0; 12]);
        file.extend(triangle.as_flattened().iter().flat_map(|value| value.to_le_bytes()));
        file.extend([0; 2]);
    }
    file
}
