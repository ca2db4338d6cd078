//! The documentation: its commands are commands of this program, its cheap ones do what the page says, and its links
//! lead somewhere. `scripts/check-docs` runs all of them.

use std::{
    fs,
    path::{Path, PathBuf},
};

use crate::support::{Bench, Ran, lumislice, run};

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// Every page that users read.
fn pages() -> Vec<PathBuf> {
    let docs = fs::read_dir(root().join("docs")).unwrap().map(|entry| entry.unwrap().path());
    let mut pages: Vec<_> = docs.filter(|path| path.extension().is_some_and(|end| end == "md")).collect();
    pages.extend(["README.md", "COMPARE.md", "CONTRIBUTING.md", "samples/README.md"].map(|name| root().join(name)));
    pages.sort();
    pages
}

/// The words of a line of shell: quotes are taken off; a comment, and where output goes, are left out.
fn words(line: &str) -> Vec<String> {
    let (mut words, mut word, mut quote) = (Vec::new(), None::<String>, None);
    for sign in line.chars() {
        match (quote, sign) {
            (Some(open), _) if open == sign => quote = None,
            (None, '"' | '\'') => {
                quote = Some(sign);
                word.get_or_insert_default();
            }
            (None, '#' | '>' | '|') if word.is_none() => break,
            (None, ' ') => words.extend(word.take()),
            _ => word.get_or_insert_default().push(sign),
        }
    }
    words.extend(word);
    words
}

/// The commands of a page's shell blocks that run this program, as what follows its name.
fn commands(page: &Path) -> Vec<Vec<String>> {
    let text = fs::read_to_string(page).unwrap();
    let (mut within, mut shell, mut found) = (false, false, Vec::new());
    for line in text.lines().map(str::trim) {
        if let Some(language) = line.strip_prefix("```") {
            within = !within;
            shell = within && ["", "sh"].contains(&language);
        } else if shell {
            let start = ["lumislice ", "cargo run --release -- "].iter().find_map(|start| line.strip_prefix(start));
            found.extend(start.map(words));
        }
    }
    found
}

#[test]
fn every_command_of_the_documentation_is_understood() {
    let mut number = 0;
    for page in pages() {
        for command in commands(&page) {
            // Help comes before any work, and after names and values of all flags were read.
            let help = command.iter().map(String::as_str).chain(["--help"]);
            let ran = Ran::from(lumislice().args(help).output().unwrap());
            assert_eq!(ran.code, Some(0), "{}: lumislice {command:?}\n{}", page.display(), ran.stderr);
            number += 1;
        }
    }
    assert!(number > 40, "{number}: are the blocks still ```sh?");
    run(["slice", "--quicker", "figure.glb", "--help"]).exits(2);
    run(["match", "--albedo", "white", "--help"]).exits(2);
}

#[test]
fn what_the_pages_do_in_a_moment_is_done() {
    let bench = Bench::new();
    for name in ["rabbit.glb", "cord.obj", "cord.toml"] {
        bench.write(format!("samples/{name}"), &fs::read(root().join("samples").join(name)).unwrap());
    }
    bench.write("figure.glb", &fs::read(root().join("samples/rabbit.glb")).unwrap());
    let page = |name: &str| root().join(name);
    let mut said = Vec::new();
    let mut ran = |name: &str, moment: fn(&[&str]) -> bool| {
        let all = commands(&page(name));
        let chosen: Vec<_> = all.iter().filter(|c| moment(&c.iter().map(String::as_str).collect::<Vec<_>>())).collect();
        assert!(!chosen.is_empty(), "{name}: no command of the kind");
        said.extend(chosen.into_iter().map(|command| bench.run(command).exits(0)));
    };
    ran("docs/print-check.md", |words| words.contains(&"--dry-run"));
    ran("docs/tutorial-print.md", |words| words[0] == "init");
    ran("docs/tutorial-resin.md", |words| words[0] == "predict" && words.contains(&"synthetic"));
    // What is quoted is what is said: warnings with their lines joined, and the job that init writes.
    let joined = |name: &str| fs::read_to_string(page(name)).unwrap().split_whitespace().collect::<Vec<_>>().join(" ");
    let quoted = joined("docs/print-check.md");
    let warnings: Vec<_> = said[0].stderr.lines().filter(|line| line.starts_with("warning: ")).collect();
    assert_eq!(warnings.len(), 5, "{warnings:?}");
    for warning in &warnings[2..] {
        assert!(quoted.contains(&warning.split_whitespace().collect::<Vec<_>>().join(" ")), "{warning}");
    }
    let tutorial = joined("docs/tutorial-print.md");
    let job = fs::read_to_string(bench.path("figure.toml")).unwrap();
    let lines = job.lines().filter(|line| line.contains(" = "));
    for line in lines {
        assert!(
            tutorial.contains(&line.split_whitespace().collect::<Vec<_>>().join(" ")),
            "docs/tutorial-print.md: {line}"
        );
    }
}

#[test]
fn links_lead_somewhere_and_pictures_are_small() {
    let mut bytes = 0;
    for page in pages() {
        let text = fs::read_to_string(&page).unwrap();
        for link in text.split("](").skip(1).filter_map(|rest| rest.split(')').next()) {
            let (file, anchor) = link.split_once('#').unwrap_or((link, ""));
            if file.contains("://") || link.contains(char::is_whitespace) {
                continue;
            }
            let target = if file.is_empty() { page.clone() } else { page.parent().unwrap().join(file) };
            assert!(target.exists(), "{}: {link}", page.display());
            if !anchor.is_empty() && target.extension().is_some_and(|end| end == "md") {
                let slug = |heading: &str| -> String {
                    let kept = heading.trim_start_matches('#').trim().to_lowercase();
                    let kept = kept.chars().filter(|c| c.is_alphanumeric() || [' ', '-', '_'].contains(c));
                    kept.map(|c| if c == ' ' { '-' } else { c }).collect()
                };
                let there = fs::read_to_string(&target).unwrap();
                let mut headings = there.lines().filter(|line| line.starts_with('#'));
                assert!(headings.any(|line| slug(line) == anchor), "{}: {link}", page.display());
            }
        }
    }
    for picture in fs::read_dir(root().join("docs/pictures")).unwrap() {
        let picture = picture.unwrap();
        let size = picture.metadata().unwrap().len();
        assert!(size <= 150_000, "{}: {size} bytes", picture.path().display());
        bytes += size;
    }
    assert!(bytes <= 1_000_000, "{bytes} bytes of pictures");
}
