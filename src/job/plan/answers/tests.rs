//! Answers keep what they promise, by the whole model.

use std::sync::atomic::{AtomicUsize, Ordering};

use super::{
    newton::{CLOSE, EXACT},
    *,
};
use crate::{
    optics::{FrequencyGrid, Light, MaterialSet, Transport},
    watch::Unwatched,
};

const WHITE: ResinId = ResinId(0);

/// White over support over black, or grey over support over white.
fn answers(set: &MaterialSet, layers: &[(Mixture, f64)], mixes: bool) -> Answers {
    let volumes = |channel: usize| set.resins.iter().map(|resin| resin.volumes().unwrap()[channel]).collect();
    let mut answers = Answers {
        clusters: Vec::new(),
        models: Vec::new(),
        volumes: (0..set.channels.len()).map(volumes).collect(),
        grains: set.grains,
        limits: Vec::new(),
        slot_depths: Vec::new(),
        core: set.resin("black").unwrap().0,
        min_layer_mm: 0.03,
        most_mm: 5.0,
        thin_below_mixtures: mixes,
        inks: if mixes { set.ids().filter(|id| !set[*id].print_as_background).collect() } else { Vec::new() },
    };
    answers.found(layers);
    answers
}

impl Answers {
    fn found(&mut self, layers: &[(Mixture, f64)]) {
        let top = self.top(layers);
        let model = self.model(layers, top.is_some());
        let mut base = Base { layers: layers.to_vec(), model, top, promised: Vec::new() };
        base.promised = self.albedo(&base, &base.numbers(), Below::Core);
        self.clusters.push(base);
        self.slot_depths = self.depths_of_slots();
    }

    /// One cluster of a grey over support over white.
    pub(in crate::job::plan) fn grey() -> Self {
        let set = MaterialSet::builtin("synthetic").unwrap();
        let [white, support, black] = ["white", "support", "black"].map(|name| set.resin(name).unwrap().0);
        let grey = Mixture::new([(white, 0.9), (black, 0.1)]).unwrap();
        answers(&set, &[(grey, 0.3), (support.into(), 0.8), (white.into(), 0.5)], true)
    }

    /// So many clusters, each with a top of another colour.
    pub(in crate::job::plan) fn coloured(clusters: usize) -> Self {
        let set = MaterialSet::builtin("inks-rgb-7").unwrap();
        let [white, support, inks @ ..] =
            ["white", "support", "cyan", "magenta", "yellow"].map(|name| set.resin(name).unwrap().0);
        let layers = |n: usize| {
            let share = |step: f64| 0.2 * (0.5 + n as f64 * step).fract();
            let shares = inks.into_iter().zip([0.819, 0.671, 0.550].map(share));
            let rest = 1.0 - shares.clone().map(|(_, share)| share).sum::<f64>();
            let top = Mixture::new(shares.chain([(white, rest)])).unwrap();
            [(top, 0.4), (support.into(), 0.8), (white.into(), 0.5)]
        };
        let mut all = answers(&set, &layers(0), true);
        (1..clusters).for_each(|n| all.found(&layers(n)));
        all
    }
}

/// By the whole model: what comes back of a stack, and through it.
fn total(set: &MaterialSet, stack: &Stack<Mixture>, channel: usize) -> f64 {
    let stack = stack.map(|mixture| set.mixed_volumes(mixture).unwrap()[channel]);
    let light = Transport { stack: &stack, light: Light::Diffuse, options: TransportOptions::default() };
    let light = light.spectra(&FrequencyGrid::of(vec![0.0]));
    light.reflection[0] + light.transmission[0]
}

/// A plate of an answer: its layers as far as they fit, then the core, and the same again upside down.
fn plate(answer: &Stack<Mixture>, half: f64) -> Stack<Mixture> {
    let mut left = half;
    let core = (answer.core.as_ref().unwrap(), half);
    let cut: Vec<_> = answer
        .pairs()
        .chain([core])
        .map(|(mixture, mm)| {
            let mm = mm.min(left);
            left -= mm;
            (mixture.clone(), mm)
        })
        .collect();
    Stack::new(cut.clone().into_iter().chain(cut.into_iter().rev()))
}

