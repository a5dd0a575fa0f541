//! Fits beyond physical consistency, and contradictory problems.

use dynident_estimation::TriangularFactor;
use dynident_estimation::consistent::{
    BaseMap, PhysicalBody, PhysicalError, PhysicalProblem, PhysicalScalar, PhysicalSettings, PhysicalStatus,
    physical_fit, rough_body,
};
use nalgebra::DMatrix;

fn body(name: &str) -> PhysicalBody {
    PhysicalBody {
        name: name.into(),
        reference: rough_body(1.0, 0.1),
        known: None,
        mass_kg: None,
        com_box_m: None,
        inside: None,
    }
}

fn unit_factor(columns: usize, right: &[f64]) -> TriangularFactor {
    let mut panel: Vec<f64> = DMatrix::<f64>::identity(columns, columns).iter().copied().collect();
    panel.extend(right);
    TriangularFactor::from_rows(columns, &panel, columns).unwrap()
}

fn seen(bodies: Vec<PhysicalBody>, scalars: Vec<PhysicalScalar>) -> PhysicalProblem {
    let columns = 10 * bodies.len() + scalars.len();
    let base = BaseMap::new(DMatrix::identity(columns, columns)).unwrap();
    PhysicalProblem::new(base, bodies, scalars, &unit_factor(columns, &vec![0.0; columns])).unwrap()
}

#[test]
fn the_nearest_feasible_vector_of_a_feasible_one_is_itself() {
    let own = [1.2, 0.02, 0.0, -0.01, 0.02, 0.0, 0.001, 0.025, 0.0, 0.02];
    // Rows of unit weight, one per parameter.
    let rows_of = |right: &[f64]| {
        let base = BaseMap::new(DMatrix::identity(10, 10)).unwrap();
        PhysicalProblem::new(base, vec![body("bob")], vec![], &unit_factor(10, right)).unwrap()
    };
    let settings = PhysicalSettings { prior_weight: 1.0e-9, ..PhysicalSettings::default() };
    let fit = physical_fit(&rows_of(&own), &settings).unwrap();
    assert_eq!(fit.status, PhysicalStatus::Solved);
    for (found, own) in fit.base_values.iter().zip(own) {
        // Rows of unit weight, objective to 5e-8: accuracy of a point is its square root.
        assert!((found - own).abs() < 4e-4);
    }
    let moves = fit.moves_in_std(&own, &[1.0; 10]).unwrap();
    assert!(moves.iter().all(|m| m.unwrap().abs() < 4e-4));
    // With equal weights a pure mass deficit is corrected by the mass alone.
    let mut heavy = own;
    heavy[0] = -1.0;
    heavy[1] = 0.0;
    heavy[3] = 0.0;
    let fit = physical_fit(&rows_of(&heavy), &settings).unwrap();
    assert!((fit.moved_sigma - 1.0).abs() < 1e-3, "{}", fit.moved_sigma);
    assert!(fit.bodies[0].on_the_boundary && fit.base_values[0] > 0.0);
}

