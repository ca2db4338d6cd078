//! `lumislice predict`: what a stack of layers does to light.

use std::{
    collections::BTreeSet,
    path::{Path, PathBuf},
};

use clap::{Args, ValueEnum};
use lumislice::{
    optics::{ChannelPrediction, Light, Mixture, Model, Prediction, Stack, TransportOptions, predict},
    plot::Figure,
};
use serde_json::json;

use super::{
    Answer, Result, document,
    failure::{refusal, refuse},
    materials::Materials,
    output_file::OutputFile,
    plots::{Curve, Look, PlotFile, Side, channel_colours, profile_panel},
    print,
    progress::Bars,
    table::{number, table},
    warn,
};

/// Predict albedo, transmission and translucency of a stack of layers.
#[derive(Debug, Args)]
pub struct PredictArgs {
    /// Resins: a material file (TOML), or the name of a built-in set.
    #[arg(long, value_name = "FILE|SET", help_heading = "Stack")]
    materials: PathBuf,
    /// Layers from the observer down, each name:thickness in mm, as "white:2.0,support:1.0".
    #[arg(long, value_name = "LAYERS", help_heading = "Stack")]
    stack: String,
    /// Resin of the half-space below the stack; default: nothing lies there and no light returns.
    #[arg(long, value_name = "RESIN", help_heading = "Stack")]
    core: Option<String>,
    /// How to predict: transport (directions resolved, a fraction of a second; what matches and jobs go by),
    /// monte-carlo (photons, seconds) or km (Kubelka-Munk, the paper's, at once); the first two need volume
    /// coefficients, which are fitted to resins given by profiles.
    #[arg(long, value_name = "km|transport|monte-carlo", default_value = "transport", value_parser = parse_model)]
    #[arg(help_heading = "Light")]
    model: ModelArg,
    /// Light from all directions, or a pencil beam straight down (not with km).
    #[arg(long, value_enum, default_value_t = Source::Diffuse, help_heading = "Light")]
    light: Source,
    /// Root mean square error over spatial frequencies that transport aims at, 1e-3 to 3e-5: chooses the number of
    /// directions.
    #[arg(long, value_name = "RMS", default_value_t = 3e-4, value_parser = parse_accuracy, help_heading = "Light")]
    accuracy: f64,
    /// Photons per channel, at least 2 (monte-carlo only); default 2000000.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(2..), help_heading = "Light")]
    photons: Option<u64>,
    /// Seed of the random numbers (monte-carlo only); default 2010.
    #[arg(long, value_name = "N", help_heading = "Light")]
    seed: Option<u64>,
    /// Write the profiles to F: r_mm,reflection_per_mm2,transmission_per_mm2; with several channels one file each,
    /// F-CHANNEL.
    #[arg(long, value_name = "F", help_heading = "Output")]
    csv: Option<PathBuf>,
    /// Draw the profiles R(r) and T(r) on a logarithmic axis to F, a .png or .svg.
    #[arg(long, value_name = "F", help_heading = "Output")]
    plot: Option<PathBuf>,
    /// Print one JSON document instead of a table.
    #[arg(long, help_heading = "Output")]
    json: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum ModelArg {
    Km,
    Transport,
    MonteCarlo,
}

fn parse_accuracy(text: &str) -> Result<f64, String> {
    let valid = |accuracy: &f64| (3e-5..=1e-3).contains(accuracy);
    text.parse().ok().filter(valid).ok_or_else(|| "expected 3e-5 to 1e-3".to_owned())
}

fn parse_model(text: &str) -> Result<ModelArg, String> {
    ModelArg::from_str(text, false).map_err(|_| "expected km, transport or monte-carlo".to_owned())
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Source {
    /// A Lambertian point source, as in the paper's profiles.
    Diffuse,
    /// A pencil beam.
    Normal,
}

/// Runs the command.
pub fn run(args: &PredictArgs) -> Result<Answer> {
    args.check()?;
    let named: Stack<String> = args.stack.parse().map_err(|error| refusal!("--stack: {error}"))?;
    let named = named.over(args.core.clone());
    let mut materials = Materials::read(&args.materials)?;
    let file = &materials.file;
    let stack = file.mixed_stack(&named)?;
    let csv = args.open_csv(file.channels())?;
    let plot = args.plot.as_deref().map(PlotFile::open).transpose()?;
    let bars = Bars::new(args.json);
    let mut model = args.model();
    if model != Model::KubelkaMunk {
        let mixtures = stack.layers.iter().map(|layer| &layer.resin).chain(&stack.core);
        let resins: BTreeSet<_> = mixtures.flat_map(Mixture::parts).map(|part| part.0).collect();
        let names: Vec<_> = file.resin_names().map(str::to_owned).collect();
        let names: Vec<_> = resins.into_iter().map(|resin| names[resin.0].as_str()).collect();
        let refused = materials.fit(Some(&names), &bars)?;
        if let Some(reason) = refused.first() {
            if args.model == ModelArg::MonteCarlo || args.light == Source::Normal {
                refuse!("{}: {reason}", args.materials.display());
            }
            // Loading says what was refused, and why.
            warn("predicting by Kubelka-Munk instead");
            model = Model::KubelkaMunk;
        }
    }
    let prediction = match model {
        Model::KubelkaMunk => predict(&materials.load(&bars)?, &stack, &model, &bars),
        _ => materials.file.predict(&stack, &model, &bars),
    };
    bars.finish();
    let prediction = prediction?;
    for (file, light) in csv.into_iter().zip(&prediction.light) {
        file.finish(light.to_csv().as_bytes())?;
    }
    if let Some(plot) = plot {
        plot.finish(&args.figure(&named, &model, &prediction))?;
    }
    if document(args.json, &record(&prediction))? {
        return Ok(Answer::Yes);
    }
    let rows: Vec<Vec<String>> = prediction
        .channels
        .iter()
        .zip(&prediction.light)
        .map(|(channel, light)| {
            vec![
                channel.clone(),
                number(light.reflection_hankel.first().copied(), 4),
                number(light.transmission_hankel.first().copied(), 4),
                number(half_energy_radius_mm(light), 3),
                number(light.radius_of_energy_mm(0.9), 3),
            ]
        })
        .collect();
    let header = ["channel", "albedo", "transmission", "50% within mm", "90% within mm"];
    print(&(args.title(&named, &model) + "\n" + &table(&header, &rows)))?;
    Ok(Answer::Yes)
}

/// The document of a prediction.
fn record(prediction: &Prediction) -> serde_json::Value {
    let spectra =
        |of: fn(&ChannelPrediction) -> &Vec<f64>| -> Vec<&Vec<f64>> { prediction.light.iter().map(of).collect() };
    let (reflection, transmission) =
        (spectra(|light| &light.reflection_hankel), spectra(|light| &light.transmission_hankel));
    let first = |spectra: &[&Vec<f64>]| -> Vec<Option<f64>> { spectra.iter().map(|s| s.first().copied()).collect() };
    json!({
        "channels": prediction.channels,
        "reflection": first(&reflection),
        "transmission": first(&transmission),
        "k_rad_per_mm": prediction.grid.as_slice(),
        "reflection_hankel": reflection,
        "transmission_hankel": transmission,
        "glint": prediction.light.iter().map(|light| light.glint).collect::<Vec<_>>(),
        "half_energy_radius_mm": prediction.light.iter().map(half_energy_radius_mm).collect::<Vec<_>>(),
    })
}

fn half_energy_radius_mm(light: &ChannelPrediction) -> Option<f64> {
    light.radius_of_energy_mm(0.5)
}

impl PredictArgs {
    fn check(&self) -> Result<()> {
        if self.model == ModelArg::Km && self.light == Source::Normal {
            refuse!(
                "--light normal: Kubelka-Munk knows diffuse light only, expected --model transport or monte-carlo \
                 beside it"
            );
        }
        if self.model != ModelArg::MonteCarlo && (self.photons.is_some() || self.seed.is_some()) {
            refuse!("--photons and --seed: this model traces no photons, expected --model monte-carlo beside them");
        }
        Ok(())
    }

    fn light(&self) -> Light {
        match self.light {
            Source::Diffuse => Light::Diffuse,
            Source::Normal => Light::Normal,
        }
    }

    fn model(&self) -> Model {
        let light = self.light();
        match self.model {
            ModelArg::Km => Model::KubelkaMunk,
            ModelArg::Transport => {
                Model::Transport { light, options: TransportOptions::for_accuracy(self.accuracy, light) }
            }
            ModelArg::MonteCarlo => Model::MonteCarlo {
                light,
                photons: self.photons.unwrap_or(Model::DEFAULT_PHOTONS),
                seed: self.seed.unwrap_or(Model::DEFAULT_SEED),
            },
        }
    }

    /// The files of `--csv`, one per channel.
    fn open_csv(&self, channels: &[String]) -> Result<Vec<OutputFile>> {
        let Some(path) = &self.csv else { return Ok(Vec::new()) };
        if channels.len() == 1 {
            return Ok(vec![OutputFile::open(path)?]);
        }
        channels.iter().map(|channel| OutputFile::open(&with_channel(path, channel))).collect()
    }

    fn figure(&self, named: &Stack<String>, model: &Model, prediction: &Prediction) -> Figure {
        let colours = channel_colours(&prediction.channels);
        let curves: Vec<_> = prediction
            .channels
            .iter()
            .zip(&prediction.light)
            .zip(colours)
            .map(|((channel, light), colour)| {
                let name = if prediction.channels.len() > 1 { channel.clone() } else { String::new() };
                let look = if matches!(model, Model::MonteCarlo { .. }) { Look::Rings } else { Look::Solid };
                Curve::new(name, light, colour, look)
            })
            .collect();
        let panels = [(Side::Reflection, "Reflection"), (Side::Transmission, "Transmission")];
        let panels = panels.into_iter().filter_map(|(side, title)| Some(profile_panel(side, &curves)?.title(title)));
        panels.fold(Figure::new(self.title(named, model)).columns(2), Figure::with)
    }

    fn title(&self, named: &Stack<String>, model: &Model) -> String {
        let layers: Vec<_> = named.pairs().map(|(name, mm)| format!("{name} {mm} mm")).collect();
        let below = self.core.as_ref().map_or("nothing".to_owned(), |core| format!("a half-space of {core}"));
        let model = match model {
            Model::KubelkaMunk => "Kubelka-Munk",
            Model::Transport { .. } => "transport",
            Model::MonteCarlo { .. } => "Monte Carlo",
        };
        let light = match self.light {
            Source::Diffuse => "diffuse light",
            Source::Normal => "a pencil beam",
        };
        format!("{} over {below}; {model}, {light}", layers.join(", "))
    }
}

/// `p.csv` and `R` make `p-R.csv`.
fn with_channel(path: &Path, channel: &str) -> PathBuf {
    let mut name = path.file_stem().unwrap_or_default().to_owned();
    name.push("-");
    name.push(channel);
    if let Some(extension) = path.extension() {
        name.push(".");
        name.push(extension);
    }
    path.with_file_name(name)
}
