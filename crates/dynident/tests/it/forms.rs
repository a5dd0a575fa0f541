//! Exported files: each has the best drives for its bodies, and its printed error is the error of the file.

use crate::common::{Job, Motion, Random, Truth, format, header, repository, write_log};
use dynident::dynamics::{Workspace, inverse_dynamics};
use dynident::model::{Model, load_robot};
use dynident::result::{FormResult, ResultFile};
use dynident::{export_result, export_stored};
use dynident_export::Target;
use dynident_model::terms::{Coulomb, CoulombShape, MaxwellSlip, Stribeck, TermClass, TorqueTerm};
use std::path::Path;

/// Standard deviation of the torque noise, Nm.
const NOISE: f64 = 0.2;
const RATE_HZ: f64 = 100.0;
const SECONDS: f64 = 20.0;

/// One sample of the simulated log: motion and noisy torque.
struct Sample {
    motion: [Vec<f64>; 3],
    tau: Vec<f64>,
}

fn recorded(path: &Path, truth: &Truth, seed: u64) -> Vec<Sample> {
    let (mut random, motion) = (Random(1000 + seed), Motion::new(truth.drive.len(), seed));
    let mut samples: Vec<Sample> = Vec::new();
    let noisy = |q: &[f64], tau: &[f64]| {
        let tau: Vec<f64> = tau.iter().map(|tau| tau + NOISE * random.normal()).collect();
        samples.push(Sample { motion: motion.at(samples.len() as f64 / RATE_HZ), tau: tau.clone() });
        [q, &tau].concat()
    };
    write_log(path, truth, &motion, (RATE_HZ, SECONDS), &header(truth.drive.len()), noisy);
    samples
}

/// Torque of damping, Coulomb friction and drive inertia of one joint, and its residual without them.
fn rows(model: &Model, samples: &[Sample], joint: usize) -> Vec<([f64; 3], f64)> {
    let mut workspace = Workspace::new(model);
    let row = |sample: &Sample| {
        let [q, dq, ddq] = &sample.motion;
        let rigid = inverse_dynamics(model, &mut workspace, q, dq, ddq)[joint];
        ([dq[joint], dq[joint].signum(), ddq[joint]], sample.tau[joint] - rigid)
    };
    samples.iter().map(row).collect()
}

fn squares(rows: &[([f64; 3], f64)], x: [f64; 3]) -> f64 {
    rows.iter().map(|(columns, tau)| (tau - (0..3).map(|k| columns[k] * x[k]).sum::<f64>()).powi(2)).sum()
}

/// RMS error over the RMS torque, percent, over all joints.
fn error_percent(model: &Model, samples: &[Sample], drives: &[[f64; 3]]) -> f64 {
    let (mut error, mut torque) = (0.0, 0.0);
    for (joint, &x) in drives.iter().enumerate() {
        error += squares(&rows(model, samples, joint), x);
        torque += samples.iter().map(|sample| sample.tau[joint].powi(2)).sum::<f64>();
    }
    100.0 * (error / torque).sqrt()
}

fn form(result: &ResultFile, class: TermClass) -> &FormResult {
    result.forms.iter().find(|form| form.class == class).unwrap()
}

fn study(description: &Path, dof: usize, drive: &str) -> String {
    format!(
        "robot.file = {:?}\nlog = [{{ file = \"train.csv\" }}, {{ file = \"test.csv\", role = \"validate\" }}]\n\
         [parallel_filter]\nenabled = false\n[drive]\n{drive}\n{}",
        description.display().to_string(),
        format(dof)
    )
}

