//! Which resins a job begins with: its printer's own where there is a set of them, else one that does for its colours;
//! and of more than the printer or a format takes, those whose mixtures come nearest to what it should look like.
//!
//! A mixture is judged as a half-space of its mean coefficients, by the dipole's diffuse reflectance (Jensen et al.
//! 2001, section 2.3), and by the distance in CIELAB. That is no search for stackings, but it ranks: what no mixture of
//! three resins comes near to, no stack of them does.

use std::path::{Path, PathBuf};

use super::{PRINTER, StartOptions};
use crate::{
    appearance::diffuse_reflectance,
    colour::{lab, to_channels},
    container::{bmp, gcvf},
    job::file::OutputFormat,
    optics::{MaterialFile, MaterialSet},
    voxel::Printer,
};

/// Printers of which a built-in set has the own resins, by how their names begin.
const OWN: [(&str, &str); 1] = [("j850-", "vero-j850-provisional")];
const GREYS: &str = "synthetic";
const COLOURS: &str = "inks-rgb-7";
/// What fills the inside where a job does not say.
const CORE: &str = "black";

/// Mixtures that each choice of resins is tried with.
const MIXTURES: usize = 1500;
/// The least share of a resin in them, a power of two.
const LEAST_SHARE: f64 = -9.0;
/// More choices than these are not tried: of ten resins six.
const MOST_CHOICES: usize = 210;
/// A choice that comes nearer by less, in CIELAB, is no reason to do without the core's resin.
const NO_NEARER: f64 = 1.0;

/// The resins of a job.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Resins {
    /// A built-in set, or else a file.
    pub set: Option<String>,
    pub file: Option<PathBuf>,
    /// Where its numbers come from, in a few words.
    pub about: &'static str,
    /// Those that no stacking shall have, and why.
    pub left_out: Vec<String>,
    pub why_left_out: String,
    /// What fills the inside, where it is not the default.
    pub core: Option<String>,
    /// What was chosen and why, a sentence each.
    pub notes: Vec<String>,
}

impl Resins {
    /// Chooses for `colours`, linear, which are all that is asked for or stand for it.
    pub fn choose(options: &StartOptions, is_colourful: bool, colours: &[[f32; 3]]) -> Self {
        let printer = options.printer.as_deref().unwrap_or(PRINTER);
        let own = OWN.iter().find(|(series, _)| printer.starts_with(series)).map(|(_, set)| *set);
        let named = match &options.materials {
            Some(given) => given.clone(),
            None => PathBuf::from(own.unwrap_or(if is_colourful { COLOURS } else { GREYS })),
        };
        let name = named.to_string_lossy().into_owned();
        let set = MaterialSet::builtin_names().any(|set| set == name).then_some(name);
        let about = match set.as_deref() {
            Some("vero-j850-provisional") => {
                "Vero as a third party fitted it to photographs of J850 prints, provisional"
            }
            Some(COLOURS) => "published coefficients of five inks, an invented clear and support",
            Some("inks-rgb") => "published coefficients of five inks",
            Some(GREYS) => "invented white, black and support",
            _ => "",
        };
        let mut notes = Vec::new();
        if let (None, Some(set)) = (&options.materials, &set) {
            let why = match own {
                Some(_) => format!("the only set of what {printer} prints with"),
                None => format!("no set has what {printer} prints with"),
            };
            let others: Vec<_> = MaterialSet::builtin_names().filter(|other| other != set).collect();
            notes.push(format!(
                "resins: {set} ({about}): {why}; to take others, name a set (--materials {}) or a file of your own \
                 measurements",
                others.join(", ")
            ));
        }
        let file = set.is_none().then(|| named.clone());
        let mut resins =
            Self { set, file, about, left_out: Vec::new(), why_left_out: String::new(), core: None, notes };
        // What is wrong with a file is told by the job that names it.
        if let Ok((file, _)) = MaterialFile::named(&named) {
            resins.reduce(&file, options, printer, colours);
        }
        resins
    }