#[test]
fn answers_keep_their_promise() {
    for (set, mixes) in [("synthetic", false), ("synthetic", true), ("inks-rgb-7", true)] {
        let set = MaterialSet::builtin(set).unwrap();
        let [white, support, black] = ["white", "support", "black"].map(|name| set.resin(name).unwrap().0);
        let top = if mixes { Mixture::new([(white, 0.9), (black, 0.1)]).unwrap() } else { white.into() };
        let layers = [(top, 0.3), (support.into(), 0.8), (if mixes { white } else { black }.into(), 0.5)];
        let answers = answers(&set, &layers, mixes);
        let channels = set.channels.len();
        let mut questions = Vec::new();
        for half_mm in [None, Some(0.3), Some(0.6), Some(1.2)] {
            for ln in [-0.4, -0.1, 0.0, 0.1] {
                let of = |channel: usize| match half_mm {
                    None => answers.clusters[0].promised[channel].ln(),
                    Some(_) => 0.4_f64.ln(),
                };
                let ln_albedo = (0..channels).map(|channel| of(channel) + ln * (1.0 - 0.3 * channel as f64)).collect();
                questions.push(Question { cluster: 0, half_mm, ln_albedo });
            }
        }
        let found = answers.answer(&questions, &Unwatched).unwrap();
        let mut met = 0;
        for (question, answer) in questions.iter().zip(&found) {
            for channel in 0..channels {
                let whole = match question.half_mm {
                    None => total(&set, &answer.stacking, channel),
                    Some(half) => total(&set, &plate(&answer.stacking, half), channel),
                };
                assert!((whole - answer.albedo[channel]).abs() < 4e-3, "{question:?} {channel}: {whole} {answer:?}");
                let short = question.ln_albedo[channel] - answer.albedo[channel].ln();
                assert!((short - answer.short[channel]).abs() < 1e-9);
                met += usize::from(short.abs() < CLOSE);
            }
        }
        // Thin plates of resins by themselves cannot be all there is.
        let least = if mixes { questions.len() * channels * 9 / 10 } else { questions.len() * channels / 2 };
        assert!(met >= least, "{met} of {} met in {}", questions.len() * channels, set.name);
    }
}

/// A top layer that is full of inks still becomes darker: of one ink more, of another less.
#[test]
fn a_full_layer_gives_one_inks_place_to_another() {
    let set = MaterialSet::builtin("inks-rgb-7").unwrap();
    let of = |names: &[(&str, f64)]| {
        Mixture::new(names.iter().map(|(name, share)| (set.resin(name).unwrap().0, *share))).unwrap()
    };
    let top = of(&[("clear", 0.61), ("magenta", 0.17), ("black", 0.135), ("yellow", 0.08), ("white", 0.005)]);
    let answers = answers(&set, &[(top, 0.479), (of(&[("white", 1.0)]), 4.5)], true);
    let mut questions = Vec::new();
    for half_mm in [0.212, 0.3, 0.424] {
        for [r, g, b] in [[0.268, 0.146, 0.084], [0.342, 0.196, 0.098], [0.436, 0.227, 0.131], [0.55, 0.33, 0.2]] {
            questions.push(Question { cluster: 0, half_mm: Some(half_mm), ln_albedo: vec![r, g, b] });
        }
    }
    questions.iter_mut().for_each(|question| question.ln_albedo.iter_mut().for_each(|albedo| *albedo = albedo.ln()));
    let found = answers.answer(&questions, &Unwatched).unwrap();
    for (question, answer) in questions.iter().zip(&found) {
        println!("{:?} {:?} {:?} {:?}", question.half_mm, answer.short, answer.albedo, answer.stacking.layers);
        let far = answer.short.iter().fold(0.0, |far: f64, short| far.max(short.abs()));
        // The thinnest cannot be as dark as all of these.
        assert!(far < 0.05 || question.half_mm == Some(0.212), "{question:?} {answer:?}");
    }
}