/// The referee knows the true motion and solves its own problem: values of the written files minimise the residual of
/// the training log, and the printed errors are those of the files on the held-out log.
#[test]
fn files_have_the_best_drives_and_their_own_error() {
    let (folder, description) = (tempfile::tempdir().unwrap(), repository("robots/ur10.urdf"));
    let truth = Truth::near(&description, 0.1, true);
    let dof = truth.drive.len();
    let train = recorded(&folder.path().join("train.csv"), &truth, 1);
    let test = recorded(&folder.path().join("test.csv"), &truth, 2);
    let found = Job::new(folder.path(), &study(&description, dof, "")).identify();

    let written = folder.path().join("identified.urdf");
    std::fs::write(&written, found.urdf.as_ref().unwrap()).unwrap();
    let urdf = load_robot(&written).unwrap().model;
    let urdf_drives: Vec<[f64; 3]> =
        urdf.joints().iter().map(|joint| [joint.damping.unwrap(), joint.friction.unwrap(), 0.0]).collect();
    let mjcf = folder.path().join("exported.xml");
    let path = folder.path().join("result.json");
    std::fs::write(&mjcf, export_stored(&found.result, &path, Target::Mjcf).unwrap().text).unwrap();
    let mujoco = load_robot(&mjcf).unwrap().model;
    let of_mjcf = |joint: &dynident_model::Joint| {
        [joint.damping.unwrap_or(0.0), joint.friction.unwrap_or(0.0), joint.drive_inertia.unwrap_or(0.0)]
    };
    let mjcf_drives: Vec<[f64; 3]> = mujoco.joints().iter().map(of_mjcf).collect();

    let forms = [
        (TermClass::DampingAndFriction, &urdf, &urdf_drives, 2),
        (TermClass::DampingFrictionAndInertia, &mujoco, &mjcf_drives, 3),
    ];
    // Differences of order 8 leave out 8 samples at either end.
    let inside = &train[8..train.len() - 8];
    let mut errors = Vec::new();
    for (class, model, drives, unknowns) in forms {
        for (joint, &x) in drives.iter().enumerate() {
            let rows = rows(model, inside, joint);
            let least = squares(&rows, x);
            // Any change of a value makes the residual larger, unless the value is at its bound of zero.
            for k in 0..unknowns {
                for step in [-0.01, 0.01] {
                    let mut other = x;
                    other[k] = (other[k] + step).max(0.0);
                    assert!(squares(&rows, other) >= least * (1.0 - 1e-9), "{class:?} joint {joint}: {x:?} {k} {step}");
                }
            }
        }
        let printed = form(&found.result, class).held_out[0].relative_error_percent.unwrap();
        let own = error_percent(model, &test, drives);
        // Derivatives of the positions are exact to 1e-6; samples at the ends of the log are not used.
        assert!((printed / own - 1.0).abs() < 0.01, "{class:?}: {printed} % printed, {own} % of the file");
        errors.push(printed);
    }
    // The torque contains drive inertia, offsets and a smooth step.
    let model = form(&found.result, TermClass::DampingAndFriction).held_out[0].model_relative_error_percent.unwrap();
    assert!(errors[0] > errors[1] && errors[1] > model, "{errors:?} and {model}");
    let code = form(&found.result, TermClass::FunctionsOfMotion);
    assert!(!code.refitted || code.held_out[0].relative_error_percent.unwrap() < 1.1 * model);
}

/// Friction with memory and under load does not prevent any export; notes name what was replaced, and the error.
#[test]
fn friction_with_memory_is_replaced_in_code() {
    let (folder, description) = (tempfile::tempdir().unwrap(), repository("robots/planar2r.urdf"));
    let truth = Truth::near(&description, 0.1, false);
    recorded(&folder.path().join("train.csv"), &truth, 1);
    recorded(&folder.path().join("test.csv"), &truth, 2);
    let drive =
        "friction = \"stated\"\nviscous = true\nlaws = [{ law = \"maxwell-slip\", yield_displacements = [0.001] }]";
    let found = Job::new(folder.path(), &study(&description, truth.drive.len(), drive)).identify();
    let path = folder.path().join("result.json");
    for target in Target::ALL {
        let exported =
            export_stored(&found.result, &path, target).unwrap_or_else(|error| panic!("{target:?}: {error}"));
        let has_error = exported.notes.iter().any(|note| note.starts_with("Held-out torque error of this file: "));
        assert_eq!(has_error, target.class().is_some(), "{target:?}: {:?}", exported.notes);
        let names_slip = exported.notes.iter().any(|note| note.contains("slip1_0.001"));
        assert_eq!(names_slip, target.class().is_some(), "{target:?}: {:?}", exported.notes);
    }
    let code = form(&found.result, TermClass::FunctionsOfMotion);
    assert!(code.refitted && code.terms.iter().all(|one| !one.term.has_memory()));
    // The function with state holds the whole model.
    let with_state = form(&found.result, TermClass::WithState);
    assert!(!with_state.refitted && with_state.has_memory() && with_state.forms.contains(&"c".to_owned()));
    let of_state = &with_state.held_out[0];
    let (own, model) = (of_state.relative_error_percent.unwrap(), of_state.model_relative_error_percent.unwrap());
    // The same prediction, summed in another order.
    assert!((own / model - 1.0).abs() < 1e-9, "{own} and {model}");
    let c = export_stored(&found.result, &path, Target::C).unwrap();
    assert!(c.text.contains("_step(") && c.text.contains("_reset("));
    assert!(c.notes.iter().any(|note| note.starts_with("Held-out torque error of the function step: ")));
    // The true friction is a smooth step, so the step that replaces the slip is at least as good.
    let error = &code.held_out[0];
    let (form, model) = (error.relative_error_percent.unwrap(), error.model_relative_error_percent.unwrap());
    assert!(form < 1.05 * model, "{form} and {model}");
}

