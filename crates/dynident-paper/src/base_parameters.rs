//! Table 2 and Eqs. 6, 7: base parameters and observation matrix of the planar arm, by the general algorithm.

use crate::arm::{A1, Arm, GRAVITY, TRUTH};
use crate::piece::{PaperCell, PaperTable};
use dynident_dynamics::{BaseParameterSettings, BaseParameters, Workspace, torque_regressor};
use dynident_model::sample::Random;

const PAPER: [&str; 6] = ["I1zz + m2 a1²", "m1 r1x + m2 a1", "m1 r1y", "I2zz", "m2 r2x", "m2 r2y"];

/// Indices of θ₁ to θ₆ in the base columns, which have the order of the inertial parameters: m r_x, m r_y, I_zz of each
/// link.
pub(crate) const COLUMNS: [usize; 6] = [2, 0, 1, 5, 3, 4];

const STATES: usize = 1000;

/// Table 2, and the largest difference between the general regressor and Eq. 7.
pub(crate) fn table_2(arm: &Arm) -> (PaperTable, f64) {
    let base = BaseParameters::new(&arm.model, &[], &BaseParameterSettings::default());
    let difference = difference_from_equation_7(arm, base.independent());
    let note = format!(
        "computed from the structure of the arm by the algorithm for all robots; the observation matrix differs from Eq. 7 by at most {difference:.1e} over {STATES} random states"
    );
    let mut table = PaperTable::new(
        2,
        "Minimum inertia parameter set",
        &["parameter", "paper", "here", "value in section 3"],
        &note,
    );
    let expressions = base.expressions();
    for (place, paper) in PAPER.iter().enumerate() {
        table.row([
            PaperCell::Text(theta(place)),
            (*paper).into(),
            expressions.get(COLUMNS[place]).map_or(PaperCell::None, |expression| PaperCell::Text(expression.clone())),
            TRUTH[place].into(),
        ]);
    }
    (table, difference)
}

pub(crate) fn theta(place: usize) -> String {
    const DIGITS: [&str; 6] = ["θ₁", "θ₂", "θ₃", "θ₄", "θ₅", "θ₆"];
    DIGITS[place].to_owned()
}

fn difference_from_equation_7(arm: &Arm, columns: &[usize]) -> f64 {
    let width = 10 * arm.model.dof();
    let mut workspace = Workspace::new(&arm.model);
    let mut random = Random::new(7);
    let mut largest = 0.0_f64;
    for _ in 0..STATES {
        let mut draw = |size: f64| [random.uniform(-size, size), random.uniform(-size, size)];
        let (q, dq, ddq) = (draw(3.0), draw(2.0), draw(5.0));
        let phi = equation_7(q, dq, ddq);
        let regressor = torque_regressor(&arm.model, &mut workspace, &q, &dq, &ddq);
        for joint in 0..2 {
            for (theta, expected) in phi[joint].iter().enumerate() {
                let Some(&column) = columns.get(COLUMNS[theta]) else { return f64::INFINITY };
                largest = largest.max((regressor[joint * width + column] - expected).abs());
            }
        }
    }
    largest
}

fn equation_7(q: [f64; 2], dq: [f64; 2], ddq: [f64; 2]) -> [[f64; 6]; 2] {
    let ([q1, q2], [v1, v2], [w1, w2]) = (q, dq, ddq);
    let ((s1, c1), (s2, c2), (s12, c12)) = (q1.sin_cos(), q2.sin_cos(), (q1 + q2).sin_cos());
    let (a, g) = (A1, GRAVITY);
    let coriolis = a * (2.0 * v1 + v2) * v2;
    [
        [
            w1,
            g * c1,
            -g * s1,
            w1 + w2,
            a * (2.0 * w1 + w2) * c2 - coriolis * s2 + g * c12,
            -a * (2.0 * w1 + w2) * s2 - coriolis * c2 - g * s12,
        ],
        [0.0, 0.0, 0.0, w1 + w2, a * w1 * c2 + a * v1 * v1 * s2 + g * c12, -a * w1 * s2 + a * v1 * v1 * c2 - g * s12],
    ]
}
