//! Laws of plots: the same bytes, nothing outside of its frame, readable by others.

use std::path::Path;

use super::{drawing::Item, drawing::Step, *};

/// Everything there is, on awkward data.
fn full() -> Figure {
    let curve = |power: f64| (0..200).map(move |i| 0.05 * f64::from(i)).map(move |r| [r, (-r).exp() / r.powf(power)]);
    let heat: Vec<f64> = (0..64 * 48).map(|i| f64::from(i % 64) * f64::from(i / 64)).collect();
    let bar = ColourBar { label: "R̂ error".into(), range: [1.0, 3000.0], scale: Scale::Log10 };
    let gap = [[0.0, 1.0], [1.0, f64::NAN], [2.0, 3.0], [1e300, -1e300], [f64::INFINITY, 0.0]];
    Figure::new("A & B <\"C\">")
        .columns(2)
        .with(
            Panel::new(Axis::linear("r [mm]"), Axis::log("R(r) [mm⁻²]").range(1e-6, 10.0))
                .title("Reflection")
                .with(Series::band("± 3 σ", curve(1.0).map(|[r, v]| [r, v * 0.3, v * 3.0])))
                .with(Series::line("white", curve(1.0)))
                .with(Series::line("support", curve(0.5)).dashed())
                .with(Series::points("photons", curve(1.0).step_by(12)).shape(Shape::Ring))
                .note(Note::new([6.0, 1.0], "T̂ ≤ 10⁻³")),
        )
        .with(
            Panel::new(Axis::linear("x"), Axis::linear("y"))
                .raster(Raster::heat_map(64, &heat, [0.0, 8.0], [-1.0, 1.0], bar))
                .with(Series::line("", [[0.0, 0.0], [4.0, 0.9], [20.0, 0.0]]).colour(RED)),
        )
        .with(Panel::new(Axis::linear(""), Axis::linear("")).with(Series::line("gaps", gap)))
        .with(Panel::new(Axis::log("nothing"), Axis::log("")).with(Series::line("none", [[0.0, -1.0]])))
        .caption("synthetic resins: no measurement of a printer")
}

#[test]
fn the_same_description_gives_the_same_bytes() {
    for format in [Format::Svg, Format::Png] {
        assert_eq!(full().encode(format).unwrap(), full().encode(format).unwrap());
    }
}

#[test]
fn lines_stay_in_their_frame() {
    let steep = Series::line("", (0..100).map(|i| [f64::from(i) - 50.0, 1e3 * f64::from(i % 7) - 2e3]));
    let panel = Panel::new(Axis::linear("").range(-10.0, 10.0), Axis::linear("").range(0.0, 1.0)).with(steep);
    let drawing = layout::lay_out(&Figure::new("").with(panel));
    let outlines: Vec<_> = drawing
        .items
        .iter()
        .filter_map(|item| if let Item::Stroke { outline, width, .. } = item { Some((outline, *width)) } else { None })
        .collect();
    let corners = |outline: &[Step]| {
        let points = outline.iter().filter_map(|step| match step {
            Step::Move(at) | Step::Line(at) => Some(*at),
            _ => None,
        });
        points.collect::<Vec<_>>()
    };
    let frame = corners(outlines.iter().find(|(outline, _)| outline.len() == 5).unwrap().0);
    let line = corners(outlines.iter().find(|(_, width)| *width == 2.0).unwrap().0);
    assert!(line.len() > 10);
    for [x, y] in line {
        assert!((frame[0][0] - 1e-9..=frame[2][0] + 1e-9).contains(&x), "{x}");
        assert!((frame[0][1] - 1e-9..=frame[2][1] + 1e-9).contains(&y), "{y}");
    }
}

#[test]
fn the_svg_is_well_formed_and_names_its_words() {
    let svg = String::from_utf8(full().encode(Format::Svg).unwrap()).unwrap();
    let mut reader = quick_xml::Reader::from_str(&svg);
    let mut depth = 0;
    loop {
        match reader.read_event().unwrap() {
            quick_xml::events::Event::Start(_) => depth += 1,
            quick_xml::events::Event::End(_) => depth -= 1,
            quick_xml::events::Event::Eof => break,
            _ => {}
        }
    }
    assert_eq!(depth, 0);
    assert!(svg.contains("<title>A &amp; B &lt;&quot;C&quot;&gt;</title>"));
    assert!(svg.contains("aria-label=\"Reflection\"") && svg.contains("aria-label=\"photons\""));
    assert!(!svg.contains("NaN") && !svg.contains("inf"));
}

#[test]
fn the_png_is_read_by_another_reader_and_has_ink() {
    let png = image::load_from_memory(&full().encode(Format::Png).unwrap()).unwrap().to_rgb8();
    assert!(png.width() > 2000 && png.height() > 1500);
    for colour in [SERIES[1], SERIES[2], RED, colour::PAPER] {
        assert!(png.pixels().filter(|pixel| pixel.0 == colour).count() > 100, "{colour:?}");
    }
}

#[test]
fn the_file_name_says_the_format() {
    assert_eq!(Format::of(Path::new("a/b.SVG")).unwrap(), Format::Svg);
    assert_eq!(Format::of(Path::new("b.png")).unwrap(), Format::Png);
    let message = |name: &str| Format::of(Path::new(name)).unwrap_err().to_string();
    assert_eq!(message("x.pdf"), "x.pdf: found .pdf, expected a file name that ends in .svg or .png");
    assert_eq!(message("svg"), "svg: found no extension, expected a file name that ends in .svg or .png");
    let folder = tempfile::tempdir().unwrap();
    let missing = folder.path().join("none/p.svg");
    assert!(matches!(full().write(&missing), Err(PlotError::Write { .. })));
}

#[test]
fn too_many_pixels_are_refused() {
    let wide = Figure::new("").panel_size(1e5, 100.0).with(Panel::new(Axis::linear(""), Axis::linear("")));
    assert!(matches!(wide.encode(Format::Png), Err(PlotError::Size { .. })));
    assert!(wide.encode(Format::Svg).is_ok());
}

/// A panel with nothing in it keeps its place, and nothing is drawn there.
#[test]
fn an_empty_panel_is_a_gap() {
    let panel = |title: &str| Panel::new(Axis::linear("x"), Axis::linear("y")).title(title);
    let figure = |middle: Panel| Figure::new("").columns(3).with(panel("a")).with(middle).with(panel("b"));
    let [gap, filled] = [panel(""), panel("c")].map(|middle| layout::lay_out(&figure(middle)));
    assert_eq!((gap.width, gap.height), (filled.width, filled.height));
    let drawn = |drawing: &drawing::Drawing| drawing.items.len();
    assert_eq!(drawn(&filled) - drawn(&gap), drawn(&filled) / 3);
}
