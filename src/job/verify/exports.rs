//! Files that hold the whole job: each is what its name says, and those that the job asks for are there.

use super::{
    Check, Finding, Verification, VerifyError, bitmaps, files::Sound, gcvf, image::read_all, volumes, volumes::Kind,
};
use crate::{
    container::{mapping_text, nrrd},
    job::{
        file::OutputFormat,
        manifest::MAPPING,
        run::{export_path, fractions_path},
    },
};

/// Longest table of colours, bytes.
const MAX_MAPPING: u64 = 1 << 16;

const NOT_LISTED: &str = "not listed, expected a file that the job asks for";

pub(super) fn check(check: &Check<'_>, sound: &Sound<'_>, result: &mut Verification) -> Result<(), VerifyError> {
    let name = &check.manifest.name;
    let listed = |path: &str| check.manifest.files.iter().any(|file| file.path == path);
    let holders = || OutputFormat::ALL.iter().filter(|(_, format)| format.is_one_file());
    for (format_name, format) in holders() {
        let path = export_path(name, *format);
        if !listed(&path) {
            if check.wants(format_name) {
                result.findings.push(Finding::new(&path, NOT_LISTED));
            }
            continue;
        }
        result.findings.extend(match format {
            OutputFormat::Gcvf => gcvf::check(check, sound, &path)?,
            OutputFormat::Vti => volumes::check(check, sound, &path, Kind::Vti)?,
            OutputFormat::Nrrd => volumes::check(check, sound, &path, Kind::Nrrd(nrrd::Values::Ids))?,
            // Its digest is looked at; `scripts/check-exports` reads it with OpenVDB.
            _ => Vec::new(),
        });
    }
    let fractions = fractions_path(name);
    if listed(&fractions) {
        result.findings.extend(volumes::check(check, sound, &fractions, Kind::Nrrd(nrrd::Values::Fractions))?);
    } else if check.manifest.content().fractions && check.wants(OutputFormat::Nrrd.name()) {
        result.findings.push(Finding::new(&fractions, NOT_LISTED));
    }
    let known = |path: &str| path == fractions || holders().any(|(_, format)| export_path(name, *format) == path);
    for file in check.manifest.files.iter().filter(|file| file.path.starts_with("exports/") && !known(&file.path)) {
        result.findings.push(Finding::new(&file.path, "found a strange name, expected exports/JOB.FORMAT"));
    }
    bitmaps::check(check, sound, &mut result.findings)?;
    if sound.contains(MAPPING) {
        let expected = mapping_text(&check.manifest.content(), &check.manifest.counts());
        match check.open(MAPPING).and_then(|file| read_all(file, MAX_MAPPING)) {
            Ok(found) if found == expected.as_bytes() => {}
            Ok(_) => {
                result.findings.push(Finding::new(MAPPING, "found another text, expected what the manifest says"));
            }
            Err(problem) => result.findings.push(Finding::new(MAPPING, problem)),
        }
    }
    Ok(())
}
