//! `lumislice printers`: the presets a job may name.

use clap::Args;
use lumislice::{voxel::Printer, words::dimensions};
use serde_json::json;

use super::{
    Answer, Result, WIDTH, document, note, print,
    table::{table, wrapped},
};

/// List the printers a job may name as its preset.
#[derive(Debug, Args)]
pub struct PrintersArgs {
    /// Print one JSON document instead of a table.
    #[arg(long)]
    json: bool,
}

/// Runs the command.
pub fn run(args: &PrintersArgs) -> Result<Answer> {
    let presets = Printer::presets();
    if args.json {
        let record = |printer: &Printer| {
            json!({
                "name": printer.name,
                "pitch_mm": printer.pitch_mm.to_array(),
                "dpi": [printer.dpi().0.round(), printer.dpi().1.round()],
                "tray_mm": printer.tray_mm.map(|tray| tray.to_array()),
                "max_colors": printer.max_colors,
                "min_slices": printer.min_slices,
                "source": printer.source(),
            })
        };
        document(true, &presets.iter().map(record).collect::<Vec<_>>())?;
        return Ok(Answer::Yes);
    }
    note("from public data sheets and guides; no preset was checked on a machine");
    let limit = |limit: Option<usize>| limit.map_or_else(|| "–".to_owned(), |limit| limit.to_string());
    let row = |printer: &Printer| {
        let (x, y) = printer.dpi();
        let [px, py, pz] = (printer.pitch_mm * 1000.0).to_array();
        vec![
            printer.name.clone(),
            format!("{px:.2} × {py:.2} × {pz:.0} µm"),
            format!("{x:.0} × {y:.0}"),
            printer.tray_mm.map_or_else(|| "–".to_owned(), |tray| format!("{} mm", dimensions(tray.to_array()))),
            limit(printer.max_colors),
            limit(printer.min_slices),
        ]
    };
    let header = ["preset", "voxel", "dpi", "tray", "resins", "slices"];
    let mut text = table(&header, &presets.iter().map(row).collect::<Vec<_>>());
    text += "resins: at most; slices: at least. From:\n";
    let mut said: Vec<&str> = Vec::new();
    for source in presets.iter().filter_map(Printer::source) {
        if !said.contains(&source) {
            said.push(source);
            let of = |printer: &&Printer| printer.source() == Some(source);
            let names: Vec<_> = presets.iter().filter(of).map(|printer| printer.name.as_str()).collect();
            text += &format!("{}\n", wrapped(&format!("  {}: {source}", names.join(", ")), WIDTH));
        }
    }
    print(&text)?;
    Ok(Answer::Yes)
}
