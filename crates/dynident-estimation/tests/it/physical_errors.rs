//! Expected error of a physical fit, compared with many fits to truths drawn from the belief.

use super::common::Random;
use dynident_estimation::TriangularFactor;
use dynident_estimation::consistent::{
    BaseMap, MassPrior, PhysicalBody, PhysicalPrior, PhysicalProblem, PhysicalScalar, PhysicalSettings, expected_error,
    physical_fit, rough_body,
};
use nalgebra::{DMatrix, DVector, Matrix4};

/// Small, so that a fit is linear.
const SHARE: f64 = 0.02;
const FRICTION: f64 = 0.5;

/// Parameters of the pseudo-inertia `L (1 + s S) L` with a diagonal L and a symmetric Gaussian S.
fn drawn(reference: &[f64; 10], random: &mut Random) -> [f64; 10] {
    let [m, xx, yy, zz] = [reference[0], reference[4], reference[7], reference[9]];
    let half = 0.5 * (xx + yy + zz);
    let root = Matrix4::from_diagonal(&nalgebra::Vector4::new(half - xx, half - yy, half - zz, m).map(f64::sqrt));
    let mut shape = Matrix4::identity();
    for i in 0..4 {
        for j in 0..=i {
            let entry = SHARE * random.normal() * if i == j { 1.0 } else { core::f64::consts::FRAC_1_SQRT_2 };
            shape[(i, j)] += entry;
            shape[(j, i)] = shape[(i, j)];
        }
    }
    let p = root * shape * root;
    let trace = p[(0, 0)] + p[(1, 1)] + p[(2, 2)];
    let moment = |k: usize| trace - p[(k, k)];
    let [ixy, ixz, iyz] = [p[(0, 1)], p[(0, 2)], p[(1, 2)]].map(|product| -product);
    [p[(3, 3)], p[(0, 3)], p[(1, 3)], p[(2, 3)], moment(0), ixy, ixz, moment(1), iyz, moment(2)]
}

/// One body and one friction with five identifiable combinations; errors are twice as large as the weights assume.
#[test]
fn errors_of_many_fits_are_as_expected() {
    let mut random = Random::new(71);
    let reference = rough_body(2.0, 0.3);
    let units = [2.0, 0.6, 0.6, 0.6, 0.18, 0.18, 0.18, 0.18, 0.18, 0.18, FRICTION];
    let (base_count, inflation) = (5, 2.0);
    let matrix = DMatrix::from_fn(base_count, 11, |_, column| random.normal() / units[column]);
    let sigma: Vec<f64> = (0..base_count).map(|row| SHARE * [0.03, 0.3, 1.0, 3.0, 0.1][row]).collect();
    let weighted = |theta: &DVector<f64>| {
        let mut panel: Vec<f64> = Vec::new();
        for column in 0..base_count {
            panel.extend((0..base_count).map(|row| if row == column { 1.0 / sigma[row] } else { 0.0 }));
        }
        panel.extend(theta.iter().zip(&sigma).map(|(value, sigma)| value / sigma));
        TriangularFactor::from_rows(base_count, &panel, base_count).unwrap()
    };
    let problem = |theta: &DVector<f64>| {
        let body =
            PhysicalBody { name: "bob".into(), reference, known: None, mass_kg: None, com_box_m: None, inside: None };
        let friction = PhysicalScalar {
            name: "fv".into(),
            lower: Some(0.0),
            upper: None,
            prior: FRICTION,
            scale: SHARE * FRICTION,
        };
        let base = BaseMap::new(matrix.clone()).unwrap();
        let problem = PhysicalProblem::new(base, vec![body], vec![friction], &weighted(theta)).unwrap();
        problem.with_mass_beliefs(vec![Some([reference[0], SHARE * reference[0]])]).unwrap()
    };
    let covariance = DMatrix::from_diagonal(&DVector::from_iterator(
        base_count,
        sigma.iter().map(|sigma| (inflation * sigma).powi(2)),
    ));
    let belief = MassPrior { body_share: SHARE, scalar_std: vec![SHARE * FRICTION] };
    for prior in [PhysicalPrior::Entropic, PhysicalPrior::Pullback, PhysicalPrior::Euclidean] {
        // Weights of the prior are in units of a whole body, not of the belief: as strong as the belief, and a fifth
        // of that.
        let weight = if prior == PhysicalPrior::Pullback { 0.2 } else { 1.0 } / (SHARE * SHARE);
        let settings = PhysicalSettings { prior, prior_weight: weight, tolerance: 1e-9, ..PhysicalSettings::default() };
        let expected = expected_error(&problem(&DVector::zeros(base_count)), &settings, &covariance, &belief).unwrap();
        let draws = 400;
        let mut squares = [0.0; 11];
        for _ in 0..draws {
            let body = drawn(&reference, &mut random);
            let friction = FRICTION * (1.0 + SHARE * random.normal());
            let truth = DVector::from_iterator(11, body.into_iter().chain([friction]));
            let noise = DVector::from_iterator(base_count, sigma.iter().map(|s| inflation * s * random.normal()));
            let fit = physical_fit(&problem(&(&matrix * &truth + noise)), &settings).unwrap();
            for k in 0..11 {
                squares[k] += (fit.parameters[k] - truth[k]).powi(2);
            }
        }
        for k in 0..11 {
            let ratio = (squares[k] / f64::from(draws)).sqrt() / expected[k];
            // The root of a mean of 400 squares has a standard deviation of 3.5 %: 4 σ plus 2 % for nonlinearity.
            assert!((ratio - 1.0).abs() < 0.16, "{prior:?}, parameter {k}: {ratio}");
        }
    }
}
