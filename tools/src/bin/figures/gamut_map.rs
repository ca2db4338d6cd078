//! Targets out of reach, matched as they are and brought into the gamut first: does what was distinct stay distinct?

use lumislice::{
    appearance::material_target,
    plot::{Axis, BLACK, BLUE, Figure, GREY, Panel, Series, Shape, VERMILION},
    search::{Gamut, GamutMap, Matcher, Refined, SearchError, SearchTarget, place_of},
    watch::Unwatched,
};

use super::{Options, Outcome, models::Resins};

/// Brighter and wider than the resins go, in steps.
const ALBEDO: [f64; 8] = [0.2, 0.35, 0.5, 0.6, 0.7, 0.8, 0.9, 0.98];
const MEAN_FREE_PATH_MM: [f64; 4] = [0.1, 0.2, 0.4, 1.6];
/// Two answers whose albedo and radius both differ by less than this share cannot be told apart.
const ALIKE: f64 = 0.02;

type Place = [f64; 2];

pub fn run(options: &Options) -> Outcome {
    let resins = Resins::synthetic()?;
    let grid = &resins.set.grid;
    let search = resins.options();
    let wanted: Vec<SearchTarget> = MEAN_FREE_PATH_MM
        .iter()
        .flat_map(|&path| ALBEDO.map(|albedo| material_target(&[albedo], &[path], 1, grid)))
        .collect::<Result<_, _>>()?;
    let gamut = Gamut::explore(&resins.set, &search, &Unwatched)?;
    let map = GamutMap::new(&gamut, &wanted, &vec![1.0; wanted.len()], grid);
    let mapped: Vec<_> = map.moves.iter().zip(&wanted).map(|(moved, target)| moved.apply(target, grid)).collect();
    let matcher = Matcher::new(&resins.set, &search)?;
    let refined = |targets: &[SearchTarget]| -> Result<Vec<Refined>, SearchError> {
        let found = matcher.match_targets(targets, &Unwatched)?;
        Ok(found.into_iter().filter_map(|found| found.refined).collect())
    };
    let (clipped, brought) = (refined(&wanted)?, refined(&mapped)?);

    let places = |found: &[Refined]| -> Vec<Option<Place>> {
        found.iter().map(|found| place_of(&found.reflection[0], grid)).collect()
    };
    let asked: Vec<Option<Place>> = map.moves.iter().map(|moved| moved.from[0]).collect();
    let (clipped_at, brought_at) = (places(&clipped), places(&brought));
    println!(
        "| | pairs alike, of {} | neighbours not brighter | neighbours not wider | pairs with light and dark \
            exchanged | mean objective as asked | as mapped |",
        wanted.len() * (wanted.len() - 1) / 2
    );
    println!("| --- | --- | --- | --- | --- | --- | --- |");
    let as_asked = |found: &[Refined]| mean(found.iter().zip(&wanted).map(|(found, target)| squares(found, target)));
    let as_mapped = mean(brought.iter().map(|found| found.objective));
    let line = |name: &str, at: &[Option<Place>], asked: f64, mapped: String| {
        let [albedo, width] = disorder(at);
        let exchanged = exchanged(at);
        println!("| {name} | {} | {albedo} | {width} | {exchanged} | {asked:.2e} | {mapped} |", alike(at));
    };
    line("asked for", &asked, 0.0, "–".into());
    line("clipped", &clipped_at, as_asked(&clipped), "–".into());
    line("gamut-map", &brought_at, as_asked(&brought), format!("{as_mapped:.2e}"));
    println!("\n{} of {} targets were moved", map.moved(), wanted.len());
    let figure = Figure::new("Targets out of reach: each clipped on its own, or brought into the gamut")
        .columns(2)
        .caption(resins.set.provenance.clone())
        .with(panel(&gamut, &asked, &clipped_at).title("clipped by the search"))
        .with(panel(&gamut, &asked, &brought_at).title("gamut-map"));
    for file in ["gamut-map.png", "gamut-map.svg"] {
        figure.write(&options.folder.join(file))?;
    }
    Ok(())
}

