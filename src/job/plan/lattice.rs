//! The lattice that the wanted albedos, thicknesses and widths of a surface are told apart on.
//!
//! A lattice point is a stacking that is worked out once, from the cluster that is like it. All clusters share the
//! lattice: neighbours on the surface whose clusters differ meet at the same points, and there are no more of those
//! than colours that are told apart.

use rayon::prelude::*;

use super::answers::Answers;
use crate::parallel;
use crate::search::SearchTarget;

/// Channels that are corrected each on its own; where there are more, all get the same factor.
pub(in crate::job) const CHANNELS: usize = 4;
/// Thicknesses are told apart from the first down, mm, each smaller than the one before by this factor.
pub(super) const THICKEST_MM: f64 = 4.8;
const THICKNESS_STEP: f64 = std::f64::consts::SQRT_2;
/// Logarithm of the step between albedos; wider, by so much at a time, where there would be too many labels.
const FINEST_STEP: f64 = 0.02;
/// The same where one number tells albedos apart, so that finer steps make few labels more: in steps of 2% a whole ball
/// was laid of seven, up to 1% lighter or darker than it was to be. Finer ones than a quarter of a percent would tell
/// apart what a round does not.
const FINEST_IN_ONE: f64 = 0.0025;
const WIDER: f64 = 1.25;
/// Albedos below this have wider steps, alike in lightness.
const DARK: f64 = 0.1;
/// Albedos below this are black.
pub(super) const BLACK: f64 = 0.002;
/// Logarithm of the step between widths.
const WIDTH_STEP: f64 = 0.25;

/// What is wanted at a texel.
#[derive(Debug, Clone)]
pub(super) struct Place {
    pub cluster: u16,
    /// Logarithm of half the thickness in mm, where that counts.
    pub half_ln: Option<f64>,
    /// Logarithms of the albedos, by channel; where all channels are alike, that of the one factor of what the
    /// cluster's stacking has.
    pub ln: [f64; CHANNELS],
    /// Between two steps the upper is taken from here on, 0 to 1: one for all, so that of a cell's corners no more
    /// are used than there are coordinates, and one.
    pub threshold: f64,
    /// Whether it is so near to others that these may take the other step, however large; else that is so where steps
    /// are small, and half-way for the others.
    pub near: bool,
}

/// What tells labels apart.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Key {
    /// The cluster whose stacking is bent.
    pub cluster: u16,
    thickness: u8,
    rungs: [i16; CHANNELS],
}

const THICK: u8 = u8::MAX;

impl Key {
    /// Half of the thickness that layers are made for, mm; `None` where they end before.
    pub fn half_mm(&self) -> Option<f64> {
        (self.thickness != THICK).then(|| thickness_mm(self.thickness))
    }
}

fn thickness_mm(step: u8) -> f64 {
    THICKEST_MM / libm::pow(THICKNESS_STEP, f64::from(step))
}

/// Which clusters may stand for one another in other albedos.
#[derive(Debug)]
pub(super) enum Classes {
    /// None: what is laid in a cluster is bent from its own stacking, in all channels alike or in each.
    OneEach { alike: bool },
    /// Those that let light travel alike far: the class of every cluster.
    ByWidth(Vec<u16>),
}

impl Classes {
    /// Of clusters whose texels ask for albedos of their own, by channel.
    pub fn by_width(targets: &[SearchTarget]) -> Self {
        let class = |target: &SearchTarget| {
            let lit = target.channels.iter().filter(|channel| channel[0] > 0.0);
            let width = |channel: &Vec<f64>| libm::log(channel.iter().sum::<f64>().max(channel[0]) / channel[0]);
            let widths: Vec<f64> = lit.map(width).collect();
            (widths.iter().sum::<f64>() / widths.len().max(1) as f64 / WIDTH_STEP).round() as u16
        };
        Self::ByWidth(targets.iter().map(class).collect())
    }

    fn of(&self, cluster: u16) -> u16 {
        match self {
            Self::OneEach { .. } => cluster,
            Self::ByWidth(classes) => classes[usize::from(cluster)],
        }
    }
}

/// The lattice itself.
pub(super) struct Lattice<'a> {
    answers: &'a Answers,
    classes: &'a Classes,
    step: f64,
    /// Where the lattice of each cluster starts: at its own stacking, or all at that of the first.
    origins: Vec<Vec<f64>>,
}

