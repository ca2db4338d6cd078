//! `lumislice slice`: the main job.

use std::{ops::Range, path::PathBuf};

use clap::Args;
use lumislice::{
    job::{
        self, Estimate, Finished, Job, Manifest, Prepared, REPORT, RoundRecord, RunError, RunOptions,
        file::OutputFormat,
        look::{self, LookError, LookOptions, look_at, scene_for},
        manifest::MaterialRecord,
    },
    output::{Existing, OutputFolder},
    words::{counted, duration, signed, voxels},
};
use serde_json::{Value, json};

use super::{
    Answer, Result, WIDTH,
    cache::CacheArgs,
    document,
    failure::{Failure, refusal, refuse},
    materials::{Corrected, prepared},
    note, print_toml, print_words,
    progress::Bars,
    start::{MeshArgs, default_folder, is_mesh, job_for},
    table::wrapped,
    warn_of,
};

/// Slice a job into printer-ready files.
#[derive(Debug, Args)]
pub struct SliceArgs {
    /// The job file, TOML; or a mesh, for which a job is made up and printed.
    #[arg(value_name = "JOB.toml|MESH")]
    job: PathBuf,
    #[command(flatten)]
    mesh: MeshArgs,
    /// Folder to write; default ./<job name>-out, with --quick ./<job name>-look.
    #[arg(short, long, value_name = "OUT", help_heading = "Output")]
    output: Option<PathBuf>,
    /// Replace the files of an earlier job in OUT; only those its manifest lists.
    #[arg(long, help_heading = "Output")]
    overwrite: bool,
    /// Go on with this job in OUT where it was interrupted, keeping every file that is whole.
    #[arg(long, conflicts_with = "overwrite", help_heading = "Output")]
    resume: bool,
    /// Write slices A to B−1 only; the same bytes as in a whole run.
    #[arg(long, value_name = "A..B", value_parser = parse_range, help_heading = "Work")]
    slices: Option<Range<u32>>,
    /// Take what rounds of correction found from this folder, where a run of the same job left it; else they are found
    /// anew, to the same bytes. Without this flag they are looked for in OUT.
    #[arg(long, value_name = "FOLDER", help_heading = "Work")]
    rounds_from: Option<PathBuf>,
    /// Check the job and print what it would take, writing nothing.
    #[arg(long, conflicts_with = "resume", help_heading = "Work")]
    dry_run: bool,
    /// Only look at it, coarsely and soon: pictures and albedos of a print of larger voxels, no slices.
    #[arg(long, conflicts_with_all = ["resume", "slices", "rounds_from", "dry_run"], help_heading = "Work")]
    quick: bool,
    #[command(flatten)]
    cache: CacheArgs,
    /// Print one JSON document instead of words.
    #[arg(long, help_heading = "Output")]
    json: bool,
}

fn parse_range(text: &str) -> Result<Range<u32>, String> {
    let fault = || format!("found `{text}`, expected A..B with whole numbers A < B");
    let (start, end) = text.split_once("..").ok_or_else(fault)?;
    let number = |text: &str| text.trim().parse::<u32>().map_err(|_| fault());
    let range = number(start)?..number(end)?;
    if range.is_empty() { Err(fault()) } else { Ok(range) }
}

/// Runs the command.
pub fn run(args: &SliceArgs) -> Result<Answer> {
    let (mut job, made_up) = match (is_mesh(&args.job), args.mesh.given()) {
        (true, _) => {
            job_for(&args.job, &args.job.with_extension("toml"), &args.mesh).map(|(job, text)| (job, Some(text)))?
        }
        (false, Some(flag)) => refuse!("{flag}: found beside {}, expected a mesh: a job says it", args.job.display()),
        (false, None) => (Job::load(&args.job).map_err(RunError::from)?, None),
    };
    let beside = args.job.with_extension("toml");
    if made_up.is_some() && beside.is_file() {
        let (beside, mesh) = (beside.display(), args.job.display());
        note(&format!("{beside} lies beside {mesh} and is not used; `lumislice slice {beside}` slices that job"));
    }
    if let Some(text) = made_up.as_ref().filter(|_| !args.json) {
        print_toml(text)?;
    }
    if args.quick {
        return quick(args, job, made_up.as_deref());
    }
    let folder = args.output.clone().unwrap_or_else(|| default_folder(&job));
    let existing = if args.resume { Existing::Resume } else { Existing::overwrite(args.overwrite) };
    if !args.dry_run {
        OutputFolder::check(&folder, &job::OWNER, existing).map_err(RunError::from)?;
        if args.resume {
            job::refuse_another(&job, &folder)?;
        }
    }
    job.must_fit = !args.dry_run;
    let bars = Bars::new(args.json).followed_by(ahead(&job, args.dry_run));
    let found = args.rounds_from.as_ref().unwrap_or(&folder);
    let corrected = if args.dry_run { Corrected::Draft } else { Corrected::As(std::slice::from_ref(found)) };
    let prepared = prepared(job, &args.cache, corrected, &bars);
    if args.dry_run {
        let result = prepared.and_then(|prepared| Ok((prepared.estimate(&bars)?, prepared)));
        bars.finish();
        let (estimate, prepared) = result.map_err(Failure::before_writing)?;
        let slices = prepared.checked_slices(args.slices.clone()).map_err(refused_slices)?;
        let part = args.slices.is_some().then_some(slices);
        return report_estimate(&prepared, &estimate, part, args.json, made_up);
    }
    bars.finish();
    let prepared = prepared.map_err(Failure::before_writing)?;
    let options = RunOptions { existing, slices: args.slices.clone() };
    let result = job::run(&prepared, &folder, &options, &bars);
    bars.finish();
    let Finished { manifest, kept } = result.map_err(refused_slices)?;
    if args.resume {
        let slices = manifest.slices[1] - manifest.slices[0];
        note(&format!("{kept} of {slices} slices were there and whole"));
    }
    warn_of(&manifest.warnings, args.json);
    let found = json!({
        "output": folder.to_string_lossy(),
        "lattice": manifest.lattice,
        "slices": manifest.slices,
        "material_set": manifest.material_set,
        "materials": manifest.materials,
        "warnings": manifest.warnings,
        "rounds": manifest.rounds,
        "verdict": manifest.verdict(),
        "files": whole_series(&manifest),
    });
    if document(args.json, &with_job(found, made_up))? {
        return Ok(Answer::Yes);
    }
    print_words(&summary(&manifest, &folder.display().to_string()))?;
    Ok(Answer::Yes)
}