/// Code holds friction under load: nothing is fitted again, and the error is that of the model.
#[test]
fn friction_under_load_is_held_by_code() {
    let (folder, description) = (tempfile::tempdir().unwrap(), repository("robots/planar2r.urdf"));
    let truth = Truth::near(&description, 0.1, false);
    recorded(&folder.path().join("train.csv"), &truth, 1);
    recorded(&folder.path().join("test.csv"), &truth, 2);
    let drive = "friction = \"stated\"\nviscous = true\nlaws = [{ law = \"load\", width = 0.05 }]";
    let job = Job::new(folder.path(), &study(&description, truth.drive.len(), drive));
    let found = job.identify();
    let code = form(&found.result, TermClass::FunctionsOfMotion);
    assert!(!code.refitted && code.terms.iter().any(|one| one.term.needs_load()));
    let error = &code.held_out[0];
    let (form, model) = (error.relative_error_percent.unwrap(), error.model_relative_error_percent.unwrap());
    assert!((form / model - 1.0).abs() < 1e-9, "{form} and {model}");
    // The load is the same with and without the study.
    let path = folder.path().join("result.json");
    let stored = export_stored(&found.result, &path, Target::C).unwrap().text;
    assert!(stored.contains("_load_friction("));
    let with_study = export_result(&found.result, &path, &job.study, &job.path, None, Target::C).unwrap();
    assert_eq!(stored, with_study.text);
}

/// Two equal joints get equal steps, even if one was identified with a sign and the other with a narrow step.
#[test]
fn equal_joints_have_equal_steps() {
    let model = load_robot(repository("robots/ur10.urdf")).unwrap().model;
    let step = |joint, shape| TorqueTerm::Coulomb(Coulomb { joint, shape });
    let terms = [step(0, CoulombShape::Sign { dead_band: 0.01 }), step(1, CoulombShape::Smooth { width: 1.2e-4 })];
    for class in [TermClass::FunctionsOfMotion, TermClass::WithState] {
        let widths = [0, 1].map(|joint| class.terms_of_joint(&model, &terms, joint)[0][0].step_width().unwrap());
        assert!(widths[0] == widths[1] && widths[0] > 1e-3 && widths[0] < 5e-3, "{widths:?}");
        let wide = step(2, CoulombShape::Smooth { width: 0.3 });
        assert_eq!(class.in_form(&model, &wide), wide);
    }
}

/// Friction with memory is replaced by viscous and Coulomb friction, also next to a Stribeck term, whose step would
/// otherwise be the only one.
#[test]
fn friction_with_memory_is_replaced_next_to_other_steps() {
    let model = load_robot(repository("robots/ur10.urdf")).unwrap().model;
    let narrow = CoulombShape::Smooth { width: 0.03 };
    let slip = TorqueTerm::MaxwellSlip(MaxwellSlip { joint: 0, yield_displacement: 0.01 });
    let stribeck = TorqueTerm::Stribeck(Stribeck { joint: 0, speed: 0.1, exponent: 1.0, shape: narrow });
    let coulomb = |width| TorqueTerm::Coulomb(Coulomb { joint: 0, shape: CoulombShape::Smooth { width } });
    let class = TermClass::FunctionsOfMotion;
    for own in [vec![stribeck.clone(), slip.clone()], vec![coulomb(0.03), slip.clone()]] {
        let lists = class.terms_of_joint(&model, &own, 0);
        let mut widths = Vec::new();
        for list in &lists {
            let is_coulomb = |term: &&TorqueTerm| matches!(term, TorqueTerm::Coulomb(_));
            assert_eq!(list.iter().filter(is_coulomb).count(), 1, "{list:?}");
            assert!(list.iter().any(|term| matches!(term, TorqueTerm::Viscous(_))), "{list:?}");
            assert!(!list.iter().any(TorqueTerm::has_memory) && own.contains(&stribeck) == list.contains(&stribeck));
            widths.push(list.iter().find(is_coulomb).unwrap().step_width().unwrap());
        }
        assert!(widths.len() >= 4 && (own.contains(&stribeck) || widths.contains(&0.03)), "{widths:?}");
        assert_eq!(TermClass::WithState.terms_of_joint(&model, &own, 0), [own]);
    }
}