/// Whatever darkness is asked for: one voxel of the resin in the top layer of one label, and the limit would push the
/// top layers of all aside.
#[test]
fn resins_with_limits_stay_out_of_the_top_layer() {
    let set = MaterialSet::builtin("inks-rgb-7").unwrap();
    let [white, yellow, black] = ["white", "yellow", "black"].map(|name| set.resin(name).unwrap().0);
    let top = Mixture::new([(white, 0.9), (yellow, 0.1)]).unwrap();
    let mut answers = answers(&set, &[], true);
    answers.limits = vec![ResinLimit::NONE; set.resins.len()];
    answers.limits[black.0].min_depth_mm = 0.3;
    answers.found(&[(top, 0.35), (white.into(), 0.5)]);
    for half_mm in [None, Some(0.3), Some(0.6)] {
        let ln_albedo = answers.promised(1).iter().map(|albedo| (0.4 * albedo).ln()).collect();
        let found = answers.answer(&[Question { cluster: 1, half_mm, ln_albedo }], &Unwatched).unwrap();
        let (mixture, _) = found[0].stacking.pairs().next().unwrap();
        assert!(mixture.share(black) == 0.0 && mixture.share(yellow) > 0.1, "{found:?}");
    }
}

/// A slot that has a resin with a `min-depth-mm` in one stacking begins there in all: means of two stackings must keep
/// the limit, and what is pushed aside for it is not what was promised.
#[test]
fn slots_begin_below_the_limits_of_all_stackings() {
    let set = MaterialSet::builtin("inks-rgb-7").unwrap();
    let [white, yellow, black] = ["white", "yellow", "black"].map(|name| set.resin(name).unwrap().0);
    let top = || Mixture::new([(white, 0.9), (yellow, 0.1)]).unwrap();
    let mut answers = answers(&set, &[(top(), 0.35), (white.into(), 0.5)], true);
    answers.limits = vec![ResinLimit::NONE; set.resins.len()];
    answers.limits[black.0].min_depth_mm = 0.3;
    answers.found(&[(top(), 0.35), (Mixture::new([(white, 0.95), (black, 0.05)]).unwrap(), 0.5)]);
    let ln_albedo = answers.promised(0).iter().map(|albedo| albedo.ln()).collect();
    let found = answers.answer(&[Question { cluster: 0, half_mm: Some(0.212), ln_albedo }], &Unwatched).unwrap();
    assert!(found[0].stacking.layers[0].thickness_mm >= 0.3 - 1e-6, "{found:?}");
}

#[test]
fn what_is_asked_for_as_it_is_stays_bit_for_bit() {
    let set = MaterialSet::builtin("synthetic").unwrap();
    let layers = [(Mixture::from(WHITE), 0.3), (set.resin("support").unwrap().0.into(), 0.8)];
    for mixes in [false, true] {
        let answers = answers(&set, &layers, mixes);
        let ln_albedo = vec![answers.promised(0)[0].ln()];
        let question = Question { cluster: 0, half_mm: None, ln_albedo };
        let found = answers.answer(&[question], &Unwatched).unwrap();
        assert_eq!(found[0].stacking, answers.stacking(0));
    }
}

/// One after the other from their neighbours: a ladder of factors makes a ladder of layers.
#[test]
fn answers_of_a_ladder_rise_with_it() {
    let set = MaterialSet::builtin("synthetic").unwrap();
    let support = set.resin("support").unwrap().0;
    let layers = [(Mixture::from(WHITE), 0.3), (support.into(), 0.8), (Mixture::from(WHITE), 0.5)];
    let answers = answers(&set, &layers, true);
    let ln_albedo = |n: i32| vec![0.4_f64.ln() + 0.02 * f64::from(n)];
    let question = |n: i32| Question { cluster: 0, half_mm: Some(0.6), ln_albedo: ln_albedo(n) };
    let questions: Vec<_> = (-30..=5).map(question).collect();
    let found = answers.answer(&questions, &Unwatched).unwrap();
    assert!(found.windows(2).all(|pair| pair[0].albedo[0] < pair[1].albedo[0]));
    for pair in found.windows(2) {
        let apart =
            |n: usize| (pair[0].stacking.layers[n].thickness_mm / pair[1].stacking.layers[n].thickness_mm).ln().abs();
        assert!((0..3).all(|n| apart(n) < 0.15), "{pair:?}");
    }
}

