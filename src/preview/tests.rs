//! Whole previews of shapes that are known exactly.

use std::sync::LazyLock;

use glam::{DVec3, UVec3};
use rayon::prelude::*;

use super::{
    enclosed::mark_enclosed,
    march::{Hit, Scene, View},
    section::Section,
    style::{PAGE, SUPPORT},
    volume::Volume,
    *,
};
use crate::{
    slice::{RowBuffers, encode_rgba},
    voxel::{BRICK_VOXELS, Lattice},
    watch::Unwatched,
};

fn materials() -> Vec<PreviewMaterial> {
    let material = |id, name: &str, rgba| PreviewMaterial { id: MaterialId(id), name: name.into(), rgba };
    vec![
        material(1, "white", [255, 255, 255, 255]),
        material(2, "support", [0, 0, 0, 0]),
        material(3, "black", [20, 20, 22, 255]),
    ]
}

fn lattice(pitch: [f64; 3], dims: [u32; 3]) -> Lattice {
    Lattice { origin: DVec3::ZERO, pitch: pitch.into(), dims }
}

/// Fills a slab from a function of the voxel's centre.
fn fill(slab: &mut Slab, id: impl Fn(DVec3) -> u8 + Sync) {
    let (shape, lattice) = (slab.shape(), *slab.lattice());
    slab.blocks_mut().for_each(|(first, block)| {
        for brick in 0..shape.bricks() {
            let [nx, ny, _] = shape.0;
            let at = UVec3::new((brick % nx) as u32, (brick / nx % ny) as u32, (brick / (nx * ny)) as u32) * 8;
            let voxel = |n: usize| at + UVec3::new((n % 8) as u32, (n / 8 % 8) as u32, (n / 64) as u32);
            let ids: [u8; BRICK_VOXELS] =
                std::array::from_fn(|n| id(lattice.centre((UVec3::from(first) + voxel(n)).to_array())));
            *block.dense_mut(brick) = ids;
        }
    });
}

fn build(lattice: Lattice, id: impl Fn(DVec3) -> u8 + Sync, slabs: impl Iterator<Item = u32>) -> PreviewBuilder {
    let mut builder = PreviewBuilder::new(&lattice, &materials());
    let mut slab = Slab::new(lattice);
    for index in slabs {
        slab.reset(index);
        fill(&mut slab, &id);
        builder.observe(&slab);
    }
    builder
}

fn pictures(lattice: Lattice, id: impl Fn(DVec3) -> u8 + Sync) -> Vec<PreviewFile> {
    build(lattice, id, 0..Slab::count(&lattice)).finish(None).unwrap()
}

/// Width, height and RGB of a picture.
fn decode(file: &PreviewFile) -> (usize, usize, Vec<[u8; 3]>) {
    let mut reader = png::Decoder::new(std::io::Cursor::new(&file.png)).read_info().unwrap();
    let mut bytes = vec![0; reader.output_buffer_size().unwrap()];
    let info = reader.next_frame(&mut bytes).unwrap();
    (info.width as usize, info.height as usize, bytes.as_chunks::<3>().0.to_vec())
}

fn layered(depth: f64) -> u8 {
    match depth {
        d if d < 0.0 => 0,
        d if d < 0.5 => 1,
        d if d < 1.5 => 2,
        _ => 3,
    }
}

fn ball(p: DVec3) -> u8 {
    layered(4.0 - p.distance(DVec3::splat(4.0)))
}

const BALL: ([f64; 3], [u32; 3]) = ([0.05, 0.1, 0.04], [160, 80, 200]);

fn in_pool<T: Send>(threads: usize, work: impl FnOnce() -> T + Send) -> T {
    rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap().install(work)
}

/// The pictures of the ball, made by one thread.
static BALL_PICTURES: LazyLock<Vec<PreviewFile>> =
    LazyLock::new(|| in_pool(1, || pictures(lattice(BALL.0, BALL.1), ball)));

#[test]
fn neither_threads_nor_the_order_of_slabs_matter() {
    let lattice = lattice(BALL.0, BALL.1);
    let slabs = Slab::count(&lattice);
    assert!(slabs > 1);
    assert!(in_pool(3, || build(lattice, ball, (0..slabs).rev()).finish(None).unwrap()) == *BALL_PICTURES);
}

