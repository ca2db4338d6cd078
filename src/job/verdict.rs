//! What a finished job comes to, in a few sentences for whoever decides by them: how far the print will look from what
//! was asked for, where it is worst and why, what lies out of reach, and whether the printer can have the files.
//!
//! **In:** a [`Manifest`]. **Out:** sentences, the most telling first. All of it is in the manifest in numbers.

use super::{
    Manifest,
    record::{LookSummary, SpotRecord, Spread},
};
use crate::{job::file::OutputFormat, search::far_miss, words::counted};

/// Colour difference and share of the brightness, and what they are called.
type Grade = ([f64; 2], [f64; 2], &'static str);

/// How a print compares, by the median and the 95% of its places: at most so much of both for each of the words. In
/// CIEDE2000, of which 1 is just visible side by side; and as shares of a brightness, of which some 4% are.
const GRADES: [Grade; 3] = [
    ([1.0, 2.0], [0.03, 0.07], "looks as asked"),
    ([2.0, 5.0], [0.06, 0.2], "looks close to what was asked"),
    ([4.0, 10.0], [0.12, 0.4], "looks like what was asked, with differences that show"),
];
const ELSE: &str = "looks other than asked";
/// Albedos that are asked for below this are black, of which a share tells nothing.
const BLACK: f64 = 0.02;
/// A spot that sees less of the sky lies in a hollow.
const HOLLOW: f64 = 0.75;
/// Words for parts of the height up to which they hold.
const HEIGHTS: [(f64, &str); 4] = [
    (0.125, "near the foot"),
    (0.375, "a quarter of the way up"),
    (0.625, "half-way up"),
    (0.875, "three quarters up"),
];

impl Manifest {
    /// What the job comes to, a sentence or two each: the look, the worst place, what is out of reach, whether the
    /// files are ready for the printer, how many warnings there are, whose resins these are.
    pub fn verdict(&self) -> Vec<String> {
        let mut words = Vec::new();
        match &self.look {
            None => words.push(match self.is_part() {
                true => "How it will look was not computed, for these are not all of its slices.".to_owned(),
                false => "How it will look was not computed: see the warnings, or `lumislice look`.".to_owned(),
            }),
            Some(look) => {
                words.push(likeness(look));
                words.extend(unlit(look));
                words.extend(look.worst.first().map(|worst| self.worst_place(worst)));
            }
        }
        words.extend(self.reach());
        words.push(self.readiness());
        if let Some(set) = self.job.pointer("/materials/set").and_then(serde_json::Value::as_str) {
            words.push(format!(
                "Computed with the built-in resins `{set}`, which are no measurement of your printer's: measure those \
                 before you rely on it."
            ));
        }
        words
    }

    fn is_part(&self) -> bool {
        self.slices != [0, self.lattice.dims[2]]
    }

    /// The spot that is farthest off, and why.
    fn worst_place(&self, worst: &SpotRecord) -> String {
        let goal = worst.shows(worst.asked.as_ref().unwrap_or(&worst.predicted));
        let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len().max(1) as f64;
        let (printed, wanted) = (mean(&worst.printed), mean(&goal));
        let percent = 100.0 * (printed / wanted.max(1e-3) - 1.0).abs();
        let side = if printed > wanted { "brighter" } else { "darker" };
        let [x, y, z] = worst.position_mm;
        let [low, high] = [0, 1].map(|end| {
            let corners = self.objects.get(worst.object).map(|object| object.bounds_mm);
            corners.map_or(0.0, |corners| corners[end][2])
        });
        let up = (z - low) / (high - low).max(f64::MIN_POSITIVE);
        let height = HEIGHTS.iter().find(|(end, _)| up < *end).map_or("near the top", |(_, words)| *words);
        let at = |words: &str| format!("{words}, at ({x:.1}, {y:.1}, {z:.1}) mm");
        if worst.asked.is_none() {
            return format!(
                "It is most unlike a flat slab of its layers {}: {percent:.0}% {side}, for light comes and goes by \
                 other sides where a part is thin, ends or bends.",
                at(height)
            );
        }
        let off = match worst.delta_e_2000 {
            _ if wanted < BLACK => format!("an albedo of {printed:.3} in place of {wanted:.3}"),
            Some(difference) if percent < 1.0 => {
                format!("ΔE {difference:.1}, as bright as it should be, of another hue")
            }
            Some(difference) => format!("ΔE {difference:.1}, {percent:.0}% {side} than it should be"),
            None => format!("{percent:.0}% {side} than it should be"),
        };
        let why = if worst.asked.as_deref().is_some_and(|asked| self.is_beyond(worst.object, asked)) {
            "these resins come no nearer to what is asked there".to_owned()
        } else if worst.sky < HOLLOW {
            format!(
                "it lies in a hollow that sees {:.0}% of the sky, and is lit by what lies around it",
                100.0 * worst.sky
            )
        } else if self.rounds.is_empty() {
            "light comes and goes by other sides where a part is thin, ends or bends, and no round of correction made \
             up for it"
                .to_owned()
        } else {
            "most likely a thin part, an edge or a bend, where light comes and goes by other sides, or a pattern finer \
             than light travels in these resins; it was corrected as far as rounds and resins go"
                .to_owned()
        };
        format!("The worst place is {}: {off}. Why: {why}.", at(height))
    }

    /// Whether the stacking for what is most like `asked` looks another way, though flat and endless.
    fn is_beyond(&self, object: usize, asked: &[f64]) -> bool {
        let entries = self.stackings.get(object).map_or(&[][..], |report| &report.stackings);
        let apart = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        let known = entries.iter().filter_map(|entry| Some((entry.target_albedo.as_deref()?, entry)));
        let nearest = known.min_by(|a, b| apart(a.0, asked).total_cmp(&apart(b.0, asked)));
        nearest.is_some_and(|(target, entry)| misses(target, &entry.predicted_albedo))
    }

    /// Share of the surface that asks for what the resins cannot do; `None` where nothing is asked.
    fn beyond(&self) -> Option<f64> {
        let area = |object: usize| self.objects.get(object)?.health["area_mm2"].as_f64();
        let (mut whole, mut beyond) = (0.0, 0.0);
        for (object, report) in self.stackings.iter().enumerate() {
            let area = area(object).unwrap_or(1.0);
            for entry in &report.stackings {
                let Some(target) = &entry.target_albedo else { continue };
                whole += area * entry.share;
                if misses(target, &entry.predicted_albedo) {
                    beyond += area * entry.share;
                }
            }
        }
        (whole > 0.0).then(|| beyond / whole)
    }

    fn reach(&self) -> Option<String> {
        let beyond = self.beyond()?;
        let cut = self.rounds.last().map_or(0.0, |round| round.out_of_reach);
        let flat = match percent(beyond) {
            None => "On a flat slab these resins come near every albedo that is asked for".to_owned(),
            Some(share) => {
                format!("Out of reach: {share} of the surface asks for an albedo that these resins do not have")
            }
        };
        let shape = percent(cut).map(|share| {
            format!("at {share} of the places what their shape and pattern would need is more than the resins can do")
        });
        Some(match shape {
            None => format!("{flat}."),
            Some(shape) => format!("{flat}; {shape}."),
        })
    }

    /// Whether the printer can have the files, and how many warnings there are.
    fn readiness(&self) -> String {
        let formats = self.job.pointer("/output/formats").and_then(serde_json::Value::as_array);
        let wanted = |format: OutputFormat| {
            formats.is_some_and(|formats| formats.iter().any(|name| name.as_str() == Some(format.name())))
        };
        let slices = self.slices[1] - self.slices[0];
        let png = format!("{slices} slices for GrabCAD Voxel Print (slices/)");
        let files = [
            (OutputFormat::Png, png.as_str()),
            (OutputFormat::Gcvf, "a container for GrabCAD Print (exports/)"),
            (OutputFormat::Bmp, "bitmaps for Objet printers (bmp/)"),
            (OutputFormat::Stl, "a mesh for each resin (meshes/)"),
            (OutputFormat::ThreeMf, "an assembly of meshes (meshes/)"),
        ];
        let files: Vec<_> = files.iter().filter(|(format, _)| wanted(*format)).map(|(_, words)| *words).collect();
        let printed = self.materials.iter().any(|material| material.rgba[3] != 0 && material.voxels > 0);
        let ready = if !printed {
            "Not ready for the printer: nothing would be printed".to_owned()
        } else if files.is_empty() {
            "Not for the printer yet: none of the job's formats is one that printers take".to_owned()
        } else if self.is_part() {
            format!("Not ready for the printer: {slices} of {} slices", self.lattice.dims[2])
        } else {
            format!("Ready for the printer: {}", files.join(", "))
        };
        let warnings = match (self.warnings.len(), self.print_warnings) {
            (0, _) => "no warnings".to_owned(),
            (all, 0) => counted(all, "warning"),
            (all, fragile) if fragile >= all => format!("{}, about what will not print well", counted(all, "warning")),
            (all, fragile) => format!("{}, {fragile} of them about what will not print well", counted(all, "warning")),
        };
        format!("{ready}; {warnings}.")
    }
}

/// Whether a channel comes out with another albedo than asked.
fn misses(asked: &[f64], found: &[f64]) -> bool {
    far_miss(asked.iter().zip(found).map(|(asked, found)| [*asked, *found])).is_some()
}

/// How far single places are from what was asked for.
fn likeness(look: &LookSummary) -> String {
    let places = counted(look.spots, "place");
    let graded = |median: f64, most: f64, of: fn(&Grade) -> [f64; 2]| {
        let within = |grade: &&Grade| median <= of(grade)[0] && most <= of(grade)[1];
        GRADES.iter().find(within).map_or(ELSE, |grade| grade.2)
    };
    if let Some(colour) = look.delta_e_2000 {
        let (share, most) = colour.ninety_five_percent.map_or((90, colour.ninety_percent), |most| (95, most));
        return format!(
            "The print {}: of {places} looked at, half are within ΔE {:.1} of the colour asked for and {share}% within \
             {most:.1} (ΔE 1 is just visible).",
            graded(colour.median, most, |grade| grade.0),
            colour.median,
        );
    }
    let Some(Spread { median, ninety_five_percent: most }) = look.relative else {
        return match look.spots {
            0 => "No place that was looked at sees enough of the sky to be judged.".to_owned(),
            _ => format!("No look was asked for: the layers were given. {places} of the print were looked at."),
        };
    };
    format!(
        "The print {}: of {places} looked at, half are within {} of the brightness asked for and 95% within {} (some 4% \
         are just visible).",
        graded(median, most, |grade| grade.1),
        share(median),
        share(most),
    )
}

/// The places that were looked at and tell nothing.
fn unlit(look: &LookSummary) -> Option<String> {
    (look.unlit > 0).then(|| {
        format!(
            "Not judged: {}, where hardly any sky is seen, as inside a vase; what shows there is light that has come \
             through the walls.",
            counted(look.unlit, "place")
        )
    })
}

fn share(part: f64) -> String {
    format!("{:.0}%", 100.0 * part)
}

/// A share in words, unless it is next to nothing.
fn percent(part: f64) -> Option<String> {
    match part {
        part if part < 0.0005 => None,
        part if part < 0.01 => Some("less than 1%".to_owned()),
        part => Some(share(part)),
    }
}