/// Steps of a quarter of a percent, up and down: none is passed over.
#[test]
fn small_changes_are_answered_by_as_small_ones() {
    let answers = Answers::grey();
    let promised = answers.promised(0)[0].ln();
    let question = |n: i32| Question { cluster: 0, half_mm: None, ln_albedo: vec![promised + 0.0025 * f64::from(n)] };
    let questions: Vec<_> = (-40..=40).map(question).collect();
    let found = answers.answer(&questions, &Unwatched).unwrap();
    assert!(found.iter().all(|answer| answer.short[0].abs() < EXACT + 1e-6), "{found:?}");
}

/// A part thinner than what was found for it, in mixtures: no core shows up where it is thicker here and there. Where
/// it must be darker than mixtures are so thin, there is a core after all, and where only pure resins may be laid.
#[test]
fn thin_parts_of_mixtures_have_no_core() {
    let set = MaterialSet::builtin("synthetic").unwrap();
    let [white, support, black] = ["white", "support", "black"].map(|name| set.resin(name).unwrap().0);
    let grey = Mixture::new([(white, 0.9), (black, 0.1)]).unwrap();
    let layers = [(grey, 0.3), (support.into(), 0.8), (white.into(), 0.5)];
    let question = |half: f64, albedo: f64| Question { cluster: 0, half_mm: Some(half), ln_albedo: vec![albedo.ln()] };
    let questions = [question(0.4, 0.15), question(0.4, 0.3), question(0.4, 0.5)];
    let mixing = answers(&set, &layers, true);
    for (answer, question) in mixing.answer(&questions, &Unwatched).unwrap().iter().zip(&questions) {
        assert!(answer.short[0].abs() < CLOSE, "{question:?}: {answer:?}");
        let mm: f64 = answer.stacking.pairs().map(|(_, mm)| mm).sum();
        assert!(mm > 0.6, "{mm} mm of {answer:?}");
        // As thick as it counts it looks as promised, over the core that is never reached.
        let whole = total(&set, &plate(&answer.stacking, 0.4), 0);
        assert!((whole - answer.albedo[0]).abs() < 4e-3, "{whole} {answer:?}");
    }
    let dark = [question(0.02, 0.03)];
    let found = mixing.answer(&dark, &Unwatched).unwrap();
    let filled = Way { below: Below::Middle(0.02), ease: 1.0 };
    let without = mixing.answer_over(&mixing.clusters[0], &[&dark[0].ln_albedo], filled, &Unwatched);
    assert!(found[0].miss() < without[0].miss(), "{found:?} {without:?}");
    assert!(found[0].stacking.pairs().map(|(_, mm)| mm).sum::<f64>() < 0.02, "{found:?}");
    let pure = answers(&set, &layers[1..], false);
    let found = pure.answer(&[question(0.4, 0.2)], &Unwatched).unwrap();
    assert!(found[0].stacking.pairs().map(|(_, mm)| mm).sum::<f64>() < 0.4, "{found:?}");
}

