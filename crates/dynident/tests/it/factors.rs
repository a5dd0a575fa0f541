//! Logs as factors: the model equals that of the logs, corrupt files are rejected, and merging does not depend on
//! order.

use crate::common::repository;
use dynident::{
    Error, Factors, FactorsError, ReduceSettings, RunOptions, Silent, Study, factors_errors, identify,
    identify_factors, reduce,
};
use sha2::{Digest, Sha256};
use std::path::{Path, PathBuf};

fn options() -> RunOptions<'static> {
    RunOptions { data: None, threads: 2, progress: &Silent }
}

/// The UR10 example with all settings of rows stated.
fn study() -> (Study, PathBuf) {
    let path = repository("examples/ur10_simulated.toml");
    let mut study = Study::load(&path).unwrap();
    let stated = r#"{"differentiator": {"method": "butterworth", "order": 4, "cutoff_hz": 8.0}, "torque_lag_s": 0.0}"#;
    study.motion = serde_json::from_str(stated).unwrap();
    study.drive.friction = Some(dynident::study::FrictionChoice::Stated);
    study.drive.drive_inertia = Some(true);
    study.estimator.method = dynident::study::EstimatorMethod::Weighted;
    (study, path)
}

fn reduced(segments: usize) -> Factors {
    let (study, path) = study();
    let settings = ReduceSettings { segments, arm: Some("a".to_owned()), ..ReduceSettings::default() };
    reduce(&study, &path, None, &settings, &options()).unwrap()
}

#[test]
fn the_model_of_factors_is_that_of_the_logs() {
    let (study, path) = study();
    let of_logs = identify(&study, &path, &options()).unwrap();
    let factors = Factors::from_bytes(&reduced(64).to_bytes().unwrap()).unwrap();
    let of_factors = identify_factors(&factors, &options()).unwrap();
    let json = |found: &dynident::IdentificationOutcome| serde_json::to_value(&found.result.base_parameters).unwrap();
    assert_eq!(json(&of_factors), json(&of_logs));
    assert_eq!(of_factors.result.base_parameter_covariance, of_logs.result.base_parameter_covariance);
    assert_eq!(of_factors.inertials, of_logs.inertials);
    assert_eq!(of_factors.result.training.relative_error_percent, of_logs.result.training.relative_error_percent);
    assert!(of_factors.urdf.is_some() && of_factors.result.provenance.is_some());
    // Training error from the triangular factors, as a root of sums of squares.
    let own = factors_errors(&factors, &of_factors.result, Path::new("result.json")).unwrap();
    let expected = of_logs.result.training.relative_error_percent.unwrap();
    assert!((own[0].unwrap() - expected).abs() < 1e-9 * expected, "{own:?} {expected}");
}

/// Changed headers or numbers with a valid hash: an error or a model, never a panic.
#[test]
fn forged_files_do_no_harm() {
    let whole = reduced(2).to_bytes().unwrap();
    let contents = &whole[..whole.len() - 32];
    let mut state = 0x9E37_79B9_7F4A_7C15_u64;
    let mut draw = |below: usize| {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state % below as u64) as usize
    };
    let mut refused = 0;
    for _ in 0..300 {
        let mut forged = contents.to_vec();
        // Bytes before the header, and shapes in it, are changed more often than the rest.
        let places = [forged.len(), 64, 4000.min(forged.len())];
        let below = places[draw(3)];
        for _ in 0..=draw(3) {
            let place = draw(below);
            forged[place] = if draw(2) == 0 { b'0' + draw(10) as u8 } else { draw(256) as u8 };
        }
        if draw(4) == 0 {
            forged.truncate(draw(contents.len()));
        }
        let hash = Sha256::digest(&forged);
        forged.extend(hash);
        refused += usize::from(Factors::from_bytes(&forged).is_err());
    }
    assert!(refused > 30, "{refused}");
    assert!(Factors::from_bytes(&whole).is_ok());
}

#[test]
fn what_is_wrong_with_a_file_is_said() {
    let whole = reduced(1).to_bytes().unwrap();
    assert!(matches!(Factors::from_bytes(b"q,tau\n1,2\n"), Err(FactorsError::Kind)));
    assert!(matches!(Factors::from_bytes(&whole[..20]), Err(FactorsError::Short { bytes: 20 })));
    assert!(matches!(Factors::from_bytes(&whole[..whole.len() - 1]), Err(FactorsError::Hash)));
    let mut later = whole;
    later[16] = 9;
    assert!(matches!(Factors::from_bytes(&later), Err(FactorsError::Version { found: 9, known: 1 })));
}

#[test]
fn what_is_left_to_the_logs_is_refused_with_the_key() {
    let said = |change: &dyn Fn(&mut Study)| {
        let (mut study, path) = study();
        change(&mut study);
        match reduce(&study, &path, None, &ReduceSettings::default(), &options()) {
            Err(error @ Error::Identification { .. }) => error.to_string(),
            other => panic!("{other:?}"),
        }
    };
    assert!(
        said(&|study| study.motion = dynident::recording::MotionSettings::default())
            .contains("motion.differentiator.cutoff_hz")
    );
    assert!(said(&|study| study.drive.friction = None).contains("drive.friction = \"stated\""));
    assert!(said(&|study| study.drive.drive_inertia = None).contains("drive.drive_inertia = true or false"));
    let huber = dynident::study::EstimatorMethod::Huber;
    assert!(said(&|study| study.estimator.method = huber).contains("estimator.method = \"huber\""));
}