/// Folders of images that are numbered by slices.
const SERIES: [&str; 3] = ["slices/", "masks/", "bmp/"];

/// What was written, in the folder: files, and of each series of images its folder, which ends in `/`.
fn whole_series(manifest: &Manifest) -> Vec<&str> {
    let mut written: Vec<&str> = Vec::new();
    for file in &manifest.files {
        let folder = file.path.rfind('/').map_or("", |end| &file.path[..=end]);
        let shown = if SERIES.iter().any(|series| folder.starts_with(series)) { folder } else { &file.path };
        if !written.contains(&shown) {
            written.push(shown);
        }
    }
    written
}

/// A failure that names the flag where it is about that.
fn refused_slices(error: RunError) -> Failure {
    match error {
        RunError::Slices { .. } => refusal!("--{error}"),
        error => error.into(),
    }
}

/// What a job comes to after its stackings, by stages.
fn ahead(job: &Job, dry_run: bool) -> Vec<(&'static str, String)> {
    if dry_run {
        return vec![("estimate", "an estimate of the rest".to_owned())];
    }
    let rounds = (job.rounds() > 0 && job.searches())
        .then(|| ("round", format!("up to {} of correction", counted(job.rounds() as usize, "round"))));
    let pictures = job.wants(OutputFormat::Preview).then(|| ("pictures", "pictures".to_owned()));
    rounds.into_iter().chain([("slices", "slices".to_owned())]).chain(pictures).collect()
}

/// A document with the job that was made up, if one was.
fn with_job(mut document: Value, made_up: Option<String>) -> Value {
    if let Some(text) = made_up {
        document["job"] = text.into();
    }
    document
}

/// Looks at a coarse print of the job.
fn quick(args: &SliceArgs, job: Job, made_up: Option<&str>) -> Result<Answer> {
    let folder = args.output.clone().unwrap_or_else(|| PathBuf::from(format!("{}-look", job.name)));
    let existing = Existing::overwrite(args.overwrite);
    OutputFolder::check(&folder, &look::OWNER, existing).map_err(RunError::from)?;
    let bars = Bars::new(args.json);
    let found =
        prepared(job.quick(), &args.cache, Corrected::Draft, &bars).map_err(LookError::from).and_then(|prepared| {
            let scene = scene_for(&prepared, None, &bars)?;
            let look = look_at(&prepared, &scene, &LookOptions::quick(), &bars)?;
            look.write(&folder, existing, &prepared.files())?;
            Ok((look, prepared.warnings))
        });
    bars.finish();
    let (look, warnings) = found.map_err(Failure::before_writing)?;
    warn_of(&warnings, args.json);
    warn_of(&look.warnings, args.json);
    let mut found = serde_json::to_value(&look).map_err(|error| refusal!("{error}"))?;
    found["output"] = folder.to_string_lossy().into();
    if document(args.json, &with_job(found, made_up.map(str::to_owned)))? {
        return Ok(Answer::Yes);
    }
    print_words(&super::look::summary(&look))?;
    print_words(&format!(
        "\npictures of a coarse print: {}\nnothing was corrected yet: without --quick, rounds of correction bring the \
         print nearer to what is asked; this one is a coarse first look at it\n",
        folder.display()
    ))?;
    Ok(Answer::Yes)
}