/// Slopes are those of the albedo itself, of endless and of thin stackings.
#[test]
fn slopes_are_those_of_the_albedo() {
    let set = MaterialSet::builtin("inks-rgb-7").unwrap();
    let [white, support, cyan, yellow] = ["white", "support", "cyan", "yellow"].map(|name| set.resin(name).unwrap().0);
    let top = Mixture::new([(white, 0.8), (cyan, 0.15), (yellow, 0.05)]).unwrap();
    let answers = answers(&set, &[(top, 0.4), (support.into(), 0.8), (white.into(), 0.5)], true);
    let base = &answers.clusters[0];
    let numbers = base.numbers();
    for below in [Below::Core, Below::CoreToMiddle(2.5), Below::CoreToMiddle(0.9), Below::Middle(2.5)] {
        let albedo = answers.albedo(base, &numbers, below);
        let slopes = answers.slopes(base, Way { below, ease: 1.0 }, &numbers, &albedo);
        for (n, slopes) in slopes.iter().enumerate() {
            let moved = |step: f64| {
                let mut moved = numbers.clone();
                base.shift(&mut moved, n, step);
                answers.albedo(base, &moved, below)
            };
            // Shares begin at 0, and what is cut off has a kink.
            let step = if numbers[n] == 0.0 { [0.0, 2e-4] } else { [-1e-4, 1e-4] };
            let [less, more] = step.map(moved);
            for (channel, slope) in slopes.iter().enumerate() {
                let seen = (more[channel] / less[channel]).ln() / 2e-4;
                assert!((slope - seen).abs() < 1e-3 * seen.abs() + 1e-5, "{below:?} {n} {channel}: {slope} {seen}");
            }
        }
    }
}

/// What no top layer makes dark enough in a thin place is the top layer throughout; what can be reached keeps its
/// layers.
#[test]
fn thin_places_that_are_too_light_are_of_the_top_throughout() {
    let set = MaterialSet::builtin("synthetic").unwrap();
    let [white, support, black] = ["white", "support", "black"].map(|name| set.resin(name).unwrap().0);
    let top = Mixture::new([(white, 0.6), (black, 0.4)]).unwrap();
    let answers = answers(&set, &[(top, 0.25), (support.into(), 0.1), (white.into(), 0.25)], true);
    for (half_mm, albedo, filled) in [(Some(0.2), 0.02, true), (Some(0.4), 0.25, false), (None, 0.02, false)] {
        let question = Question { cluster: 0, half_mm, ln_albedo: vec![f64::ln(albedo)] };
        let answer = &answers.answer(&[question], &Unwatched).unwrap()[0];
        let [first, rest @ ..] = answer.stacking.layers.as_slice() else { panic!("{answer:?}") };
        assert_eq!(rest.iter().all(|layer| layer.thickness_mm == 0.0), filled, "{half_mm:?} {answer:?}");
        assert!(!filled || first.thickness_mm > 0.5 && first.resin.share(black) > 0.99, "{answer:?}");
    }
}

/// Asked to be darker than its inks can make it, a top layer over black does not shrink to a veil that voxels do not
/// hold.
#[test]
fn top_layers_stay_as_thick_as_voxels_hold() {
    let set = MaterialSet::builtin("inks-rgb-7").unwrap();
    let [black, cyan, magenta, clear] = ["black", "cyan", "magenta", "clear"].map(|name| set.resin(name).unwrap().0);
    let top = Mixture::new([(black, 0.61), (cyan, 0.29), (magenta, 0.1)]).unwrap();
    let answers = answers(&set, &[(top, 0.25)], true);
    let promised = answers.promised(0).to_vec();
    for (half_mm, least) in [(None, 0.2), (Some(2.0), 0.2), (Some(0.2), 0.13)] {
        let ln_albedo = promised.iter().zip([0.85, 0.88, 0.95]).map(|(albedo, by)| f64::ln(albedo * by)).collect();
        let answer = &answers.answer(&[Question { cluster: 0, half_mm, ln_albedo }], &Unwatched).unwrap()[0];
        let top = &answer.stacking.layers[0];
        assert!(top.thickness_mm >= least && top.resin.share(clear) == 0.0, "{half_mm:?} {answer:?}");
    }
}