fn mean(values: impl ExactSizeIterator<Item = f64>) -> f64 {
    let n = values.len() as f64;
    values.sum::<f64>() / n
}

fn squares(found: &Refined, target: &SearchTarget) -> f64 {
    found.reflection[0].iter().zip(&target.channels[0]).map(|(r, t)| (r - t) * (r - t)).sum()
}

/// Pairs that cannot be told apart.
fn alike(places: &[Option<Place>]) -> usize {
    let near = |a: f64, b: f64| (a / b).ln().abs() < ALIKE;
    let pairs = (0..places.len()).flat_map(|i| (0..i).map(move |j| (places[i], places[j])));
    pairs.filter(|pair| matches!(pair, (Some(a), Some(b)) if near(a[0], b[0]) && near(a[1], b[1]))).count()
}

/// Neighbours along a row of one width that are not brighter, and along a column of one albedo that are not wider.
fn disorder(places: &[Option<Place>]) -> [usize; 2] {
    let at = |path: usize, albedo: usize| places[path * ALBEDO.len() + albedo];
    let wrong = |a: Option<Place>, b: Option<Place>, axis: usize| {
        usize::from(!matches!((a, b), (Some(a), Some(b)) if b[axis] > a[axis]))
    };
    let rows = (0..MEAN_FREE_PATH_MM.len()).flat_map(|path| (1..ALBEDO.len()).map(move |n| (path, n)));
    let columns = (1..MEAN_FREE_PATH_MM.len()).flat_map(|path| (0..ALBEDO.len()).map(move |n| (path, n)));
    [
        rows.map(|(path, n)| wrong(at(path, n - 1), at(path, n), 0)).sum(),
        columns.map(|(path, n)| wrong(at(path - 1, n), at(path, n), 1)).sum(),
    ]
}

/// Pairs of which the one that was to be brighter is darker by more than [`ALIKE`].
fn exchanged(places: &[Option<Place>]) -> usize {
    let wanted = |i: usize| ALBEDO[i % ALBEDO.len()];
    let pairs = (0..places.len()).flat_map(|i| (0..places.len()).map(move |j| (i, j)));
    let wrong = |&(i, j): &(usize, usize)| match (places[i], places[j]) {
        (Some(dark), Some(bright)) => wanted(i) < wanted(j) && (dark[0] / bright[0]).ln() > ALIKE,
        _ => false,
    };
    pairs.filter(wrong).count()
}

fn panel(gamut: &Gamut, asked: &[Option<Place>], found: &[Option<Place>]) -> Panel {
    let turned = |place: Place| [place[1], place[0]];
    let outline: Vec<_> = gamut.channels[0].boundary.polygon().into_iter().map(turned).collect();
    let closed: Vec<_> = outline.iter().chain(outline.first()).copied().collect();
    let axes = (Axis::log("half-energy radius [mm]").range(0.04, 10.0), Axis::linear("albedo").range(0.0, 1.0));
    let mut panel = Panel::new(axes.0, axes.1)
        .with(Series::area("gamut", outline).colour(GREY))
        .with(Series::line("", closed).colour(BLACK).size(1.2));
    let moves = asked.iter().zip(found).filter_map(|(asked, found)| Some([turned((*asked)?), turned((*found)?)]));
    for path in moves {
        panel = panel.with(Series::line("", path).colour(GREY).size(1.0));
    }
    let points =
        |places: &[Option<Place>]| -> Vec<Place> { places.iter().flatten().map(|place| turned(*place)).collect() };
    panel
        .with(Series::points("asked for", points(asked)).shape(Shape::Ring).size(7.0).colour(BLUE))
        .with(Series::points("found", points(found)).size(6.0).colour(VERMILION))
}
