//! `lumislice material list` and `show`: what resins there are and what they do to light.

use std::path::PathBuf;

use clap::{Args, Subcommand};
use lumislice::{
    optics::{ChannelPrediction, CoefficientFit, MaterialFile, MaterialSet, Resin, ResinChannel},
    plot::{Figure, SERIES},
};
use serde_json::json;

use super::{
    Answer, Result,
    coupon::{self, CouponArgs},
    document,
    fit::{self, FitArgs},
    materials::Materials,
    measure::{self, MeasureArgs},
    plots::{Curve, Look, PlotFile, Side, profile_panel},
    print,
    progress::Bars,
    simulate::{self, SimulateArgs},
    table::{number, table},
};

/// Resins: list the built-in sets, show one, simulate profiles, measure photographs, sheets in a sphere or a coupon.
#[derive(Debug, Args)]
#[command(arg_required_else_help = true)]
pub struct MaterialArgs {
    #[command(subcommand)]
    command: MaterialCommand,
}

#[derive(Debug, Subcommand)]
enum MaterialCommand {
    List(ListArgs),
    Show(ShowArgs),
    Simulate(SimulateArgs),
    Measure(MeasureArgs),
    Fit(FitArgs),
    Coupon(CouponArgs),
}

/// List the built-in sets of resins.
#[derive(Debug, Args)]
struct ListArgs {
    /// Print one JSON document instead of words.
    #[arg(long)]
    json: bool,
}

/// Show the resins of a set: coefficients, and what the slab they were read from reflects and transmits.
#[derive(Debug, Args)]
struct ShowArgs {
    /// A material file (TOML), or the name of a built-in set.
    #[arg(value_name = "FILE|SET")]
    materials: PathBuf,
    /// Draw R(r) and T(r) of every resin's slab on a logarithmic axis to F, a .png or .svg.
    #[arg(long, value_name = "F")]
    plot: Option<PathBuf>,
    /// Print one JSON document instead of tables.
    #[arg(long)]
    json: bool,
}

/// Runs the command.
pub fn run(args: &MaterialArgs) -> Result<Answer> {
    match &args.command {
        MaterialCommand::List(args) => list(args),
        MaterialCommand::Show(args) => show(args),
        MaterialCommand::Simulate(args) => simulate::run(args),
        MaterialCommand::Measure(args) => measure::run(args),
        MaterialCommand::Fit(args) => fit::run(args),
        MaterialCommand::Coupon(args) => coupon::run(args),
    }
}

fn list(args: &ListArgs) -> Result<Answer> {
    let sets = MaterialSet::builtin_names().map(MaterialFile::builtin).collect::<Result<Vec<_>, _>>()?;
    if args.json {
        let record = |set: &MaterialFile| {
            json!({
                "name": set.name(),
                "channels": set.channels(),
                "resins": set.resin_names().collect::<Vec<_>>(),
                "provenance": set.provenance(),
            })
        };
        document(true, &sets.iter().map(record).collect::<Vec<_>>())?;
        return Ok(Answer::Yes);
    }
    let entry = |set: &MaterialFile| {
        let resins = set.resin_names().collect::<Vec<_>>().join(", ");
        let (name, channels) = (set.name(), set.channels().join(", "));
        format!("{name}\n  resins    {resins}\n  channels  {channels}\n  from      {}\n", set.provenance())
    };
    print(&sets.iter().map(entry).collect::<Vec<_>>().join("\n"))?;
    Ok(Answer::Yes)
}

fn show(args: &ShowArgs) -> Result<Answer> {
    let mut materials = Materials::read(&args.materials)?;
    let plot = args.plot.as_deref().map(PlotFile::open).transpose()?;
    let bars = Bars::new(args.json);
    materials.fit(None, &bars)?;
    let set = materials.load(&bars)?;
    if let Some(plot) = plot {
        plot.finish(&figure(&set))?;
    }
    if !document(
        args.json,
        &json!({
            "name": set.name,
            "provenance": set.provenance,
            "channels": set.channels,
            "resins": set.resins.iter().map(record).collect::<Vec<_>>(),
            "remarks": set.warnings,
        }),
    )? {
        print(&report(&set))?;
    }
    Ok(Answer::Yes)
}

/// The slabs' profiles: a row per channel, reflection and transmission.
fn figure(set: &MaterialSet) -> Figure {
    let mut figure = Figure::new(format!("Resins of {}", set.name)).columns(2).caption(set.provenance.clone());
    for (channel, name) in set.channels.iter().enumerate() {
        let light: Vec<_> = set
            .resins
            .iter()
            .map(|resin| &resin.channels[channel].slab)
            .map(|slab| ChannelPrediction::from_spectra(slab.reflection.clone(), slab.transmission.clone(), &set.grid))
            .collect();
        let curve = |(index, (resin, light)): (usize, (&Resin, _))| {
            let name = format!("{}, {} mm", resin.name, resin.channels[channel].slab_mm);
            Curve::new(name, light, SERIES[index % SERIES.len()], Look::Solid)
        };
        let curves: Vec<_> = set.resins.iter().zip(&light).enumerate().map(curve).collect();
        for (side, title) in [(Side::Reflection, "Reflection"), (Side::Transmission, "Transmission")] {
            let title = if set.channels.len() > 1 { format!("{title}, channel {name}") } else { title.to_owned() };
            figure.panels.extend(profile_panel(side, &curves).map(|panel| panel.title(title)));
        }
    }
    figure
}

