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