#[test]
fn the_pictures_of_a_ball_show_its_layers() {
    let (film, files) = BALL_PICTURES.split_last().unwrap();
    let strip = FilmStrip::of(&lattice(BALL.0, BALL.1));
    let (width, height, pixels) = decode(film);
    assert_eq!((film.path.as_str(), strip.columns), (FILM_STRIP, 8));
    assert_eq!([width, height], [strip.columns * strip.pixels[0], strip.rows * strip.pixels[1]]);
    // The middle of the frame in the middle of the height is core, that of the lowest one is the shell.
    let middle = |frame: usize| {
        let [x, y] = [frame % strip.columns, frame / strip.columns];
        let [x, y] = [x * strip.pixels[0] + strip.pixels[0] / 2, y * strip.pixels[1] + strip.pixels[1] / 2];
        pixels[x + width * y]
    };
    assert!(middle(strip.frames / 2).iter().all(|&c| c < 26) && middle(0).iter().all(|&c| c > 200));
    let names: Vec<_> = files.iter().map(|file| file.path.as_str()).collect();
    assert_eq!(names[..3], ["preview/slices.png", "preview/cuts.png", "preview/cutaway.png"]);
    assert!(names[3..].iter().all(|name| name.starts_with("preview/slice_")) && names.len() == 6);
    for file in files {
        let (width, height, pixels) = decode(file);
        assert!(width <= 1920 && height <= 1200, "{} {width} {height}", file.path);
        let part = |test: fn(&[u8; 3]) -> bool| pixels.iter().filter(|p| test(p)).count() as f64 / pixels.len() as f64;
        let core = !file.path.contains("slice_");
        assert!(!core || part(|p| p.iter().all(|&c| c < 26)) > 0.03, "black in {}", file.path);
        assert!(part(|p| p.iter().all(|&c| c > 240)) > 0.01, "white in {}", file.path);
        let amber = |p: &[u8; 3]| i32::from(p[0]) - i32::from(p[2]) > 40;
        assert!(part(amber) > 0.02, "support in {}", file.path);
        assert_eq!(pixels[0], PAGE);
    }
}

#[test]
fn slices_have_their_physical_shape() {
    // Voxels four times as long in y as in x: a square of 8 × 8 mm is 160 × 40 voxels.
    let lattice = lattice([0.05, 0.2, 0.1], [160, 40, 3]);
    let section = {
        let mut section = Section::new(&lattice, 2, 1, 2000, |k| k);
        let mut slab = Slab::new(lattice);
        fill(&mut slab, |p| u8::from(p.x > 2.0 && p.x < 6.0 && p.y > 6.0));
        section.observe(&slab, &slab.slices(), 160);
        section
    };
    assert_eq!(section.pixels, [160, 160]);
    assert_eq!([section.at(3.0, 7.0), section.at(3.0, 5.9), section.at(1.9, 7.0), section.at(-0.1, 7.0)], [1, 0, 0, 0]);
    // Row 0 holds the largest y.
    assert_eq!(section.ids[80], 1);
}

#[test]
fn volumes_are_estimated_well() {
    let lattice = lattice(BALL.0, BALL.1);
    let volumes = build(lattice, ball, 0..Slab::count(&lattice)).volume.volumes();
    let ball = |radius: f64| 4.0 / 3.0 * std::f64::consts::PI * radius.powi(3);
    let exact = [ball(4.0) - ball(3.5), ball(3.5) - ball(2.5), ball(2.5)];
    assert!((volumes.iter().sum::<f64>() / ball(4.0) - 1.0).abs() < 0.01);
    for (found, exact) in volumes[1..].iter().zip(exact) {
        assert!((found / exact - 1.0).abs() < 0.05, "{found} {exact}");
    }
}

#[test]
fn rays_meet_faces_and_surfaces_where_they_are() {
    let lattice = lattice(BALL.0, BALL.1);
    let mut slab = Slab::new(lattice);
    let mut volume = Volume::new(&lattice, |k| k);
    let mut faces = [0, 1].map(|axis| Section::new(&lattice, axis, lattice.dims[axis] / 2, 2000, |k| k));
    for index in 0..Slab::count(&lattice) {
        slab.reset(index);
        fill(&mut slab, ball);
        volume.observe(&slab, &slab.slices(), 160);
        faces.iter_mut().for_each(|face| face.observe(&slab, &slab.slices(), 160));
    }
    let scene = Scene::new(&volume, [&faces[0], &faces[1]], [4.0, 4.0]);
    let view = View::new(-58_f64.to_radians(), 27_f64.to_radians());
    // A point of each face, seen through the quarter that is taken out.
    for (place, axis, id) in
        [(DVec3::new(4.0, 2.0, 4.0), 0, 3), (DVec3::new(7.0, 4.0, 4.0), 1, 2), (DVec3::new(7.8, 4.0, 4.0), 1, 1)]
    {
        let (height, hit) = scene.hit(place, &view).unwrap();
        assert_eq!(hit, Hit::Face { axis, id });
        assert!(height.abs() < 1e-9);
    }
    // Points of the sphere that face the camera, outside of the quarter.
    let centre = DVec3::splat(4.0);
    for direction in [DVec3::new(-0.4, -0.8, 0.4), DVec3::new(-0.1, -0.2, 0.9), DVec3::new(0.7, 0.3, 0.5)] {
        let normal = direction.normalize();
        let place = centre + 4.0 * normal;
        let (height, hit) = scene.hit(place, &view).unwrap();
        let found = place + view.toward * height;
        assert_eq!(hit, Hit::Surface);
        assert!((found.distance(centre) - 4.0).abs() < 0.06, "{}", found.distance(centre));
        assert!(scene.normal(found).dot(normal) > 5_f64.to_radians().cos(), "{} {normal}", scene.normal(found));
    }
    assert_eq!(scene.hit(centre + 4.2 * view.right, &view), None);
}

