//! Good jobs, their defaults and their canonical form; and texts that no one should have to write.

use std::fs;
use std::path::Path;
use std::sync::LazyLock;

use lumislice::job::{
    Job, JobError,
    file::{
        AlbedoSource, Distance, MAX_JOB_BYTES, MaterialSource, OutputFormat, Projection, Scaling, StackingModel,
        TargetSpec, TextureTarget, Unit,
    },
};
use lumislice::{
    optics::Stack,
    search::{Norm, Objective, ResinLimit},
};
use proptest::prelude::*;

/// The least a job needs.
const MINIMAL: &str = r#"
object = [{ mesh = "rabbit.glb" }]
printer.preset = "j750-27um"
materials.set = "synthetic"
target.kind = "texture"
"#;

/// The complete job of the documentation, word for word the one users copy.
fn documented() -> String {
    let page = include_str!("../../../docs/job.md");
    let start = page.find("```toml\n").unwrap() + "```toml\n".len();
    page[start..].split("```").next().unwrap().to_owned()
}

/// A folder with the inputs that jobs here name.
fn inputs() -> tempfile::TempDir {
    let dir = tempfile::tempdir().unwrap();
    for name in
        ["rabbit.glb", "marble-albedo.png", "marble-mfp.png", "p.csv", "a.csv", "b.csv", "labels.png", "resins.toml"]
    {
        fs::write(dir.path().join(name), "").unwrap();
    }
    dir
}

fn load(text: &str, dir: &Path) -> Job {
    Job::from_toml(text, "dir/good.toml", dir).unwrap_or_else(|error| panic!("{error}"))
}

#[test]
fn defaults() {
    let dir = inputs();
    let job = load(MINIMAL, dir.path());
    assert_eq!(job.name, "good");
    let object = &job.objects[0];
    assert_eq!((object.unit, object.scaling), (None, Scaling::Scale(1.0)));
    assert_eq!((object.rotate_deg, object.position_mm), ([0.0; 3], [0.0; 3]));
    let mesh_color = AlbedoSource::MeshBaseColor;
    let texture = TextureTarget {
        albedo: mesh_color,
        mean_free_path: None,
        mean_free_path_mm: None,
        max_albedo: None,
        projection: Projection::Coordinates,
    };
    assert_eq!(object.target, TargetSpec::Texture(texture));
    assert_eq!((job.clusters.k, job.clusters.seed), (100, 1));
    let stacking = &job.stacking;
    assert_eq!(
        (stacking.max_thickness_mm, stacking.units, stacking.depth, stacking.objective),
        (5.0, 64, 6, Objective { norm: Norm::Natural, dc_weight: 1.0 })
    );
    assert_eq!(stacking.model, StackingModel::Transport { min_layer_mm: None, layer_step_mm: None });
    assert_eq!(stacking.core.as_deref(), Some("black"));
    assert_eq!(job.field.distance, Distance::Exact);
    assert_eq!(job.output.formats, [OutputFormat::Png, OutputFormat::Preview]);
    assert_eq!((job.output.mesh_pitch_mm, &job.output.map_background), (None, &None));
}

#[test]
fn support_keeps_its_distance_unless_told_otherwise() {
    let dir = inputs();
    let limits = |more: &str| {
        let job = load(&format!("{MINIMAL}{more}"), dir.path());
        job.stacking.resin_limits(&["white", "support"])
    };
    let support = ResinLimit { min_depth_mm: 0.2, ..ResinLimit::NONE };
    assert_eq!(limits(""), [ResinLimit::NONE, support]);
    let told = limits("[[stacking.limit]]\nresin = \"support\"\nmin-depth-mm = 0");
    assert_eq!(told, [ResinLimit::NONE; 2]);
    let half_told = limits("[[stacking.limit]]\nresin = \"support\"\nmax-mm = 3");
    assert_eq!(half_told[1], ResinLimit { max_mm: 3.0, ..support });
    let other = limits("[[stacking.limit]]\nresin = \"white\"\nmin-mm = 0.1");
    assert_eq!(other, [ResinLimit { min_mm: 0.1, ..ResinLimit::NONE }, support]);
}