impl<'a> Lattice<'a> {
    /// The finest that tells no more than `most` places apart, with the point of each place, and all points that occur
    /// and are no cluster's own stacking, in order.
    pub fn finest(
        answers: &'a Answers,
        classes: &'a Classes,
        places: &[Place],
        most: usize,
    ) -> (Self, Vec<Key>, Vec<Key>) {
        let origin = |cluster: usize| {
            let of = if matches!(classes, Classes::OneEach { .. }) { cluster } else { 0 };
            answers.promised(of).iter().map(|albedo| coordinate(ln(*albedo))).collect()
        };
        let origins = (0..answers.len()).map(origin).collect();
        let in_one = matches!(classes, Classes::OneEach { alike: true }) || answers.channels() == 1;
        let step = if in_one { FINEST_IN_ONE } else { FINEST_STEP };
        let mut lattice = Self { answers, classes, step, origins };
        loop {
            let cells: Vec<Cell> = places.par_iter().map(|place| lattice.cell(place)).collect();
            let mut occurring = cells.clone();
            occurring.par_sort_unstable();
            occurring.dedup();
            let keys: Vec<Key> = parallel::map_all(&occurring, |cell| lattice.key(cell));
            let mut distinct = keys.clone();
            distinct.par_sort_unstable();
            distinct.dedup();
            distinct.retain(|key| lattice.plain(key).is_none());
            if distinct.len() <= most {
                let key = |cell: &Cell| keys[occurring.partition_point(|other| other < cell)];
                return (lattice, cells.par_iter().map(key).collect(), distinct);
            }
            lattice.step *= WIDER;
        }
    }

    /// Logarithms of the albedos of a point, by channel.
    pub fn ln_albedo(&self, key: &Key) -> Vec<f64> {
        self.at(usize::from(key.cluster), &key.rungs)
    }

    /// The cluster whose own stacking a point is.
    pub fn plain(&self, key: &Key) -> Option<u16> {
        let is_plain = key.thickness == THICK && key.rungs == [0; CHANNELS];
        (is_plain && (key.cluster == 0 || matches!(self.classes, Classes::OneEach { .. }))).then_some(key.cluster)
    }

    fn at(&self, cluster: usize, rungs: &[i16; CHANNELS]) -> Vec<f64> {
        if let Classes::OneEach { alike: true } = self.classes {
            let factor = f64::from(rungs[0]) * self.step;
            return self.answers.promised(cluster).iter().map(|albedo| ln(*albedo) + factor).collect();
        }
        let of = |(origin, rung): (&f64, &i16)| logarithm(origin + f64::from(*rung) * self.step);
        self.origins[cluster].iter().zip(rungs).map(of).collect()
    }

    fn cell(&self, place: &Place) -> Cell {
        let on_ladder = |steps: f64, small: bool| {
            let threshold = if place.near || small { place.threshold } else { 0.5 };
            steps.floor() + if steps - steps.floor() > threshold { 1.0 } else { 0.0 }
        };
        let thickness = place.half_ln.map_or(THICK, |half_ln| {
            let steps = (libm::log(THICKEST_MM) - half_ln) / libm::log(THICKNESS_STEP);
            on_ladder(steps, false).clamp(0.0, f64::from(THICK - 1)) as u8
        });
        let mut rungs = [0; CHANNELS];
        let mut take = |n: usize, from_origin: f64| {
            rungs[n] = on_ladder(from_origin / self.step, self.step < FINEST_STEP).clamp(-9999.0, 9999.0) as i16;
        };
        let origin = &self.origins[usize::from(place.cluster)];
        match self.classes {
            Classes::OneEach { alike: true } => take(0, place.ln[0]),
            _ => (0..origin.len()).for_each(|n| take(n, coordinate(place.ln[n]) - origin[n])),
        }
        Cell { class: self.classes.of(place.cluster), thickness, rungs }
    }

    /// The point of a cell: bent from the cluster of its class that is nearest.
    fn key(&self, cell: &Cell) -> Key {
        let apart = |cluster: usize| -> f64 {
            let off = self.at(cluster, &cell.rungs).into_iter().zip(self.answers.promised(cluster));
            off.map(|(wanted, albedo)| (wanted - ln(*albedo)).powi(2)).sum()
        };
        let cluster = match self.classes {
            Classes::OneEach { .. } => usize::from(cell.class),
            Classes::ByWidth(classes) => {
                let of_class = (0..classes.len()).filter(|&cluster| classes[cluster] == cell.class);
                let nearest = of_class.map(|cluster| (apart(cluster), cluster)).min_by(|a, b| a.0.total_cmp(&b.0));
                nearest.map_or(0, |(_, cluster)| cluster)
            }
        };
        let ends = self.answers.thickness_mm(cluster).min(THICKEST_MM);
        let thin = cell.thickness != THICK && thickness_mm(cell.thickness) < ends;
        Key { cluster: cluster as u16, thickness: if thin { cell.thickness } else { THICK }, rungs: cell.rungs }
    }
}

fn ln(albedo: f64) -> f64 {
    libm::log(albedo.max(BLACK))
}

/// What tells places apart before it is known from which cluster each is bent.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Cell {
    class: u16,
    thickness: u8,
    rungs: [i16; CHANNELS],
}