/// Pictures of a lattice that is full of white, bounded and without panic.
fn full(pitch: [f64; 3], dims: [u32; 3]) {
    for file in pictures(lattice(pitch, dims), |_| 1) {
        let (width, height, pixels) = decode(&file);
        assert!(width <= 1920 && height <= 1400, "{dims:?} {} {width} {height}", file.path);
        assert!(pixels.iter().any(|p| p.iter().all(|&c| c > 240)), "{dims:?} {} shows the white", file.path);
    }
}

#[test]
fn one_voxel() {
    full([0.04, 0.08, 0.03], [1, 1, 1]);
}

#[test]
fn a_flat_lattice() {
    full([0.1, 0.1, 0.01], [700, 500, 1]);
}

#[test]
fn a_tall_lattice() {
    full([0.04, 0.08, 0.03], [1, 2, 6000]);
}

#[test]
fn a_long_lattice() {
    full([0.04, 0.08, 0.03], [20_000, 1, 1]);
}

#[test]
fn nothing_but_background() {
    for file in pictures(lattice([0.1; 3], [50, 40, 30]), |_| 0) {
        let (_, _, pixels) = decode(&file);
        assert!(pixels.iter().all(|p| *p != SUPPORT && *p != [255; 3]), "{}", file.path);
    }
}

#[test]
fn counts_replace_estimates() {
    let lattice = lattice([0.1; 3], [10, 10, 10]);
    let with = |counts: Option<u64>| {
        let mut builder = build(lattice, |_| 1, 0..1);
        if let Some(count) = counts {
            let mut counts = [0; 256];
            counts[1] = count;
            builder.set_counts(&counts);
        }
        builder.finish(None).unwrap()
    };
    let counted = with(Some(1000));
    assert_ne!(counted, with(None));
    assert_ne!(counted, with(Some(500)));
}

#[test]
fn enclosed_background_is_what_no_path_leaves() {
    let picture = [
        "..........", //
        ".#####..#.",
        ".#...#.#.#",
        ".#.#.##.#.",
        ".#.#......",
        ".###.####.",
        ".....#..#.",
        ".....####.",
    ];
    let mut ids: Vec<u8> = picture.iter().flat_map(|row| row.bytes().map(|c| u8::from(c == b'#'))).collect();
    mark_enclosed(&mut ids, 10, 9);
    let shown: Vec<String> =
        ids.chunks(10).map(|row| row.iter().map(|&id| [".", "#", "o"][usize::from(id.min(2))]).collect()).collect();
    // Corners do not join: the pixel between the four on the right is enclosed.
    assert_eq!(shown[2], ".#...#.#o#");
    assert_eq!(shown[6], ".....#oo#.");
    assert_eq!(ids.iter().filter(|&&id| id == 9).count(), 3);
}

/// Writes a job's slices as the printer takes them.
fn slices(folder: &std::path::Path, lattice: Lattice, id: impl Fn(DVec3) -> u8 + Sync) {
    let mut palette = [[0; 4]; 256];
    materials().iter().for_each(|material| palette[usize::from(material.id.0)] = material.rgba);
    std::fs::create_dir_all(folder.join("slices")).unwrap();
    let mut slab = Slab::new(lattice);
    for index in 0..Slab::count(&lattice) {
        slab.reset(index);
        fill(&mut slab, &id);
        for k in slab.slices() {
            let mut png = Vec::new();
            encode_rgba(&slab, k, &palette, &mut RowBuffers::default(), &mut [0; 256], &mut png).unwrap();
            std::fs::write(folder.join(format!("slices/slice_{k}.png")), png).unwrap();
        }
    }
}