#[test]
fn the_documented_job_reads_as_documented() {
    let dir = inputs();
    let job = load(&documented(), dir.path());
    assert_eq!(job.objects[0].scaling, Scaling::HeightMm(30.0));
    assert_eq!(job.printer.name, "j750-27um");
    assert_eq!(job.materials, MaterialSource::Set("synthetic".to_owned()));
    let TargetSpec::Texture(texture) = &job.objects[0].target else { panic!("{:?}", job.objects[0].target) };
    let TextureTarget { albedo: AlbedoSource::Texture(albedo), mean_free_path: Some(_), max_albedo, .. } = texture
    else {
        panic!("{texture:?}")
    };
    assert_eq!((albedo.written.as_str(), *max_albedo), ("marble-albedo.png", Some(0.6)));
    assert_eq!(albedo.path, dir.path().join("marble-albedo.png"));
    assert_eq!(job.stacking.core.as_deref(), Some("black"));
    assert_eq!(job.output.formats, OutputFormat::ALL.map(|(_, format)| format));
    job.check_resins(&["white", "black", "support"]).unwrap();
}

/// One job of every shape; each must read, and its canonical form must read back to itself.
fn shapes() -> Vec<String> {
    let base = "[[object]]\nmesh = \"rabbit.glb\"\n[printer]\npreset = \"connex500-30um\"\n[materials]\nfile \
        = \"resins.toml\"\n";
    vec![
        MINIMAL.to_owned(),
        documented(),
        format!("{base}[target]\nkind = \"stacking\"\nstack = \"white:0.5, support:1.0, black:0.5\""),
        format!("{base}[target]\nkind = \"profile\"\nprofile = \"p.csv\"\n[field]\ndistance = \"lp\""),
        format!("{base}[target]\nkind = \"profile\"\nprofile = \"p.csv\"\n[field]\ndistance = \"lp\"\nlp-exponent = 4"),
        format!("{base}[target]\nkind = \"clusters\"\nlabels = \"labels.png\"\nprofiles = [\"a.csv\", \"b.csv\"]"),
        format!("{base}[target]\nkind = \"texture\"\nalbedo-value = 0.8\n[field]\ndistance = \"grid\""),
        format!("{base}scale = 1 # stands in [materials]").replace(
            "scale = 1 # stands in \
            [materials]",
            "[target]\nkind = \"texture\"",
        ),
        MINIMAL.replace(
            "printer.preset = \"j750-27um\"",
            "printer = { pitch-mm = [0.1, 0.1, 0.1], tray-mm = [100, \
            100, 50.5], max-colors = 4, min-slices = 1 }",
        ),
        MINIMAL.replace("printer.preset = \"j750-27um\"", "printer = { preset = \"j750-27um\", max-colors = 3 }"),
        // Two objects, one with a target of its own.
        "[[object]]\nmesh = \"rabbit.glb\"\nunit = \"inch\"\nscale = 2\nrotate-deg = [90, -0.0, 0]\nposition-mm = \
            [10, 0, 0]\n\
         [object.target]\nkind = \"profile\"\nprofile = \"./p.csv\"\n[[object]]\nmesh = \"rabbit.glb\"\n\
         [target]\nkind = \"stacking\"\nstack = \"white:1\"\n[printer]\npreset = \"j750-14um\"\n[materials]\nset \
         = \"synthetic\"\n\
         [clusters]\nk = 1\nseed = 9223372036854775807\n[stacking]\nunits = 2\ndepth = 12\ndc-weight = 0\n\
         [[stacking.limit]]\nresin = \"white\"\nmin-mm = 0.1\nmax-mm = 2\n[output]\nbackground-as = \"white\""
            .to_owned(),
        // A profile for each channel.
        format!(
            "{base}[target]\nkind = \"profile\"\nprofile = \
            [\"a.csv\", \"b.csv\", \"p.csv\"]\n[stacking]\nobjective = \"spatial\""
        ),
        format!(
            "{base}[target]\nkind = \"clusters\"\nlabels = \"labels.png\"\nprofiles = [\"a.csv\", \
            [\"a.csv\", \"b.csv\"]]"
        ),
        // Windows line ends, a byte order mark.
        format!("\u{feff}{}", MINIMAL.replace('\n', "\r\n")),
        format!("{base}[target]\npreset = \"marble\"\nmax-albedo = 0.6"),
        format!("{base}[target]\nkind = \"texture\"\nalbedo-colour = \"#c08040\"\nmean-free-path-mm = [1.0, 0.4, 0.2]"),
        format!(
            "{base}[target]\nkind = \"texture\"\nsubsurface-colour = [0.8, 0.5, 0.3]\nsubsurface-radius-mm = 2\n\
             subsurface-scale = [1.0, 0.5, 0.25]\nsubsurface-anisotropy = 0.4"
        ),
        format!(
            "{base}[target]\nkind = \"texture\"\nalbedo = \"marble-albedo.png\"\nprojection = \"triplanar\"\n\
             tile-mm = 5"
        ),
    ]
}