    /// Leaves out what the printer or a format does not take, and says what fills the inside if it is not the default.
    fn reduce(&mut self, file: &MaterialFile, options: &StartOptions, printer: &str, colours: &[[f32; 3]]) {
        let printed: Vec<&str> = file.resins_printed().filter(|resin| resin.1).map(|resin| resin.0).collect();
        let most_colours = Printer::by_name(printer).ok().and_then(|printer| printer.max_colors);
        let holders = [(OutputFormat::Bmp, bmp::MAX_MATERIALS), (OutputFormat::Gcvf, gcvf::MAX_COLORS)];
        let formats = holders.into_iter().filter(|(format, _)| options.formats.contains(format));
        let formats = formats.map(|(format, most)| (format.name(), most));
        let narrowest = most_colours.map(|most| (printer, most)).into_iter().chain(formats).min_by_key(|held| held.1);
        let mut kept: Vec<&str> = printed.clone();
        if let Some((holder, most)) = narrowest.filter(|(_, most)| printed.len() > *most)
            && let Some(chosen) = nearest(file, &printed, most, colours)
        {
            self.why_left_out =
                format!("{holder} takes {most}; {} come nearest to what is asked for", chosen.join(", "));
            self.notes.push(format!("resins: {} of {}: {}", most, file.name(), self.why_left_out));
            self.left_out = printed.iter().filter(|name| !chosen.contains(name)).map(|&name| name.to_owned()).collect();
            kept = chosen;
        }
        if !kept.contains(&CORE) {
            self.core = kept.iter().find(|&&name| name == "white").or(kept.first()).map(|&name| name.to_owned());
        }
    }

    /// Whether a job's resins are greys alone.
    pub fn are_greys(&self) -> bool {
        self.set.as_deref() == Some(GREYS)
    }
}

/// Of `names` the `most` whose mixtures come nearest to `colours`; `None` where coefficients are not known or there are
/// too many choices.
fn nearest<'a>(file: &MaterialFile, names: &[&'a str], most: usize, colours: &[[f32; 3]]) -> Option<Vec<&'a str>> {
    let volumes: Vec<_> = names.iter().map(|name| file.volume(name)).collect::<Option<_>>()?;
    let goal = |colour: &[f32; 3]| {
        let mut seen = Vec::new();
        to_channels(*colour, file.channels().len(), &mut seen);
        lab(std::array::from_fn(|channel| f64::from(*seen.get(channel).unwrap_or(&seen[0]))))
    };
    let goals: Vec<[f64; 3]> = colours.iter().map(goal).collect();
    let choices = choices(names.len(), most)?;
    let shown = |choice: &[usize], shares: &[f64]| -> [f64; 3] {
        let channel = |channel: usize| {
            let sum =
                |of: &dyn Fn(usize) -> f64| choice.iter().zip(shares).map(|(&resin, w)| w * of(resin)).sum::<f64>();
            let at = |resin: usize| volumes[resin].get(channel).unwrap_or(&volumes[resin][0]);
            let scattering = sum(&|resin| at(resin).sigma_s * (1.0 - at(resin).g));
            let absorption = sum(&|resin| at(resin).sigma_a);
            diffuse_reflectance(at(choice[0]).refractive_index, scattering / (scattering + absorption))
        };
        std::array::from_fn(channel)
    };
    let miss = |choice: &Vec<usize>| -> f64 {
        let mut least = vec![f64::INFINITY; goals.len()];
        for mixture in 0..MIXTURES {
            let shares: Vec<f64> = shares(choice.len(), mixture).collect();
            let found = lab(shown(choice, &shares));
            for (least, goal) in least.iter_mut().zip(&goals) {
                let apart: f64 = found.iter().zip(goal).map(|(a, b)| (a - b).powi(2)).sum();
                *least = least.min(apart);
            }
        }
        least.into_iter().map(f64::sqrt).sum::<f64>() / goals.len().max(1) as f64
    };
    let without_core =
        |choice: &Vec<usize>| if choice.iter().any(|&resin| names[resin] == CORE) { 0.0 } else { NO_NEARER };
    let judged = choices.iter().map(|choice| (miss(choice) + without_core(choice), choice));
    let (_, best) = judged.min_by(|a, b| a.0.total_cmp(&b.0))?;
    Some(best.iter().map(|&resin| names[resin]).collect())
}