fn same(found: &[PreviewFile], expected: &[PreviewFile]) {
    let names = |files: &[PreviewFile]| files.iter().map(|file| file.path.clone()).collect::<Vec<_>>();
    assert_eq!(names(found), names(expected));
    for (found, expected) in found.iter().zip(expected) {
        assert!(found == expected, "{} differs", found.path);
    }
}

#[test]
fn a_folder_gives_the_pictures_that_streaming_gives() {
    let folder = tempfile::tempdir().unwrap();
    let lattice = lattice(BALL.0, BALL.1);
    slices(folder.path(), lattice, ball);
    // The support is found again although its pixels are background.
    same(&from_folder(folder.path(), &lattice, &materials(), 0..lattice.dims[2], &Unwatched).unwrap(), &BALL_PICTURES);
}

#[test]
fn a_cup_is_not_full_of_support() {
    let cup = |p: DVec3| {
        let radius = p.truncate().distance(glam::DVec2::splat(4.0));
        u8::from(radius < 4.0 && (radius > 3.0 || p.z < 1.0))
    };
    let folder = tempfile::tempdir().unwrap();
    let lattice = lattice([0.1; 3], [80, 80, 60]);
    slices(folder.path(), lattice, cup);
    let (mut found, mut expected) = (
        from_folder(folder.path(), &lattice, &materials(), 0..lattice.dims[2], &Unwatched).unwrap(),
        pictures(lattice, cup),
    );
    // Cells of the wall stay a little too full, so the shaded picture is only alike.
    let (_, _, pixels) = decode(&found.remove(2));
    assert!(pixels.iter().all(|p| i32::from(p[0]) - i32::from(p[2]) < 40));
    expected.remove(2);
    // Slices to leaf through are drawn from the same cells.
    let [film, _] = [&mut found, &mut expected].map(|files| files.pop().unwrap());
    let (_, _, pixels) = decode(&film);
    assert!(pixels.iter().all(|p| i32::from(p[0]) - i32::from(p[2]) < 40));
    same(&found, &expected);
}

#[test]
fn bad_slices_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let small = lattice([0.1; 3], [8, 6, 2]);
    let error = |lattice: &Lattice, materials: &[PreviewMaterial]| {
        let error = from_folder(folder.path(), lattice, materials, 0..lattice.dims[2], &Unwatched).unwrap_err();
        (error.to_string().replace(&*folder.path().to_string_lossy(), "OUT"), error)
    };
    assert!(matches!(error(&small, &materials()).1, PreviewError::Read { .. }));
    slices(folder.path(), small, |p| if p.x > 0.3 { 3 } else { 1 });
    let (text, _) = error(&lattice([0.1; 3], [8, 7, 2]), &materials());
    assert_eq!(text, "OUT/slices/slice_0.png: found 8 × 6 pixels, expected the lattice's 8 × 7");
    let (text, _) = error(&small, &materials()[..2]);
    assert_eq!(
        text,
        "OUT/slices/slice_0.png: found the colour [20, 20, 22, 255] in column 3 of row 0, expected the RGBA of one of \
            the materials"
    );
    std::fs::write(folder.path().join("slices/slice_1.png"), "not a picture").unwrap();
    let (text, _) = error(&small, &materials());
    assert!(text.starts_with("OUT/slices/slice_1.png: found a file that cannot be decoded"), "{text}");
}

/// A film of one voxel of black on white: its outside is black, although most of every cell there is white.
#[test]
fn the_outside_of_the_cut_away_shows_the_outermost_voxels() {
    let lattice = lattice([0.05; 3], [160; 3]);
    let film = |p: DVec3| match 4.0 - p.distance(DVec3::splat(4.0)) {
        depth if depth < 0.0 => 0,
        depth if depth < 0.06 => 3,
        _ => 1,
    };
    let mut builder = PreviewBuilder::focused(&lattice, &materials(), DVec3::new(9.0, -1.0, 4.0));
    let mut voxels = crate::look::Volume::new(lattice).unwrap();
    let mut slab = Slab::new(lattice);
    for index in 0..Slab::count(&lattice) {
        slab.reset(index);
        fill(&mut slab, film);
        builder.observe(&slab);
        voxels.add(&slab);
    }
    let pictures = builder.finish(Some(&voxels)).unwrap();
    let (width, height, pixels) = decode(pictures.iter().find(|file| file.path == "preview/cutaway.png").unwrap());
    // The middle of the picture, all of which the ball fills.
    let middle = (height / 3..height / 2).flat_map(|y| (2 * width / 5..3 * width / 5).map(move |x| x + width * y));
    let bright = middle.filter(|&at| pixels[at].iter().all(|&c| c > 90)).count();
    assert_eq!(bright, 0);
}