#[test]
fn every_shape_reads_and_its_canonical_form_reads_back() {
    let dir = inputs();
    for text in shapes() {
        let job = load(&text, dir.path());
        let canonical = toml::to_string(&job.resolved()).unwrap();
        let again = load(&canonical, dir.path());
        assert_eq!(again.resolved(), job.resolved(), "from\n{canonical}");
        assert_eq!((&again.printer, &again.stacking, &again.output), (&job.printer, &job.stacking, &job.output));
        assert_eq!((&again.objects, &again.materials, &again.field), (&job.objects, &job.materials, &job.field));
        let json = serde_json::to_string(&job.resolved()).unwrap();
        assert!(!json.contains("null") && !json.contains(&*dir.path().to_string_lossy()), "{json}");
    }
}

#[test]
fn two_objects_share_or_own_their_targets() {
    let dir = inputs();
    let job = load(&shapes()[10], dir.path());
    assert!(matches!(job.objects[0].target, TargetSpec::Profile { .. }));
    assert_eq!(job.objects[1].target, TargetSpec::Stacking { stack: Stack::new([("white".to_owned(), 1.0)]) });
    assert_eq!(job.objects[0].unit, Some(Unit::Inch));
    assert_eq!(
        job.check_resins(&["black"]).unwrap_err().to_string(),
        "dir/good.toml:14:9: target.stack: found the unknown resin \"white\"; expected one of black"
    );
}

#[test]
fn loading_is_relative_to_the_job_file() {
    let dir = inputs();
    let sub = dir.path().join("jobs");
    fs::create_dir(&sub).unwrap();
    let path = sub.join("my job.toml");
    fs::write(&path, MINIMAL.replace("rabbit.glb", "../rabbit.glb")).unwrap();
    let job = Job::load(&path).unwrap();
    assert_eq!((job.name.as_str(), &job.path), ("my job", &path));
    assert_eq!(job.objects[0].mesh.path, sub.join("../rabbit.glb"));
}

#[test]
fn jobs_of_utf_16() {
    let dir = inputs();
    let path = dir.path().join("job.toml");
    let units = |text: &str| text.encode_utf16().collect::<Vec<_>>();
    for text in [MINIMAL.trim_start().to_owned(), format!("\u{feff}{MINIMAL}")] {
        for bytes in [
            units(&text).iter().flat_map(|unit| unit.to_le_bytes()).collect::<Vec<_>>(),
            units(&text).iter().flat_map(|unit| unit.to_be_bytes()).collect(),
        ] {
            fs::write(&path, bytes).unwrap();
            assert_eq!(Job::load(&path).unwrap().objects[0].mesh.path, dir.path().join("rabbit.glb"));
        }
    }
}

#[test]
fn files_that_are_no_jobs() {
    let dir = tempfile::tempdir().unwrap();
    let message = |name: &str, bytes: &[u8]| {
        let path = dir.path().join(name);
        fs::write(&path, bytes).unwrap();
        Job::load(&path).unwrap_err().to_string().replace(&dir.path().display().to_string(), "DIR")
    };
    assert_eq!(
        message("a.toml", b"k = \xff"),
        "DIR/a.toml: found bytes that are not UTF-8 at offset 4, expected a readable job file"
    );
    let ten_megabytes = vec![b'#'; 10 << 20];
    assert_eq!(
        message("b.toml", &ten_megabytes),
        "DIR/b.toml: found 10485760 bytes or more, expected a job of at most 1048576"
    );
    assert_eq!(
        message("c.toml", b""),
        "DIR/c.toml:1:1: object: found nothing, expected one or several [[object]] tables"
    );
    assert_eq!(
        message("d.toml", b"\x00"),
        "DIR/d.toml:1:2: found text that is not valid TOML: key with no value, expected `=`"
    );
    let folder = Job::load(dir.path()).unwrap_err().to_string();
    assert!(folder.ends_with("found a folder, expected a readable job file"), "{folder}");
    let nowhere = Job::load("no\nwhere.toml").unwrap_err().to_string();
    assert_eq!(nowhere, "no\\nwhere.toml: found no such file, expected a readable job file");
}