fn summary(manifest: &Manifest, folder: &str) -> String {
    let [x, y, z] = manifest.lattice.dims;
    let slices = manifest.slices[1] - manifest.slices[0];
    let mut text = format!("{}: {slices} of {z} slices of {x} × {y} voxels in {folder}\n", manifest.name);
    text += &material_table(&manifest.materials, "");
    text += &rounds(&manifest.rounds);
    if manifest.files.iter().any(|file| file.path == REPORT) {
        for words in manifest.verdict() {
            text += &wrapped(&format!("  - {words}\n"), WIDTH);
        }
        text += &format!("  pictures and stackings: {folder}/{REPORT}\n");
    }
    text
}

/// A line per round of correction.
fn rounds(rounds: &[RoundRecord]) -> String {
    let line = |(number, round): (usize, &RoundRecord)| {
        let fits = round.fit.iter();
        let fits: Vec<_> =
            fits.map(|fit| format!("{} ({:.1}% rms)", signed(fit.bias, 3), 100.0 * fit.relative_rms)).collect();
        let ended = round.ended.map(|ended| format!("  {}\n", ended.words())).unwrap_or_default();
        format!("  round {number}: printed less asked {} over {} points\n{ended}", fits.join(" "), round.points)
    };
    (1..).zip(rounds).map(line).collect()
}

/// A line per resin that occurs.
fn material_table(materials: &[MaterialRecord], about: &str) -> String {
    let width = materials.iter().map(|material| material.name.len()).max().unwrap_or(0);
    let used = || materials.iter().filter(|material| material.voxels > 0);
    let lines: String = used()
        .map(|material| {
            let note = if material.rgba[3] == 0 { "  (background: the printer fills it)" } else { "" };
            let cost = material.cost.map(|cost| format!("  {about}{cost:>8.2}")).unwrap_or_default();
            format!(
                "  {:width$}  {about}{:>11.1} mm³  {about}{:>8.2} g{cost}{note}\n",
                material.name, material.volume_mm3, material.mass_g
            )
        })
        .collect();
    let mass: f64 = used().map(|material| material.mass_g).sum();
    let priced = used().filter_map(|material| material.cost);
    let cost = match used().all(|material| material.cost.is_some()) {
        true => format!(", {about}{:.2} by the prices of the material file", priced.sum::<f64>()),
        false => String::new(),
    };
    if used().count() > 1 { format!("{lines}  together {about}{mass:.2} g{cost}\n") } else { lines }
}

/// How long it will take, about.
fn time(prepared: &Prepared, estimate: &Estimate) -> String {
    let job = &prepared.job;
    let cached = job.search_cache.is_some();
    let seconds = &estimate.seconds;
    let parts = [("rounds of correction", seconds.rounds), ("slices", seconds.slices), ("pictures", seconds.look)];
    let searched = (!cached).then_some(("stackings", seconds.preparing));
    let parts = searched.into_iter().chain(parts).filter(|part| part.1 > 0.0);
    let parts: Vec<_> = parts.map(|(name, seconds)| format!("{name} {}", duration(seconds))).collect();
    let found =
        if cached { format!("; stackings took {} and are kept", duration(seconds.preparing)) } else { String::new() };
    let meshed = job.wants(OutputFormat::Stl) || job.wants(OutputFormat::ThreeMf);
    let meshes = if meshed { "; meshes come on top" } else { "" };
    format!(
        "time: about {} on this machine, as busy as it is now: {}{found}{meshes}",
        duration(seconds.ahead(cached)),
        parts.join(", ")
    )
}

fn report_estimate(
    prepared: &Prepared,
    estimate: &Estimate,
    part: Option<Range<u32>>,
    json: bool,
    made_up: Option<String>,
) -> Result<Answer> {
    let answer = if estimate.misfits.is_empty() { Answer::Yes } else { Answer::No };
    warn_of(&estimate.warnings, json);
    let mut found = serde_json::to_value(estimate).map_err(|error| refusal!("{error}"))?;
    if let Some(part) = &part {
        found["slices"] = json!([part.start, part.end]);
    }
    if document(json, &with_job(found, made_up))? {
        return Ok(answer);
    }
    let [x, y, z] = estimate.dims;
    let size = estimate.size_mm;
    let mut text = format!(
        "{}: {:.2} × {:.2} × {:.2} mm, {x} × {y} × {z} = {}\nmemory: about {} MiB\n",
        prepared.job.name,
        size[0],
        size[1],
        size[2],
        voxels(estimate.voxels),
        estimate.memory_bytes >> 20,
    );
    if let Some(Range { start, end }) = part {
        text += &format!("slices: {start}..{end} of {z}; what follows is for all of them\n");
    }
    text += &format!("{}\n", wrapped(&time(prepared, estimate), WIDTH));
    for object in estimate.objects.iter().filter(|_| estimate.objects.len() > 1) {
        let ([x, y, z], [w, d, h]) = (object.position_mm, object.size_mm);
        text += &format!("  {}: {w:.2} × {d:.2} × {h:.2} mm at ({x:.2}, {y:.2}, {z:.2}) mm\n", object.mesh);
    }
    text += &material_table(&estimate.materials, "about ");
    for misfit in &estimate.misfits {
        text += &format!("does not fit: {misfit}\n");
    }
    print_words(&text)?;
    Ok(answer)
}
