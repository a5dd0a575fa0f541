//! The figures of the excitation note: `floor ROBOT FAMILY CRITERION SECONDS`.
#![allow(missing_docs, clippy::print_stdout, clippy::unwrap_used, clippy::pedantic)]
use dynident_dynamics::*;
use dynident_excitation::criteria::*;
use dynident_excitation::families::*;
use dynident_excitation::limits::*;
use dynident_excitation::*;
use std::ops::ControlFlow;
fn main() {
    let a: Vec<String> = std::env::args().collect();
    let (robot, family, criterion, seconds) = (&a[1], &a[2], &a[3], a[4].parse::<f64>().unwrap());
    let path = format!("robots/{}.urdf", if robot == "panda" { "panda_arm7" } else { robot });
    let model = dynident_model::load_robot(&path).unwrap().model;
    let acc: &[f64] = match robot.as_str() {
        "panda" => &[15., 7.5, 10., 12.5, 15., 20., 20.],
        "ur10" => &[10., 10., 10., 15., 15., 15.],
        _ => &[10., 10., 10., 10., 15., 15., 15.],
    };
    let mut limits = Limits::from_model(&model);
    for (j, a) in limits.joints.iter_mut().zip(acc) {
        j.acceleration = Some(*a);
    }
    let set = LimitSet::new(&limits, &model).unwrap();
    let base = BaseParameters::new(&model, &[], &BaseParameterSettings::default());
    let layout = PanelLayout::new(&model, base.base_columns());
    let n = model.dof();
    let fam: Box<dyn Family> = match family.as_str() {
        "fourier5" => Box::new(Fourier::new(n, 10.0, &FourierSettings::default()).unwrap()),
        "fourier10" => {
            Box::new(Fourier::new(n, 10.0, &FourierSettings { harmonics: 10, ..Default::default() }).unwrap())
        }
        "bspline40" => {
            Box::new(BSpline::new(n, 10.0, &BSplineSettings { control_points: 40, ..Default::default() }).unwrap())
        }
        _ => panic!(),
    };
    if criterion == "time" {
        let mut random = dynident_model::sample::Random::new(1);
        let ranges: Vec<[f64; 2]> =
            model.joints().iter().map(|j| [j.limits.lower.unwrap(), j.limits.upper.unwrap()]).collect();
        let speeds: Vec<f64> = model.joints().iter().map(|j| j.limits.velocity.unwrap()).collect();
        let x = fam.random(&ranges, &speeds, &mut random);
        let times = grid(10.0, a[5].parse().unwrap());
        let mut m = Motion::default();
        let mut cot = Motion::default();
        let mut info = Information::new(&model, &layout, &vec![1.0; n], None);
        let mut ws = set.workspace();
        let mut vals = Vec::new();
        let mut grad = vec![0.0; fam.parameters()];
        fam.motion(&x, &times, &mut m);
        let d = info.of(&m, 1.0);
        set.values(&mut ws, &m, &mut vals);
        let w: Vec<f64> = vals.iter().map(|v| if *v > -0.3 { 1.0 } else { 0.0 }).collect();
        println!("active {} of {}", w.iter().filter(|x| **x > 0.0).count(), w.len());
        let time = |name: &str, f: &mut dyn FnMut()| {
            let mut best = f64::MAX;
            for _ in 0..200 {
                let t = std::time::Instant::now();
                f();
                best = best.min(t.elapsed().as_secs_f64());
            }
            println!("{name:30} {:8.1} us", 1e6 * best);
        };
        time("motion", &mut || fam.motion(&x, &times, &mut m));
        time("information", &mut || {
            info.of(&m, 1.0);
        });
        time("d-optimal", &mut || {
            DOptimal.value_and_derivative(&d);
        });
        time("cond", &mut || {
            ConditionNumber::default().value_and_derivative(&d);
        });
        let g = DOptimal.value_and_derivative(&d).unwrap().1;
        time("information pull back", &mut || {
            cot.reset(n, times.len());
            info.pull_back(&m, 1.0, &g, &mut cot);
        });
        time("limits", &mut || {
            m.q[0] += 1e-9;
            set.values(&mut ws, &m, &mut vals);
        });
        time("limits pull back", &mut || {
            cot.reset(n, times.len());
            set.pull_back(&mut ws, &m, &w, &mut cot);
        });
        time("family pull back", &mut || {
            fam.pull_back(&x, &times, &cot, &mut grad);
        });
        return;
    }
    let smooth = ConditionNumber { order: 3.0, scaled: false };
    let sharp = ConditionNumber { order: 40.0, scaled: false };
    let sharper = ConditionNumber { order: 80.0, scaled: false };
    let criteria: Vec<&dyn Criterion> =
        if criterion == "cond" { vec![&smooth, &sharp, &sharper] } else { vec![&DOptimal] };
    let task = DesignTask {
        family: &*fam,
        criteria: &criteria,
        limits: &set,
        layout: &layout,
        torque_std_nm: &vec![1.0; n],
        prior: None,
    };
    let get = |k: usize, d: usize| a.get(k).map_or(d, |x| x.parse().unwrap());
    let settings = DesignSettings {
        time_limit_s: Some(seconds),
        starts: get(5, 8),
        evaluations_per_start: get(6, 200),
        search_samples: get(7, 101),
        polish_evaluations: get(8, 200),
        rounds: get(9, 2),
        ..Default::default()
    };
    let d = design(&task, &settings, |_| ControlFlow::Continue(())).unwrap();
    println!(
        "{robot} {family} {criterion}: cond {:.2} logdet {:.1} violation {:.1e} evaluations {} in {:.2} s ({:.3} ms each)",
        sharp.figure(&d.information).unwrap_or(f64::NAN),
        -DOptimal.figure(&d.information).unwrap_or(f64::NAN),
        d.violation,
        d.evaluations,
        d.seconds,
        1e3 * d.seconds / d.evaluations as f64
    );
}
