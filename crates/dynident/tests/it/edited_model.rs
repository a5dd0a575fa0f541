//! A written model stays right after an edit: an undeclared load is in the body that carries it.

use crate::common::{Job, Motion, Random, Truth, format, header, plain, repository, write_log};
use dynident::dynamics::{Workspace, inverse_dynamics};
use dynident::model::{InertialParameters, Mat3, Model, Vec3};
use dynident::{IdentificationOutcome, difference_words};

const ROBOT: &str = "robots/ur10.urdf";
const NOISE_NM: f64 = 0.2;
const LOAD_KG: f64 = 2.0;
const LOAD_AT_M: [f64; 3] = [0.05, 0.02, 0.10];

/// A robot equal to its description, with friction and possibly a load on a body.
fn robot(loaded: Option<usize>) -> Truth {
    let mut truth = Truth::near(&repository(ROBOT), 0.0, false);
    if let Some(body) = loaded {
        let mut bodies = truth.model.inertials().to_vec();
        let inertia = Mat3::IDENTITY.scale(LOAD_KG * 0.05 * 0.05);
        let load = InertialParameters::from_centre_of_mass(LOAD_KG, Vec3(LOAD_AT_M), &inertia);
        bodies[body] = bodies[body].plus(&load);
        truth.model = truth.model.with_inertials(&bodies).unwrap();
    }
    truth
}

fn identified(truth: &Truth) -> IdentificationOutcome {
    let folder = tempfile::tempdir().unwrap();
    let dof = truth.model.dof();
    let mut random = Random(5);
    let motion = Motion::within(&truth.model, 1.5, 5);
    write_log(&folder.path().join("log.csv"), truth, &motion, (100.0, 30.0), &header(dof), |q, tau| {
        let noisy: Vec<f64> = tau.iter().map(|tau| tau + NOISE_NM * random.normal()).collect();
        plain(q, &noisy)
    });
    let text = format!(
        "robot.file = {:?}\nlog = [{{ file = \"log.csv\" }}]\n\
         drive = {{ friction = \"stated\", viscous = true, coulomb = \"smooth\", offset = true }}\n{}",
        repository(ROBOT).display().to_string(),
        format(dof)
    );
    Job::new(folder.path(), &text).identify()
}

/// Torque error in percent of a model with other bodies, on a motion that was not recorded.
fn torque_error(model: &Model, bodies: &[InertialParameters]) -> f64 {
    let other = model.with_inertials(bodies).unwrap();
    let mut workspace = Workspace::new(model);
    let motion = Motion::within(model, 1.5, 77);
    let (mut error, mut torque) = (0.0, 0.0);
    for step in 0..500 {
        let [q, dq, ddq] = motion.at(0.02 * f64::from(step));
        let expected = inverse_dynamics(model, &mut workspace, &q, &dq, &ddq).to_vec();
        let found = inverse_dynamics(&other, &mut workspace, &q, &dq, &ddq);
        for (expected, found) in expected.iter().zip(found) {
            error += (expected - found).powi(2);
            torque += expected * expected;
        }
    }
    100.0 * (error / torque).sqrt()
}

#[test]
fn the_model_without_its_load_is_the_bare_robot() {
    let bare = robot(None).model;
    // The last body, whose mass torque determines only in sums.
    let loaded = 5;
    let found = identified(&robot(Some(loaded)));
    let result = &found.result;
    let differences = result.description_differences.as_ref().unwrap();
    assert!(differences.is_followed, "{differences:?}");
    let body = &result.bodies[loaded];
    let [mass, described] = [body.mass_kg, body.prior.unwrap()[0]];
    assert!((mass - described - LOAD_KG).abs() < 0.05 * LOAD_KG, "{}: {mass} kg", body.name);
    for (index, own) in result.bodies.iter().enumerate().filter(|(index, _)| *index != loaded) {
        let described = own.prior.unwrap()[0];
        assert!((own.mass_kg / described - 1.0).abs() < 0.05, "{index}: {} for {described} kg", own.mass_kg);
    }
    let mut edited = found.inertials.clone();
    edited[loaded] = bare.inertials()[loaded];
    let error = torque_error(&bare, &edited);
    assert!(error < 2.0, "{error} % after the edit of {}", body.name);
    // The predicted bar of that error holds.
    let restored = &differences.bodies[loaded];
    let bar = restored.error_95_percent.unwrap();
    assert!(restored.probability > 0.9 && error <= bar && bar < 5.0, "{restored:?}");
    let words = difference_words(result).join("\n");
    assert!(words.contains(&body.name) && words.contains("carries") && words.contains("Edit test"), "{words}");
    assert!(found.report().unwrap().contains("probability that a body differs from the description"));
}

/// The noise of this log hides whether the other bodies also differ, so the written model does not follow; but the body
/// is named, and the bar of the edit contains its error.
#[test]
fn a_load_on_an_inner_body_is_named() {
    let loaded = 2;
    let found = identified(&robot(Some(loaded)));
    let differences = found.result.description_differences.as_ref().unwrap();
    let likeliest = differences.bodies.iter().max_by(|a, b| a.probability.total_cmp(&b.probability)).unwrap();
    assert!(likeliest.name == found.result.bodies[loaded].name && likeliest.probability > 0.9, "{differences:?}");
    let bare = robot(None).model;
    let mut edited = found.inertials.clone();
    edited[loaded] = bare.inertials()[loaded];
    let error = torque_error(&bare, &edited);
    assert!(error <= likeliest.error_95_percent.unwrap(), "{error} %, {likeliest:?}");
}

#[test]
fn without_a_load_no_body_is_named() {
    let found = identified(&robot(None));
    let differences = found.result.description_differences.as_ref().unwrap();
    assert!(!differences.is_followed && difference_words(&found.result).is_empty(), "{differences:?}");
    assert!(differences.bodies.iter().all(|body| body.probability < 0.5), "{differences:?}");
}