#[test]
fn deep_nesting_is_refused_and_not_recursed_into() {
    let dir = inputs();
    let deep = 200_000;
    for text in [
        format!("a = {}", "[".repeat(deep)),
        format!("a = {}{}", "[".repeat(deep), "]".repeat(deep)),
        format!("a = {}", "{ a = ".repeat(deep / 2)),
        format!("{}a = 1", "a.".repeat(deep)),
        format!("[{}a]", "a.".repeat(deep)),
        // As deep as the parser's limits on keys and on brackets allow together.
        format!("a = {}1{}", format!("{{ {}a = ", "a.".repeat(78)).repeat(78), "}".repeat(78)),
    ] {
        let error = Job::from_toml(&text, "deep.toml", dir.path()).unwrap_err();
        assert!(matches!(error, JobError::Syntax { .. } | JobError::UnknownKey { .. }), "{error}");
        assert!(error.to_string().len() < 300);
    }
}

#[test]
fn places_on_a_very_long_line_are_right() {
    let dir = inputs();
    let list = "\"p.csv\",".repeat(20_000);
    let target =
        |list: &str| format!("target = {{ kind = \"clusters\", labels = \"labels.png\", profiles = [{list}] }}");
    let text = MINIMAL.replace("target.kind = \"texture\"", &target(&list));
    let job = load(&text, dir.path());
    let last = job.place("object[0].target.profiles[19999]");
    assert_eq!(last.line, 2, "the target is the job's, not the object's");
    let last = job.place("target.profiles[19999]");
    assert_eq!((last.line, last.column as usize), (5, target("").find("[]").unwrap() + 2 + 19_999 * 8));
    let ones = MINIMAL.replace("target.kind = \"texture\"", &target(&"1,".repeat(400_000)));
    assert!(Job::from_toml(&ones, "ones.toml", dir.path()).is_err());
}

#[test]
fn a_full_megabyte_of_nonsense_is_answered_in_one_line() {
    let dir = inputs();
    let text = format!("{MINIMAL}[field]\ndistance = \"{}\"", "é\\n".repeat(200_000));
    let error = Job::from_toml(&text, "long.toml", dir.path()).unwrap_err().to_string();
    assert!((text.len() as u64) < MAX_JOB_BYTES && error.chars().count() < 300 && !error.contains('\n'), "{error}");
}

/// Inputs for the jobs below, so that a spoilt one is read to its end.
static INPUTS: LazyLock<tempfile::TempDir> = LazyLock::new(inputs);

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    #[test]
    fn no_text_panics(text in "\\PC*") {
        let _ = Job::from_toml(&text, "p.toml", "");
    }

    /// Splices TOML-like pieces into good jobs: far more of these reach the checks behind the parser.
    #[test]
    fn no_spoilt_job_panics(
        shape in 0usize..12,
        cut in any::<prop::sample::Index>(),
        length in 0usize..40,
        piece in prop::sample::select(vec![
            "", "[", "]", "[[object]]", "=", "\n", "\"", "-", "nan", "inf", "1e999", "0x7fffffffffffffffffff", "true",
            "{", "}", "1979-05-27", "[1,2,3]", "\u{0}", "é", ".", "'", "#", "[target]\nkind = \"bssrdf\"", "\\",
        ]),
    ) {
        let text = &shapes()[shape];
        let boundary = |at: usize| (0..=at.min(text.len())).rev().find(|&at| text.is_char_boundary(at)).unwrap();
        let start = boundary(cut.index(text.len()));
        let end = boundary(start + length);
        let spoilt = format!("{}{piece}{}", &text[..start], &text[end..]);
        if let Err(error) = Job::from_toml(&spoilt, "p.toml", INPUTS.path()) {
            let line = error.to_string();
            prop_assert!(line.starts_with("p.toml:") && line.contains("found") && !line.contains('\n'), "{}", line);
        }
    }
}