/// Asked to be lighter than layers of the thickness that a job allows can be, they stay as thick.
#[test]
fn layers_come_to_no_more_than_they_may() {
    let set = MaterialSet::builtin("synthetic").unwrap();
    let support = set.resin("support").unwrap().0;
    for layers in [vec![(WHITE.into(), 0.8)], vec![(WHITE.into(), 0.3), (support.into(), 0.3), (WHITE.into(), 0.3)]] {
        let mut answers = answers(&set, &layers, false);
        let lighter = answers.promised(0)[0].ln() + 0.3;
        let mut thickness = |most_mm: f64| {
            answers.most_mm = most_mm;
            let question = Question { cluster: 0, half_mm: None, ln_albedo: vec![lighter] };
            let answer = answers.answer(&[question], &Unwatched).unwrap().remove(0);
            answer.stacking.layers.iter().map(|layer| layer.thickness_mm).sum::<f64>()
        };
        assert!(thickness(5.0) > 1.1 && thickness(1.0) <= 1.0 + 1e-6, "{} {}", thickness(5.0), thickness(1.0));
    }
    // No layer rises above its depth for it.
    let layers = [(WHITE.into(), 0.6), (support.into(), 0.3)];
    let mut answers = answers(&set, &layers, false);
    answers.limits = set
        .ids()
        .map(|id| ResinLimit { min_depth_mm: if id == support { 0.5 } else { 0.0 }, min_mm: 0.2, ..ResinLimit::NONE })
        .collect();
    answers.slot_depths = answers.depths_of_slots();
    answers.most_mm = 0.6;
    let mut numbers = vec![0.9, 0.7];
    answers.keep_limits(&answers.clusters[0], Below::Core, &mut numbers);
    assert!(numbers.iter().zip([0.5, 0.2]).all(|(found, least)| (found - least).abs() < 1e-9), "{numbers:?}");
}

/// Thousands of questions about one cluster and thickness are one run: a stop does not wait for all of them.
#[test]
fn a_stop_is_heeded_between_questions_of_one_run() {
    #[derive(Default)]
    struct StopsAtThird(AtomicUsize);
    impl Watch for StopsAtThird {
        fn stop_requested(&self) -> bool {
            self.0.fetch_add(1, Ordering::Relaxed) >= 2
        }
    }
    let set = MaterialSet::builtin("synthetic").unwrap();
    let [white, support] = ["white", "support"].map(|name| Mixture::from(set.resin(name).unwrap().0));
    let answers = answers(&set, &[(white.clone(), 0.3), (support, 0.8), (white, 0.5)], true);
    let ln_albedos = (0..50).map(|n| vec![-0.5 - 0.01 * f64::from(n)]);
    let questions: Vec<_> = ln_albedos.map(|ln_albedo| Question { cluster: 0, half_mm: None, ln_albedo }).collect();
    let watch = StopsAtThird::default();
    assert_eq!(answers.answer_run(&questions, &watch).len(), 2);
    assert_eq!(answers.answer(&questions, &watch), Err(Stopped));
}

/// A minimum that the job states holds for what becomes of a stacking too.
#[test]
fn a_stated_minimum_is_kept_below_mixtures() {
    let set = MaterialSet::builtin("synthetic").unwrap();
    let [white, support, black] = ["white", "support", "black"].map(|name| set.resin(name).unwrap().0);
    let grey = Mixture::new([(white, 0.9), (black, 0.1)]).unwrap();
    let mut answers = answers(&set, &[(grey, 0.3), (support.into(), 0.12), (white.into(), 0.5)], true);
    answers.min_layer_mm = 0.12;
    let questions: Vec<_> = [0.1, 0.2, 0.3, 0.45, 0.6]
        .into_iter()
        .flat_map(|albedo: f64| {
            [None, Some(0.4)].map(|half_mm| Question { cluster: 0, half_mm, ln_albedo: vec![albedo.ln()] })
        })
        .collect();
    let thinnest = |answers: &Answers| {
        let found =
            questions.iter().flat_map(|question| answers.answer_run(std::slice::from_ref(question), &Unwatched));
        found.flat_map(|answer| answer.stacking.pairs().map(|(_, mm)| mm).collect::<Vec<_>>()).fold(1.0, f64::min)
    };
    assert!(thinnest(&answers) < 0.119, "nothing to keep");
    answers.thin_below_mixtures = false;
    assert!(thinnest(&answers) >= 0.12 - 1e-9, "{}", thinnest(&answers));
}
