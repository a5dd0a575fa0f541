//! The physically consistent fit compared with cvxpy and Clarabel (golden/cvxpy_physical.py).

use dynident_estimation::TriangularFactor;
use dynident_estimation::consistent::{
    BaseMap, Ellipsoid, PhysicalBody, PhysicalPrior, PhysicalProblem, PhysicalRoute, PhysicalScalar, PhysicalSettings,
    physical_fit,
};
use nalgebra::DMatrix;
use serde_json::Value;

/// Required agreement. Points depend on the square root of the objective: Clarabel stops at 1e-10, and so does the
/// primal-dual route here. The other route is compared by its objective, at its default tolerance.
const AGREEMENT: f64 = 1.0e-5;
const TOLERANCE: f64 = 1.0e-10;

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|v| v.as_f64().unwrap()).collect()
}

fn matrix(value: &Value) -> DMatrix<f64> {
    let rows: Vec<Vec<f64>> = value.as_array().unwrap().iter().map(numbers).collect();
    DMatrix::from_fn(rows.len(), rows[0].len(), |i, j| rows[i][j])
}

fn array<const N: usize>(value: &Value) -> [f64; N] {
    numbers(value).try_into().unwrap()
}

fn problem(case: &Value) -> PhysicalProblem {
    let bodies = case["bodies"].as_array().unwrap().iter().enumerate().map(|(index, body)| PhysicalBody {
        name: format!("body{}", index + 1),
        reference: array(&body["reference"]),
        known: None,
        mass_kg: body.get("mass_kg").map(array),
        com_box_m: body.get("com_box_m").map(|b| [array(&b[0]), array(&b[1])]),
        inside: body.get("ellipsoid").map(|e| Ellipsoid { centre_m: array(&e[0]), semi_axes_m: array(&e[1]) }),
    });
    let scalars = (0..case["scalars"].as_u64().unwrap()).map(|index| PhysicalScalar {
        name: format!("friction{index}"),
        lower: Some(0.0),
        upper: None,
        prior: 0.0,
        scale: 1.0,
    });
    let (rows, mut panel) = (matrix(&case["rows"]), Vec::new());
    panel.extend(rows.iter());
    panel.extend(numbers(&case["right"]));
    let factor = TriangularFactor::from_rows(rows.ncols(), &panel, rows.nrows()).unwrap();
    let base = BaseMap::new(matrix(&case["base_map"])).unwrap();
    let problem = PhysicalProblem::new(base, bodies.collect(), scalars.collect(), &factor).unwrap();
    match case.get("total_mass_kg") {
        Some(limits) => problem.with_total_mass_kg(array(limits)).unwrap(),
        None => problem,
    }
}

#[test]
fn both_routes_agree_with_cvxpy() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../golden/cvxpy_physical.json");
    let golden: Value = serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap();
    for case in golden["cases"].as_array().unwrap() {
        let name = format!("{} {}", case["kind"], case["prior"]);
        let prior: PhysicalPrior = serde_json::from_value(case["prior"].clone()).unwrap();
        for route in [PhysicalRoute::InteriorPoint, PhysicalRoute::LogCholesky] {
            let settings = PhysicalSettings {
                route,
                prior,
                prior_weight: case["prior_weight"].as_f64().unwrap(),
                margin: golden["margin"].as_f64().unwrap(),
                tolerance: if route == PhysicalRoute::InteriorPoint {
                    TOLERANCE
                } else {
                    PhysicalSettings::default().tolerance
                },
                ..PhysicalSettings::default()
            };
            let fit = physical_fit(&problem(case), &settings).unwrap();
            // Ten times the required value: the last digit of a certificate is rounding.
            assert!(
                fit.kkt_residual() <= if route == PhysicalRoute::InteriorPoint { 1.0e-9 } else { 1.0e-7 },
                "{name}: {fit:?}"
            );
            let (found, expected) =
                (fit.data_objective + fit.prior_objective, case["solution"]["objective"].as_f64().unwrap());
            assert!((found - expected).abs() <= AGREEMENT * (1.0 + expected), "{name}: {found} {expected}");
            if route == PhysicalRoute::LogCholesky {
                continue;
            }
            for (key, found) in [("base_values", &fit.base_values), ("parameters", &fit.parameters)] {
                for (index, (found, expected)) in found.iter().zip(numbers(&case["solution"][key])).enumerate() {
                    // Masses and moments of these bodies are of order one.
                    let scale = 1.0 + expected.abs();
                    assert!((found - expected).abs() <= AGREEMENT * scale, "{name} {key}[{index}]: {found} {expected}");
                }
            }
        }
    }
}