/// All ways to choose `most` of `count`, each ascending; `None` of too many.
fn choices(count: usize, most: usize) -> Option<Vec<Vec<usize>>> {
    let mut found: Vec<Vec<usize>> = vec![Vec::new()];
    for _ in 0..most {
        let longer = |choice: &Vec<usize>| {
            let choice = choice.clone();
            (choice.last().map_or(0, |last| last + 1)..count).map(move |next| [&choice[..], &[next]].concat())
        };
        found = found.iter().flat_map(longer).collect();
        if found.len() > 100 * MOST_CHOICES {
            return None;
        }
    }
    (found.len() <= MOST_CHOICES).then_some(found)
}

/// Shares of a mixture, one of a sequence that fills all there are evenly in their logarithms (Roberts' R sequence).
fn shares(count: usize, mixture: usize) -> impl Iterator<Item = f64> {
    // The root above 1 of x^(d + 1) = x + 1.
    let root = (0..32).fold(1.5_f64, |x, _| libm::pow(1.0 + x, 1.0 / (count as f64 + 1.0)));
    let raw = move |axis: usize| {
        let at = (0.5 + (mixture + 1) as f64 / libm::pow(root, axis as f64 + 1.0)).fract();
        libm::exp2(LEAST_SHARE * at)
    };
    (0..count).map(raw)
}

/// What stands for all colours where those of an image are not known: greys and the corners of half a cube.
pub(super) fn any_colours() -> Vec<[f32; 3]> {
    let corner = |corner: usize| std::array::from_fn(|channel| if corner >> channel & 1 == 1 { 0.5 } else { 0.1 });
    (0..8).map(corner).chain([[0.25; 3], [0.7; 3]]).collect()
}

/// The path of a file as the job `job` names it: its name where it lies beside the job, else absolute.
pub(super) fn beside(file: &Path, job: &Path) -> String {
    let beside = file.parent() == job.parent();
    let named = if beside { file.file_name().map(PathBuf::from) } else { std::path::absolute(file).ok() };
    named.unwrap_or_else(|| file.to_owned()).to_string_lossy().into_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chosen(printer: &str, materials: Option<&str>, colour: [f32; 3]) -> Resins {
        let options = StartOptions {
            printer: Some(printer.to_owned()),
            materials: materials.map(PathBuf::from),
            ..StartOptions::default()
        };
        Resins::choose(&options, true, &[colour])
    }

    fn kept(resins: &Resins) -> Vec<&'static str> {
        let all = ["white", "black", "clear", "cyan", "magenta", "yellow"];
        all.into_iter().filter(|name| !resins.left_out.iter().any(|out| out == name)).collect()
    }

    #[test]
    fn every_set_of_a_printers_own_exists() {
        for (series, set) in OWN {
            assert!(MaterialSet::builtin_names().any(|known| known == set), "{set}");
            assert!(Printer::preset_names().any(|name| name.starts_with(series)), "{series}");
        }
    }

    #[test]
    fn of_three_resins_one_is_of_the_colour_asked_for() {
        for (printer, set) in [("j850-hs-27um", "vero-j850-provisional"), ("connex500-30um", "inks-rgb-7")] {
            for (colour, needs) in [
                ([0.5, 0.04, 0.2], &["magenta"][..]),
                ([0.6, 0.5, 0.03], &["yellow"]),
                ([0.03, 0.3, 0.5], &["cyan"]),
                ([0.04, 0.3, 0.05], &["cyan", "yellow"]),
                ([0.3, 0.3, 0.3], &["white", "black"]),
            ] {
                let resins = chosen(printer, None, colour);
                assert_eq!(resins.set.as_deref(), Some(set));
                let kept = kept(&resins);
                assert_eq!(kept.len(), 3, "{kept:?}");
                assert!(needs.iter().all(|needed| kept.contains(needed)), "{colour:?}: {kept:?}");
                // The inside is of one that is there.
                let core = resins.core.as_deref().unwrap_or(CORE);
                assert!(kept.contains(&core), "{core} of {kept:?}");
            }
        }
        // What takes all of them has them all.
        for resins in [chosen("j850-14um", None, [0.5; 3]), chosen("j750-27um", Some("inks-rgb"), [0.5; 3])] {
            assert_eq!((&resins.left_out, &resins.core), (&Vec::new(), &None));
        }
    }

    #[test]
    fn choices_are_all_there_are() {
        assert_eq!(choices(4, 2).unwrap().len(), 6);
        assert_eq!(choices(3, 3), Some(vec![vec![0, 1, 2]]));
        assert_eq!(choices(30, 15), None);
    }
}
