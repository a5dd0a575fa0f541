//! A watcher can end a search at any time, after which little is computed. The tests count evaluations, not seconds.

use core::ops::ControlFlow;
use core::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use dynident_dynamics::{BaseParameterSettings, BaseParameters, PanelLayout};
use dynident_excitation::criteria::{Criterion, DOptimal, ValueAndGradient};
use dynident_excitation::families::{Fourier, FourierSettings};
use dynident_excitation::limits::{BoxLimit, JointLimit, LimitSet, Limits};
use dynident_excitation::optimisers::{BinaryGeneticSettings, CmaEsSettings};
use dynident_excitation::{
    DerivativeFree, DesignProgress, DesignSettings, DesignTask, Family, Motion, MotionAdjoint, design,
    design_without_gradients, single_changes,
};
use dynident_model::Model;
use dynident_model::sample::{Random, planar_2r};
use nalgebra::DMatrix;

#[derive(Debug, Default)]
struct Counter {
    ended: AtomicBool,
    evaluations: AtomicUsize,
    judged: AtomicUsize,
    drawn: AtomicUsize,
}

impl Counter {
    fn add(&self, to: &AtomicUsize) {
        to.fetch_add(usize::from(self.ended.load(Ordering::SeqCst)), Ordering::SeqCst);
    }

    fn after_end(&self) -> [usize; 3] {
        [&self.evaluations, &self.judged, &self.drawn].map(|of| of.load(Ordering::SeqCst))
    }
}

#[derive(Debug)]
struct Counted<'a>(&'a Counter);

impl Criterion for Counted<'_> {
    fn name(&self) -> &'static str {
        "counted"
    }

    fn value_and_derivative(&self, information: &DMatrix<f64>) -> ValueAndGradient {
        self.0.add(&self.0.evaluations);
        DOptimal.value_and_derivative(information)
    }

    fn figure(&self, information: &DMatrix<f64>) -> Option<f64> {
        self.0.add(&self.0.judged);
        DOptimal.figure(information)
    }

    fn fitness(&self, information: &DMatrix<f64>) -> Option<f64> {
        self.0.add(&self.0.evaluations);
        DOptimal.fitness(information)
    }

    fn scale(&self, columns: usize) -> f64 {
        DOptimal.scale(columns)
    }

    fn gradient_scale(&self, columns: usize) -> f64 {
        DOptimal.gradient_scale(columns)
    }
}

#[derive(Debug)]
struct Drawn<'a>(Fourier, &'a Counter);

impl Family for Drawn<'_> {
    fn name(&self) -> &'static str {
        self.0.name()
    }

    fn joints(&self) -> usize {
        self.0.joints()
    }

    fn duration_s(&self) -> f64 {
        self.0.duration_s()
    }

    fn parameters(&self) -> usize {
        self.0.parameters()
    }

    fn bounds(&self) -> Vec<[f64; 2]> {
        self.0.bounds()
    }

    fn random(&self, ranges: &[[f64; 2]], speeds: &[f64], random: &mut Random) -> Vec<f64> {
        self.1.add(&self.1.drawn);
        self.0.random(ranges, speeds, random)
    }

    fn motion(&self, parameters: &[f64], times_s: &[f64], out: &mut Motion) {
        self.0.motion(parameters, times_s, out);
    }

    fn apply_adjoint(&self, parameters: &[f64], times_s: &[f64], adjoint: &MotionAdjoint, gradient: &mut [f64]) {
        self.0.apply_adjoint(parameters, times_s, adjoint, gradient);
    }
}

/// Two joints; with a box that the tip cannot reach, no motion is feasible and the search runs every round.
fn arm(possible: bool) -> (Model, LimitSet) {
    let mut random = Random::new(5);
    let model = planar_2r(1.0, random.body(), random.body());
    let joint = |name: &str| JointLimit {
        joint: name.to_owned(),
        position: Some([-2.0, 2.0]),
        speed: Some(2.0),
        acceleration: Some(6.0),
        ..JointLimit::default()
    };
    let far = if possible { -10.0 } else { 5.0 };
    let boxed = BoxLimit { x_m: Some([far, 10.0]), ..BoxLimit::default() };
    let limits = Limits { joints: vec![joint("joint1"), joint("joint2")], boxes: vec![boxed], ..Limits::default() };
    let set = LimitSet::new(&limits, &model).unwrap();
    (model, set)
}

fn settings() -> DesignSettings {
    DesignSettings {
        starts: Some(6),
        rounds: Some(1),
        evaluations_per_start: Some(300),
        polish_evaluations: 400,
        search_samples: Some(48),
        ..DesignSettings::default()
    }
}

