//! Criteria and their derivatives with respect to the motion, against central differences of the whole chain.

use dynident_dynamics::{BaseParameterSettings, BaseParameters, PanelLayout};
use dynident_excitation::criteria::{AOptimal, ConditionNumber, Criterion, DOptimal, EOptimal};
use dynident_excitation::{Information, Motion};
use dynident_model::sample::{Random, random_tree};
use dynident_model::terms::{
    CoulombShape, Declared, DeclaredLaw, DriveChoice, Expression, JointNames, TorqueTerm, terms_per_joint,
};

#[test]
fn derivatives_by_the_motion_equal_differences() {
    let criteria: [&dyn Criterion; 5] = [
        &DOptimal,
        &AOptimal,
        &EOptimal { order: 6.0 },
        &ConditionNumber { order: 6.0, scaled: false },
        &ConditionNumber { order: 6.0, scaled: true },
    ];
    for seed in 0..6 {
        let model = random_tree(seed, 3);
        let mut terms = terms_per_joint(&model, |_| DriveChoice {
            drive_inertia: true,
            viscous: true,
            coulomb: Some(CoulombShape::Smooth { width: 0.5 }),
            offset: true,
        });
        // A column that depends on positions and velocities of other joints.
        for (joint, text) in [(0, "sin(2 * q) * cos(q3) + q2"), (2, "exp(-q^2 / 4) * dq1 + q * dq")] {
            let expression = Expression::parse(text, &JointNames { own: Some(joint), names: &[] }).unwrap();
            let (name, law) = (format!("declared{joint}"), DeclaredLaw::Expression(expression));
            terms.push(TorqueTerm::Declared(Declared {
                name,
                joint,
                law,
                unit: "Nm".to_owned(),
                nominal: None,
                is_spring: false,
            }));
        }
        let base = BaseParameters::new(&model, &terms, &BaseParameterSettings::default());
        let layout = PanelLayout::new(&model, base.base_columns());
        let mut information = Information::new(&model, &layout, &[0.5, 1.0, 2.0], None);
        let mut random = Random::new(90 + seed);
        let samples = 60;
        let mut motion = Motion::default();
        motion.reset(3, samples);
        for values in [&mut motion.q, &mut motion.dq, &mut motion.ddq] {
            for x in values.iter_mut() {
                *x = random.uniform(-2.0, 2.0);
            }
        }
        for criterion in criteria {
            let d = information.of(&motion, 0.7);
            let (_, by_information) = criterion.value_and_derivative(&d).unwrap();
            let mut gradient = Motion::default();
            gradient.reset(3, samples);
            information.apply_adjoint(&motion, 0.7, &by_information, &mut gradient);
            let mut value = |motion: &Motion| criterion.value_and_derivative(&information.of(motion, 0.7)).unwrap().0;
            for entry in [0, 17, 80, 179] {
                for which in 0..3 {
                    let mut at = |step: f64| {
                        let mut moved = motion.clone();
                        [&mut moved.q, &mut moved.dq, &mut moved.ddq][which][entry] += step;
                        value(&moved)
                    };
                    // Fourth-order differences. The smallest eigenvalue of D has a relative error of 1e-16 times the
                    // condition number (1e6 here), its logarithm 1e-10 and its difference quotient 1e-10 / h; the fifth
                    // derivatives (some hundreds) contribute h^4 times their value.
                    let h = 5e-3;
                    let expected = (8.0 * (at(h) - at(-h)) - (at(2.0 * h) - at(-2.0 * h))) / (12.0 * h);
                    let found = [&gradient.q, &gradient.dq, &gradient.ddq][which][entry];
                    assert!(
                        (found - expected).abs() <= 1e-6 * (1.0 + expected.abs()),
                        "{} seed {seed} ({which}, {entry}): {found} against {expected}",
                        criterion.name()
                    );
                }
            }
        }
    }
}