/// The coordinate of an albedo's logarithm: that from [`DARK`] up, counted from there, and below alike in lightness, as
/// its cube root rises.
fn coordinate(ln: f64) -> f64 {
    let above = ln - libm::log(DARK);
    if above >= 0.0 { above } else { 3.0 * (libm::exp(above / 3.0) - 1.0) }
}

/// The logarithm of the albedo at a coordinate.
fn logarithm(coordinate: f64) -> f64 {
    let above = if coordinate >= 0.0 { coordinate } else { 3.0 * libm::log((1.0 + coordinate / 3.0).max(0.05)) };
    above + libm::log(DARK)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn coordinates_are_those_of_one_albedo_each() {
        for albedo in [0.002, 0.01, 0.0999, 0.1, 0.3, 0.95] {
            let ln = f64::ln(albedo);
            assert!((logarithm(coordinate(ln)) - ln).abs() < 1e-9, "{albedo}");
        }
        let slope = |albedo: f64| (coordinate(albedo.ln() + 1e-4) - coordinate(albedo.ln())) / 1e-4;
        assert!((slope(0.2) - 1.0).abs() < 1e-6 && (slope(0.0125) - 0.5).abs() < 1e-3);
    }

    /// A hundred clusters, each with texels around its colour, on a shape of every thickness: on lattices of their own
    /// the corners of one cell of each would be all that there is room for.
    #[test]
    fn many_colours_on_many_thicknesses_are_told_apart_in_small_steps() {
        const CLUSTERS: usize = 100;
        const MOST: usize = 4096;
        let answers = Answers::coloured(CLUSTERS);
        let flat = |n: usize| SearchTarget { channels: answers.promised(n).iter().map(|a| vec![*a; 8]).collect() };
        let classes = Classes::by_width(&(0..CLUSTERS).map(flat).collect::<Vec<_>>());
        let place = |n: usize| {
            let part = |step: f64| (n as f64 * step).fract();
            let mut ln = [0.819, 0.671, 0.550, 0.0].map(|step| 0.3 * part(step) - 0.15);
            ln.iter_mut().zip(answers.promised(n % CLUSTERS)).for_each(|(ln, albedo)| *ln += albedo.ln());
            Place {
                cluster: (n % CLUSTERS) as u16,
                half_ln: Some(0.15_f64.ln() + 3.5 * part(0.618)),
                ln,
                threshold: part(0.414),
                near: true,
            }
        };
        let places: Vec<Place> = (0..40_000).map(place).collect();
        let (lattice, keys, distinct) = Lattice::finest(&answers, &classes, &places, MOST);
        assert!(distinct.len() <= MOST && lattice.step < 0.3, "{} {}", distinct.len(), lattice.step);
        for (place, key) in places.iter().zip(&keys) {
            let laid = lattice.ln_albedo(key);
            for (wanted, laid) in place.ln.iter().zip(&laid) {
                assert!((coordinate(*wanted) - coordinate(*laid)).abs() < lattice.step + 1e-9, "{place:?} {key:?}");
            }
            let near = laid.iter().zip(answers.promised(usize::from(key.cluster))).map(|(ln, of)| (ln - of.ln()).abs());
            assert!(near.fold(0.0, f64::max) < 0.5, "{key:?}");
            let half_ln = place.half_ln.unwrap();
            match key.half_mm() {
                Some(half_mm) => assert!((half_mm.ln() - half_ln).abs() < THICKNESS_STEP.ln() + 1e-9),
                None => assert!(half_ln > (answers.thickness_mm(usize::from(key.cluster)) / THICKNESS_STEP).ln()),
            }
        }
    }

    /// One colour in one channel: places are laid within a quarter of a percent, and all that ask for the same are, on
    /// the mean, laid at it, far apart as they are; thicknesses are the nearer of two.
    #[test]
    fn one_colour_is_laid_as_it_is_wanted_on_the_mean() {
        let answers = Answers::grey();
        let promised = answers.promised(0)[0].ln();
        let place = |n: usize| Place {
            cluster: 0,
            half_ln: Some(0.45_f64.ln()),
            ln: [promised + 0.0511, 0.0, 0.0, 0.0],
            threshold: (n as f64 * 0.618).fract(),
            near: false,
        };
        let places: Vec<Place> = (0..1000).map(place).collect();
        let classes = Classes::OneEach { alike: false };
        let (lattice, keys, distinct) = Lattice::finest(&answers, &classes, &places, 4096);
        assert_eq!(distinct.len(), 2);
        let laid: Vec<f64> = keys.iter().map(|key| lattice.ln_albedo(key)[0] - promised).collect();
        assert!(laid.iter().all(|ln| (ln - 0.0511).abs() <= 0.0025), "{laid:?}");
        let mean = laid.iter().sum::<f64>() / laid.len() as f64;
        assert!((mean - 0.0511).abs() < 1e-4, "{mean}");
        assert!(keys.windows(2).all(|pair| pair[0].half_mm() == pair[1].half_mm()));
    }
}