#[test]
fn contradictions_are_named() {
    let mut first = body("upper arm");
    first.mass_kg = Some([2.0, 1.0]);
    let refused = |bodies: Vec<PhysicalBody>| {
        let columns = 10 * bodies.len();
        let base = BaseMap::new(DMatrix::identity(columns, columns)).unwrap();
        PhysicalProblem::new(base, bodies, vec![], &unit_factor(columns, &vec![0.0; columns])).unwrap_err()
    };
    let error = refused(vec![first.clone()]);
    assert!(matches!(&error, PhysicalError::EmptyInterval { what, .. } if what.contains("upper arm")), "{error}");
    first.mass_kg = None;
    first.reference[4] = 1.0; // Ixx > Iyy + Izz
    let error = refused(vec![first]);
    assert!(matches!(&error, PhysicalError::InfeasiblePrior { body, .. } if body == "upper arm"), "{error}");
    let mut known = body("flange");
    known.known = Some([-1.0; 10]);
    assert!(matches!(refused(vec![known]), PhysicalError::InfeasibleKnown { .. }));
    let mut broken = body("link");
    broken.reference[2] = f64::NAN;
    assert!(matches!(refused(vec![broken]), PhysicalError::NotFinite { .. }));

    let (mut one, mut two) = (body("one"), body("two"));
    one.mass_kg = Some([1.0, 2.0]);
    two.mass_kg = Some([1.0, 3.0]);
    let problem = seen(vec![one, two], vec![]);
    let error = problem.clone().with_total_mass_kg([6.0, 7.0]).unwrap_err();
    assert!(matches!(error, PhysicalError::TotalMass { least, greatest, .. } if least == 2.0 && greatest == 5.0));
    let problem = problem.with_total_mass_kg([4.0, 4.5]).unwrap();
    let fit = physical_fit(&problem, &PhysicalSettings::default()).unwrap();
    let total = fit.parameters[0] + fit.parameters[10];
    assert!(total > 4.0 && total < 4.001, "the data favour zero mass: {total}");
    assert!(fit.active.iter().any(|name| name.contains("total mass at least")), "{:?}", fit.active);

    // All mass within 5 cm of the origin, but its centre beyond 10 cm: each is feasible alone.
    let mut far = body("forearm");
    far.com_box_m = Some([[0.1, -0.1, -0.1], [0.2, 0.1, 0.1]]);
    far.inside = Some(dynident_estimation::consistent::Ellipsoid { centre_m: [0.0; 3], semi_axes_m: [0.05; 3] });
    far.mass_kg = Some([1.0, 2.0]);
    let error = physical_fit(&seen(vec![far], vec![]), &PhysicalSettings::default()).unwrap_err();
    let PhysicalError::Contradictory { constraints, shortfall } = &error else { panic!("{error}") };
    assert!(*shortfall > 0.0);
    for part in ["ellipsoid", "along x at least"] {
        assert!(constraints.iter().any(|name| name.contains(part)), "{error}");
    }
    assert!(!error.to_string().contains("along y"), "{error}");
}

/// The search for an interior start ignores the data, so an unlimited offset would be undetermined.
#[test]
fn limits_far_from_the_prior_are_met_with_a_free_scalar() {
    let mut heavy = body("link");
    let least = 2.0 * heavy.reference[0];
    heavy.mass_kg = Some([least, 1.2 * least]);
    let offset = PhysicalScalar { name: "off1".into(), lower: None, upper: None, prior: 0.3, scale: 1.0 };
    let fit = physical_fit(&seen(vec![heavy], vec![offset]), &PhysicalSettings::default()).unwrap();
    assert!((least - 1e-9..=1.2 * least + 1e-9).contains(&fit.parameters[0]), "{:?}", fit.parameters);
    assert_eq!(fit.status, PhysicalStatus::Solved);
}

#[test]
fn known_bodies_stay_and_massless_bodies_are_allowed() {
    let (mut arm, mut tool) = (body("arm"), body("tool"));
    arm.known = Some([0.0; 10]);
    tool.known = Some(rough_body(0.5, 0.05));
    let friction = PhysicalScalar { name: "Fv1".into(), lower: Some(0.0), upper: None, prior: 0.0, scale: 1.0 };
    let base = BaseMap::new(DMatrix::identity(31, 31)).unwrap();
    let mut right = vec![0.0; 31];
    right[..10].copy_from_slice(&rough_body(2.0, 0.1));
    right[30] = -1.0;
    let problem =
        PhysicalProblem::new(base, vec![body("free"), arm, tool], vec![friction], &unit_factor(31, &right)).unwrap();
    let fit = physical_fit(&problem, &PhysicalSettings::default()).unwrap();
    assert_eq!(fit.parameters[10..20], [0.0; 10]);
    assert_eq!(fit.parameters[20..30], rough_body(0.5, 0.05));
    assert!(fit.parameters[30] >= 0.0 && fit.parameters[30] < 1e-6);
    assert_eq!(fit.active, ["Fv1 at least 0"]);
}

#[test]
fn settings_out_of_range_are_refused() {
    let problem = seen(vec![body("bob")], vec![]);
    for settings in [
        PhysicalSettings { prior_weight: 0.0, ..Default::default() },
        PhysicalSettings { margin: f64::NAN, ..Default::default() },
        PhysicalSettings { tolerance: 1.0, ..Default::default() },
        PhysicalSettings { max_iterations: 0, ..Default::default() },
    ] {
        assert!(matches!(physical_fit(&problem, &settings), Err(PhysicalError::Setting { .. })));
    }
    let one = PhysicalSettings { max_iterations: 1, ..Default::default() };
    assert_eq!(physical_fit(&problem, &one).unwrap().status, PhysicalStatus::IterationLimit);
}
