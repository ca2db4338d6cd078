//! Help, flags, completions, the manual: made from one definition, so that what is held here is that nothing is lost.

use crate::support::{keys, run};

/// Every command with the flags that scripts may use.
const COMMANDS: [(&str, &[&str]); 18] = [
    ("init", &["MESH", "--printer", "--height-mm", "--look", "--materials"]),
    ("slice", &["--output", "--overwrite", "--slices <A..B>", "--dry-run", "--quick", "--json", "--height-mm"]),
    (
        "predict",
        &["--materials", "--stack", "--core", "--model", "--light", "--photons", "--seed", "--csv", "--plot", "--json"],
    ),
    (
        "match",
        &[
            "--materials",
            "--target",
            "--albedo",
            "--mean-free-path-mm",
            "--max-thickness-mm",
            "--units",
            "--depth",
            "--dc-weight",
            "--min-depth",
            "--core",
            "--plot",
            "--json",
        ],
    ),
    ("gamut", &["--materials", "--core", "--output", "--csv", "--target", "--job", "--model", "--min-depth", "--json"]),
    ("material", &["list", "show", "simulate"]),
    ("material list", &["--json"]),
    ("material show", &["--plot", "--json", "FILE|SET"]),
    ("material simulate", &["--output", "--photons", "--seed", "--resin", "--thickness-mm", "--overwrite"]),
    (
        "factor",
        &[
            "DATASET",
            "--luminance",
            "--roughness",
            "--rounds",
            "--compare",
            "--clusters",
            "--max-rms",
            "--seed",
            "--dc-weight",
            "--output",
            "--overwrite",
            "--json",
        ],
    ),
    (
        "compare",
        &["OUT", "--map", "--dataset", "--materials", "--photons", "--seed", "--output", "--overwrite", "--json"],
    ),
    (
        "look",
        &[
            "OUT",
            "--job",
            "--spots",
            "--at",
            "--photons",
            "--seed",
            "--output",
            "--mitsuba",
            "--size",
            "--samples",
            "--time",
            "--view",
            "--overwrite",
            "--json",
        ],
    ),
    ("preview", &["OUT"]),
    ("verify", &["OUT", "--json"]),
    ("printers", &["--json"]),
    ("schema", &[]),
    ("completions", &["bash", "zsh", "fish"]),
    ("man", &["COMMAND"]),
];

#[test]
fn every_flag_is_in_the_help_of_its_command() {
    for (command, flags) in COMMANDS {
        let ran = run(command.split(' ').chain(["--help"])).exits(0);
        assert_eq!(ran.stderr, "", "{command}");
        for flag in flags {
            assert!(ran.stdout.contains(flag), "{command} --help lacks {flag}:\n{}", ran.stdout);
        }
    }
}

#[test]
fn lengths_in_the_help_have_their_unit() {
    for (command, _) in COMMANDS {
        let help = run(command.split(' ').chain(["--help"])).stdout;
        for (at, line) in help.lines().enumerate().filter(|(_, line)| line.contains("<MM>") || line.contains("-mm <")) {
            // The text stands beside the flag or below it.
            let text: String = line.split('>').skip(1).chain(help.lines().nth(at + 1)).collect();
            assert!(text.contains("mm"), "{command}: {line}\n{text}");
        }
    }
}

#[test]
fn the_overview_names_every_command() {
    let help = run(["--help"]).exits(0).stdout;
    for (command, _) in COMMANDS {
        assert!(help.contains(command.split(' ').next().unwrap()), "{command}");
    }
    assert!(run(["--version"]).exits(0).stdout.starts_with("lumislice "));
}

#[test]
fn bad_usage_is_2_with_nothing_on_stdout() {
    let cases: [&[&str]; 8] = [
        &[],
        &["slize"],
        &["slice"],
        &["slice", "job.toml", "--outputt", "x"],
        &["slice", "job.toml", "--slices", "5..5"],
        &["verify"],
        &["completions", "cmd.exe"],
        &["predict", "--materials", "synthetic"],
    ];
    for args in cases {
        let ran = run(args).exits(2);
        assert_eq!(ran.stdout, "", "{args:?}");
        assert!(ran.stderr.contains("Usage") || ran.stderr.starts_with("error: "), "{args:?}: {}", ran.stderr);
    }
    assert!(run(["slice", "job.toml", "--overwritte"]).stderr.contains("'--overwrite'"), "a slip is answered");
}

#[test]
fn completions_and_manual_know_every_command() {
    for shell in ["bash", "zsh", "fish", "powershell", "elvish"] {
        let script = run(["completions", shell]).exits(0).stdout;
        assert!(COMMANDS.iter().all(|(command, _)| script.contains(command.split(' ').next().unwrap())), "{shell}");
        assert!(script.contains("max-thickness-mm"), "{shell}");
    }
    let page = run(["man"]).exits(0).stdout;
    assert!(page.contains(".TH lumislice 1"), "{page}");
    assert!(page.contains("predict") && page.contains("verify"));
    let page = run(["man", "material", "simulate"]).exits(0).stdout;
    assert!(page.contains("thickness\\-mm"), "{page}");
    run(["man", "predikt"]).refuses(2, &["predikt", "predict"]);
}

#[test]
fn printers_are_listed() {
    let ran = run(["printers"]).exits(0);
    assert!(ran.stdout.contains("j750-27um") && ran.stderr.starts_with("note: "));
    let list = run(["printers", "--json"]).exits(0).json();
    let j750 = list.as_array().unwrap().iter().find(|printer| printer["name"] == "j750-27um").unwrap();
    assert_eq!(keys(j750), ["name", "pitch_mm", "dpi", "tray_mm", "max_colors", "min_slices", "source"]);
    assert_eq!((j750["dpi"][1].as_f64(), j750["max_colors"].as_u64()), (Some(300.0), Some(6)));
}