/// Albedo of a resin without end.
fn half_space(channel: &ResinChannel) -> Option<f64> {
    channel.kubelka_munk.half_space().first().copied()
}

fn record(resin: &Resin) -> serde_json::Value {
    let coefficients = resin.volumes().map(|volumes| {
        let each = volumes.iter().map(
            |volume| json!({ "scattering_per_mm": volume.sigma_s, "absorption_per_mm": volume.sigma_a, "g": volume.g }),
        );
        each.collect::<Vec<_>>()
    });
    let per_channel = |value: fn(&ResinChannel) -> Option<f64>| resin.channels.iter().map(value).collect::<Vec<_>>();
    json!({
        "name": resin.name,
        "rgba": resin.rgba,
        "density_g_per_cm3": resin.density_g_per_cm3,
        "print_as": if resin.print_as_background { "background" } else { "resin" },
        "refractive_index": resin.refractive_index,
        "coefficients": coefficients,
        "fit": resin.fits().map(|fits| fits.iter().map(fit_record).collect::<Vec<_>>()),
        "slab_thickness_mm": per_channel(|channel| Some(channel.slab_mm)),
        "slab_reflection": per_channel(|channel| channel.slab.reflection.first().copied()),
        "slab_transmission": per_channel(|channel| channel.slab.transmission.first().copied()),
        "half_space_reflection": per_channel(half_space),
        "notes": resin.notes,
    })
}

fn fit_record(fit: &CoefficientFit) -> serde_json::Value {
    json!({
        "residual_rms": fit.residual,
        "slabs": fit.slabs,
        "reduced_scattering_uncertainty": fit.reduced_scattering_share,
        "absorption_uncertainty": fit.absorption_share,
        "g_uncertainty": fit.g_uncertainty,
    })
}

/// How well coefficients fit the profiles of the resins that came without.
fn fits(set: &MaterialSet) -> Option<String> {
    let percent = |share: f64| format!("{:.1}%", 100.0 * share);
    let rows = set.resins.iter().filter_map(|resin| resin.fits().map(|fits| (resin, fits)));
    let rows: Vec<Vec<String>> = rows
        .flat_map(|(resin, fits)| {
            fits.into_iter().zip(&set.channels).map(|(fit, channel)| {
                vec![
                    resin.name.clone(),
                    channel.clone(),
                    fit.slabs.to_string(),
                    format!("{:.1e}", fit.residual),
                    percent(fit.reduced_scattering_share),
                    percent(fit.absorption_share),
                    format!("{:.2}", fit.g_uncertainty),
                ]
            })
        })
        .collect();
    let header =
        ["fitted", "channel", "slabs", "residual rms", "scattering (1 - g) within", "absorption within", "g within"];
    (!rows.is_empty()).then(|| table(&header, &rows))
}

fn report(set: &MaterialSet) -> String {
    let mut rows = Vec::new();
    let mut about = Vec::new();
    for resin in &set.resins {
        for (index, (channel, name)) in resin.channels.iter().zip(&set.channels).enumerate() {
            let volume = channel.volume;
            rows.push(vec![
                if index == 0 { resin.name.clone() } else { String::new() },
                name.clone(),
                number(volume.map(|volume| volume.sigma_s), 4),
                number(volume.map(|volume| volume.sigma_a), 4),
                number(volume.map(|volume| volume.g), 2),
                format!("{:.2}", channel.slab_mm),
                number(channel.slab.reflection.first().copied(), 4),
                number(channel.slab.transmission.first().copied(), 4),
                number(half_space(channel), 4),
            ]);
        }
        let [r, g, b, _] = resin.rgba;
        let printed = if resin.print_as_background { "background" } else { "resin" };
        about.push(vec![
            resin.name.clone(),
            format!("{r} {g} {b}"),
            resin.density_g_per_cm3.to_string(),
            resin.refractive_index.to_string(),
            printed.to_owned(),
        ]);
    }
    let light =
        ["resin", "channel", "scattering/mm", "absorption/mm", "g", "slab mm", "reflects", "transmits", "half-space"];
    let mut text = format!("{}\n  from {}\n", set.name, set.provenance);
    text += &table(&light, &rows);
    text += &fits(set).unwrap_or_default();
    text += &table(&["resin", "rgb in slices", "g/cm³", "refr. index", "printed as"], &about);
    for resin in set.resins.iter().filter(|resin| !resin.notes.is_empty()) {
        text += &format!("  {}: {}\n", resin.name, resin.notes.lines().collect::<Vec<_>>().join(" "));
    }
    for remark in &set.warnings {
        text += &format!("  remark: {remark}\n");
    }
    text
}
