//! Figure 5: stackings predicted from one slab of each resin, against photons through the stack itself.

use lumislice::{
    optics::{ChannelPrediction, PredictedRing},
    plot::{Axis, BLACK, BLUE, Figure, Panel, Series, Shape, VERMILION},
};

use super::{
    Options, Outcome,
    models::{Layers, Predicted, Resins, rms},
};

/// The figure's three, and what the paper says of them.
const STACKS: [(&str, Layers); 3] = [
    ("white 2 mm on white 2 mm", &[("white", 2.0), ("white", 2.0)]),
    ("white 4 mm on black 0.25 mm", &[("white", 4.0), ("black", 0.25)]),
    ("black 0.5, support 6, white 2 mm", &[("black", 0.5), ("support", 6.0), ("white", 2.0)]),
];

pub fn run(options: &Options) -> Outcome {
    let resins = Resins::synthetic()?;
    let mut figure = Figure::new("Stackings predicted from one slab of each resin")
        .columns(3)
        .panel_size(400.0, 300.0)
        .caption(format!("{} photons a stacking. {}", options.photons, resins.set.provenance));
    println!(
        "| stacking | model | R | off by | R̂ rms | T | off by | T̂ rms |\n| --- | --- | --- | --- | --- | --- | --- \
            | --- |"
    );
    let predicted = STACKS.map(|(name, stack)| Ok((name, resins.predict(stack, options.photons)?)));
    let predicted = predicted.into_iter().collect::<Result<Vec<_>, Box<dyn std::error::Error>>>()?;
    for (name, found) in &predicted {
        row(name, found);
    }
    for (name, found) in &predicted {
        figure.panels.push(panel(found, |ring| ring.reflection_per_mm2, "R(r) [mm⁻²]").title(*name));
    }
    for (_, found) in &predicted {
        figure.panels.push(panel(found, |ring| ring.transmission_per_mm2, "T(r) [mm⁻²]"));
    }
    for file in ["stacking.png", "stacking.svg"] {
        figure.write(&options.folder.join(file))?;
    }
    Ok(())
}

fn row(name: &str, found: &Predicted) {
    let truth = &found.photons.light[0];
    let tell = |model: &str, light: &ChannelPrediction| {
        let of = |f: fn(&ChannelPrediction) -> &Vec<f64>| {
            let (found, truth) = (f(light), f(truth));
            let off = 100.0 * (found[0] / truth[0] - 1.0);
            format!("{:.4e} | {off:+.3}% | {:.1e}", found[0], rms(found, truth))
        };
        println!(
            "| {name} | {model} | {} | {} |",
            of(|light| &light.reflection_hankel),
            of(|light| &light.transmission_hankel)
        );
    };
    tell("Kubelka–Munk", &found.km.light[0]);
    tell("transport", &found.transport.light[0]);
    tell("photons", truth);
}

fn panel(found: &Predicted, value: fn(&PredictedRing) -> f64, label: &str) -> Panel {
    let points = |light: &ChannelPrediction| -> Vec<[f64; 2]> {
        light.rings().iter().map(|ring| [ring.r_mm, value(ring)]).collect()
    };
    let (km, transport, photons) =
        (points(&found.km.light[0]), points(&found.transport.light[0]), points(&found.photons.light[0]));
    let top = transport.iter().filter(|point| point[0] > 0.05).map(|point| point[1]).fold(0.0, f64::max);
    // What is left of the photons' rings, some thirty of them.
    let shown = photons.iter().filter(|point| point[1] > 0.0).step_by(7).copied();
    Panel::new(Axis::linear("r [mm]").range(0.0, 15.0), Axis::log(label).range(1e-6 * top, 3.0 * top))
        .with(Series::points("photons", shown).shape(Shape::Ring).size(5.0).colour(BLACK))
        .with(Series::line("Kubelka–Munk", km).dashed().colour(BLUE))
        .with(Series::line("transport", transport).colour(VERMILION))
}