/// Runs `of` with a task whose evaluations `counter` counts.
fn with_task<T>(counter: &Counter, possible: bool, of: impl FnOnce(&DesignTask<'_>) -> T) -> T {
    let (model, set) = arm(possible);
    let family = Fourier::new(2, 6.0, &FourierSettings { harmonics: 3, ..FourierSettings::default() }).unwrap();
    let family = Drawn(family, counter);
    let base = BaseParameters::new(&model, &[], &BaseParameterSettings::default());
    let layout = PanelLayout::new(&model, base.base_columns());
    let criterion = Counted(counter);
    of(&DesignTask {
        family: &family,
        criteria: &[&criterion],
        limits: &set,
        layout: &layout,
        torque_std_nm: &[1.0, 1.0],
        prior: None,
    })
}

/// Ends a search at call number `at` of a round; returns the numbers of evaluations, assessments and draws after that.
fn after_end(round: &str, at: usize, possible: bool) -> [usize; 3] {
    let (counter, calls) = (Counter::default(), AtomicUsize::new(0));
    let watch = |progress: &DesignProgress| {
        if progress.round == round && calls.fetch_add(1, Ordering::SeqCst) + 1 >= at {
            counter.ended.store(true, Ordering::SeqCst);
        }
        if counter.ended.load(Ordering::SeqCst) { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    };
    let found = with_task(&counter, possible, |task| design(task, &settings(), watch)).unwrap();
    assert!(counter.ended.load(Ordering::SeqCst), "the round {round} was reported less than {at} times");
    assert!(found.parameters.iter().all(|p| p.is_finite()));
    assert!(!possible || found.violation <= 0.0 || round == "starts", "{round} {at}: {}", found.violation);
    counter.after_end()
}

/// One evaluation of each thread in progress and its last assessment, the short polish (60), and the loss of its
/// result.
const MAX_EVALUATIONS: usize = 80;
/// The best, its polish, and each of up to three corrections (shrinking ten times twice, ten interpolation steps).
const MAX_ASSESSMENTS: usize = 40;
/// The motion at standstill for shrinking, and the start in progress.
const MAX_DRAWS: usize = 5;

#[test]
fn a_search_ends_in_every_round() {
    let rounds = [
        ("starts", 1),
        ("starts", 40),
        ("search", 1),
        ("search", 500),
        ("restart", 30),
        ("polish", 1),
        ("polish", 200),
    ];
    for possible in [false, true] {
        for (round, at) in rounds.into_iter().filter(|(round, at)| !possible || (*round != "starts" && *at < 200)) {
            let [evaluations, judged, drawn] = after_end(round, at, possible);
            let all = format!("{round} {at} {possible}: {evaluations} {judged} {drawn}");
            assert!(evaluations <= MAX_EVALUATIONS && judged <= MAX_ASSESSMENTS && drawn <= MAX_DRAWS, "{all}");
        }
    }
    for at in [1, 50] {
        let [evaluations, judged, _] = after_end("restoration", at, false);
        assert!(evaluations <= 5 && judged <= 5, "restoration {at}: {evaluations} {judged}");
    }
}

#[test]
fn a_search_without_gradients_ends_within_a_generation() {
    let genetic = BinaryGeneticSettings { population: 100, ..BinaryGeneticSettings::default() };
    let cma = CmaEsSettings { population: Some(100), ..CmaEsSettings::default() };
    for optimiser in [DerivativeFree::Genetic(genetic), DerivativeFree::CmaEs(cma)] {
        let (counter, calls) = (Counter::default(), AtomicUsize::new(0));
        let watch = |_: &DesignProgress| {
            if calls.fetch_add(1, Ordering::SeqCst) >= 130 {
                counter.ended.store(true, Ordering::SeqCst);
            }
            if counter.ended.load(Ordering::SeqCst) { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        };
        with_task(&counter, true, |task| design_without_gradients(task, &settings(), &optimiser, watch)).unwrap();
        let [evaluations, judged, _] = counter.after_end();
        // Evaluations in progress on other threads; the best is assessed once.
        assert!(evaluations <= rayon::current_num_threads() && judged <= 1, "{optimiser:?}: {evaluations} {judged}");
    }
}

#[test]
fn a_search_for_single_changes_ends() {
    for at in [1, 2, 100] {
        let (counter, calls) = (Counter::default(), AtomicUsize::new(0));
        let looked = AtomicUsize::new(0);
        let stop = || {
            if calls.fetch_add(1, Ordering::SeqCst) + 1 >= at {
                counter.ended.store(true, Ordering::SeqCst);
                looked.fetch_add(1, Ordering::SeqCst);
            }
            counter.ended.load(Ordering::SeqCst)
        };
        let found = with_task(&counter, false, |task| {
            let start = task.family.random(&[[-1.0, 1.0]; 2], &[1.0; 2], &mut Random::new(1));
            single_changes(task, &settings(), &start, &stop)
        });
        found.unwrap();
        // One call by each of the nested loops.
        assert!(looked.load(Ordering::SeqCst) <= 8 + rayon::current_num_threads(), "{at}: {looked:?}");
    }
}
