//! Thin layers: how far Kubelka–Munk and transport are from photons, by thickness.

use lumislice::plot::{Axis, BLUE, Figure, GREY, Panel, Series, VERMILION};

use super::{Options, Outcome, models::Resins};

const THICKNESS_MM: [f64; 9] = [0.02, 0.04, 0.078, 0.156, 0.312, 0.625, 1.25, 2.5, 5.0];

/// Totals that photons know no better than this say nothing.
const TELLING: f64 = 0.02;

/// An error is not known better than the photons are: three of these is what noise may show.
fn standard_error(share: f64, photons: u64) -> f64 {
    (share * (1.0 - share) / photons as f64).sqrt()
}

pub fn run(options: &Options) -> Outcome {
    let resins = Resins::synthetic()?;
    let mut figure = Figure::new("Totals of thin layers against photons")
        .columns(3)
        .panel_size(400.0, 300.0)
        .caption(format!("{} photons a layer. {}", options.photons, resins.set.provenance));
    println!(
        "| layer | R | by KM | by transport | T | by KM | by transport |\n| --- | --- | --- | --- | --- | --- | --- |"
    );
    let mut panels: [Vec<Panel>; 2] = [Vec::new(), Vec::new()];
    for name in ["white", "support", "black"] {
        let mut curves: [[Vec<[f64; 2]>; 3]; 2] = Default::default();
        for mm in THICKNESS_MM {
            let found = resins.predict(&[(name, mm)], options.photons)?;
            let mut cells = Vec::new();
            for (side, curves) in curves.iter_mut().enumerate() {
                let total = |prediction: &lumislice::optics::Prediction| match side {
                    0 => prediction.light[0].reflection_hankel[0],
                    _ => prediction.light[0].transmission_hankel[0],
                };
                let truth = total(&found.photons);
                let noise = standard_error(truth, options.photons) / truth;
                let off = [&found.km, &found.transport].map(|model| total(model) / truth - 1.0);
                if !(truth > 0.0 && noise < TELLING) {
                    cells.extend(["too little to tell".to_owned(), "–".to_owned(), "–".to_owned()]);
                    continue;
                }
                cells.push(format!("{truth:.5} ± {:.5}", noise * truth));
                cells.extend(off.map(|off| format!("{:+.2}%", 100.0 * off)));
                for (curve, value) in curves.iter_mut().zip([off[0].abs(), off[1].abs(), 3.0 * noise]) {
                    curve.push([1e3 * mm, 100.0 * value]);
                }
            }
            println!("| {name} {:.0} µm | {} |", 1e3 * mm, cells.join(" | "));
        }
        for (side, [km, transport, noise]) in curves.into_iter().enumerate() {
            let label = if side == 0 { "error of R [%]" } else { "error of T [%]" };
            let panel = Panel::new(Axis::log("thickness [µm]"), Axis::log(label).range(1e-3, 100.0))
                .title(if side == 0 { name } else { "" })
                .with(Series::line("3 σ of the photons", noise).dotted().colour(GREY))
                .with(Series::line("Kubelka–Munk", km.iter().copied()).dashed().colour(BLUE))
                .with(Series::points("", km).colour(BLUE))
                .with(Series::line("transport", transport.iter().copied()).colour(VERMILION))
                .with(Series::points("", transport).colour(VERMILION));
            panels[side].push(panel);
        }
    }
    figure.panels.extend(panels.into_iter().flatten());
    for file in ["thin.png", "thin.svg"] {
        figure.write(&options.folder.join(file))?;
    }
    Ok(())
}
