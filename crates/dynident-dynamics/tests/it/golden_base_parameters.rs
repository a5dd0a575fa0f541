//! Base parameters of real robots compared with Pinocchio's regressors, random states, and a published study.

use crate::golden::{ARMS, Golden, ROBOTS, robot, text};
use dynident_dynamics::{
    BaseParameterSettings, BaseParameters, Column, Workspace, inverse_dynamics, numerical_rank, numerical_rank_by_body,
    torque_regressor,
};
use dynident_model::sample::Random;
use dynident_model::terms::{CoulombShape, Coupling, CouplingEffect, DriveChoice, TorqueTerm, terms_per_joint};
use dynident_model::{Model, load_robot, read_urdf};
use dynident_testing::{recordings, repository};
use std::collections::BTreeMap;

const SIGN: CoulombShape = CoulombShape::Sign { dead_band: 0.0 };

fn friction(model: &Model) -> Vec<TorqueTerm> {
    terms_per_joint(model, |_| DriveChoice {
        viscous: true,
        coulomb: Some(SIGN),
        offset: true,
        ..DriveChoice::default()
    })
}

fn drive_inertia(model: &Model) -> Vec<TorqueTerm> {
    terms_per_joint(model, |_| DriveChoice { drive_inertia: true, ..DriveChoice::default() })
}

fn drive_inertia_and_friction(model: &Model) -> Vec<TorqueTerm> {
    terms_per_joint(model, |_| DriveChoice { drive_inertia: true, viscous: true, coulomb: Some(SIGN), offset: true })
}

fn base(model: &Model, terms: &[TorqueTerm]) -> BaseParameters {
    BaseParameters::new(model, terms, &BaseParameterSettings::default())
}

#[test]
fn the_counts_are_those_of_the_literature() {
    for (name, bare, with_friction) in
        [("planar2r", 6, 12), ("ur10", 36, 54), ("panda_arm7", 43, 64), ("iiwa14", 43, 64)]
    {
        let model = robot(name);
        assert_eq!(base(&model, &[]).count(), bare, "{name}");
        assert_eq!(base(&model, &friction(&model)).count(), with_friction, "{name} with friction");
    }
}

#[test]
fn counts_columns_and_combinations_agree_with_pinocchio() {
    for name in ARMS {
        let Golden { model, file, .. } = Golden::of("pinocchio", name);
        let file = &file["base_parameters"];
        let ours = base(&model, &[]);
        let count = |key: &str| file[key].as_u64().unwrap() as usize;
        assert_eq!(ours.count(), count("count"), "{name}");
        assert_eq!(base(&model, &friction(&model)).count(), count("count_with_friction"), "{name}");
        assert_eq!(base(&model, &drive_inertia(&model)).count(), count("count_with_drive_inertia"), "{name}");
        assert_eq!(
            base(&model, &drive_inertia_and_friction(&model)).count(),
            count("count_with_friction_and_drive_inertia"),
            "{name}"
        );

        let symbols = ["m", "m_rx", "m_ry", "m_rz", "Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "Izz"];
        let names: Vec<String> =
            model.joints().iter().flat_map(|joint| symbols.map(|symbol| format!("{}.{symbol}", joint.name))).collect();
        let independent: Vec<&str> = ours.independent().iter().map(|&column| names[column].as_str()).collect();
        let theirs: Vec<&str> = file["independent"].as_array().unwrap().iter().map(text).collect();
        assert_eq!(independent, theirs, "{name}: the independent columns");

        let values = ours.values(&model.parameter_vector());
        let largest = values.iter().fold(0.0_f64, |largest, value| largest.max(value.abs()));
        for (b, symbol) in independent.iter().enumerate() {
            let mut combination: BTreeMap<&str, f64> = file["combination"][*symbol]
                .as_object()
                .unwrap()
                .iter()
                .map(|(k, v)| (k.as_str(), v.as_f64().unwrap()))
                .collect();
            assert_eq!(combination.remove(symbol), Some(1.0));
            for (d, &column) in ours.dependent().iter().enumerate() {
                // The file's coefficients are least-squares solutions, accurate to 1e-12 at a condition number of
                // about a hundred; it drops those below 1e-9.
                let theirs = combination.remove(names[column].as_str()).unwrap_or(0.0);
                let factor = ours.regrouping()[(b, d)];
                assert!(
                    (factor - theirs).abs() <= 1e-9,
                    "{name}: {} in {symbol}: {factor} against {theirs}",
                    names[column]
                );
            }
            assert!(combination.is_empty(), "{name}: {symbol} also holds {combination:?}");
            let theirs = file["values"][*symbol].as_f64().unwrap();
            assert!((values[b] - theirs).abs() <= 1e-9 * largest, "{name}: {symbol} = {} against {theirs}", values[b]);
        }
    }
}

#[test]
fn structure_agrees_with_random_states_and_the_split_is_clear() {
    for name in ROBOTS {
        let model = robot(name);
        // A humanoid with drives needs several thousand rows and columns at random states; only its bodies are tested.
        let cases =
            if model.dof() > 9 { vec![Vec::new()] } else { vec![Vec::new(), drive_inertia_and_friction(&model)] };
        for terms in cases {
            let ours = base(&model, &terms);
            let (weakest, strongest) = ours.gap();
            let numerical = numerical_rank(&model, &terms, 77, 1e-9);
            println!(
                "{name}, {} laws: {} base parameters; structural gap {strongest:.1e} .. {weakest:.1e}, at random states {:.1e} .. {:.1e}",
                terms.len(),
                ours.count(),
                numerical.strongest_dependent,
                numerical.weakest_independent
            );
            assert_eq!(ours.independent(), numerical.independent, "{name}");
            // The tolerance is at least a factor of ten from both sides of the gap.
            let tolerance = BaseParameterSettings::default().tolerance;
            assert!(
                strongest <= 0.1 * tolerance && weakest >= 10.0 * tolerance,
                "{name}: {strongest:e} .. {weakest:e}"
            );
        }
    }
}

/// Many robot descriptions contain 1.5708 for π/2. Their base parameters must be those of the exact robot.
#[test]
fn rounded_right_angles_add_no_base_parameters() {
    for (name, count) in [("ur10", 36), ("panda_arm7", 43), ("iiwa14", 43)] {
        let text = std::fs::read_to_string(repository(&format!("robots/{name}.urdf"))).unwrap();
        let mut rounded = text.clone();
        for exact in [
            "1.570796326794896",
            "1.57079632679489",
            "1.570796326795",
            "1.57079632679",
            "1.5707963268",
            "1.5707963267948966",
        ] {
            rounded = rounded.replace(exact, "1.5708");
        }
        assert_ne!(rounded, text, "{name} is written with another π/2 than this test knows");
        let model = read_urdf(&rounded).unwrap().model;
        let ours = base(&model, &[]);
        let (weakest, strongest) = ours.gap();
        let tolerance = BaseParameterSettings::default().tolerance;
        let numerical = numerical_rank(&model, &[], 77, tolerance);
        println!(
            "{name} with 1.5708: structural gap {strongest:.1e} .. {weakest:.1e}, at random states {:.1e} .. {:.1e}",
            numerical.strongest_dependent, numerical.weakest_independent
        );
        assert_eq!(ours.count(), count, "{name}");
        assert_eq!(ours.independent(), numerical.independent, "{name}");
    }
}

/// π with few digits in front of the first joint tilts gravity by the rounding: a column of 1e-9 among others of 1.
#[test]
fn a_rounded_half_turn_of_the_base_adds_no_base_parameters() {
    for (name, count) in [("ur10", 36), ("panda_arm7", 43), ("iiwa14", 43)] {
        let upright = robot(name);
        for decimals in [4, 5, 6, 7, 9, 11] {
            let angle = (core::f64::consts::PI * 10_f64.powi(decimals)).round() / 10_f64.powi(decimals);
            let model = upright.clone().with_base_orientation(angle, 0.0, 0.0).unwrap();
            let ours = base(&model, &[]);
            assert_eq!(ours.count(), count, "{name} turned by {angle}");
            let tolerance = BaseParameterSettings::default().tolerance;
            let by_body = numerical_rank_by_body(&model, 1, tolerance);
            assert_eq!(by_body.independent, ours.independent(), "{name} turned by {angle}");
        }
    }
}

#[test]
fn exact_expressions_keep_every_digit() {
    for name in ARMS {
        let model = robot(name);
        let ours = base(&model, &[]);
        let names: Vec<String> = ours.all_columns().iter().map(Column::symbol).collect();
        let parameters = model.parameter_vector();
        let sum = |expression: &str| {
            let mut words = expression.split(' ').peekable();
            let (mut total, mut sign) = (0.0, 1.0);
            while let Some(word) = words.next() {
                match word {
                    "+" => sign = 1.0,
                    "-" => sign = -1.0,
                    _ => {
                        let factor = word.parse::<f64>().ok();
                        let symbol = if factor.is_some() { words.next().unwrap() } else { word };
                        let place = names.iter().position(|name| name == symbol).unwrap();
                        total += sign * factor.unwrap_or(1.0) * parameters[place];
                    }
                }
            }
            total
        };
        let values = ours.values(&parameters);
        let largest = values.iter().fold(0.0_f64, |largest, value| largest.max(value.abs()));
        let (mut exact, mut short) = (0.0_f64, 0.0_f64);
        for ((expression, readable), value) in ours.exact_expressions().iter().zip(ours.expressions()).zip(&values) {
            exact = exact.max((sum(expression) - value).abs() / largest);
            short = short.max((sum(&readable) - value).abs() / largest);
        }
        // Factors below 1e-9 are omitted, and a base parameter is a sum of about ten terms.
        assert!(exact <= 1e-8, "{name}: {exact:e}");
        assert!(exact <= short, "{name}: {exact:e} {short:e}");
    }
}

#[test]
fn base_parameters_carry_the_full_torque() {
    let mut random = Random::new(5);
    for name in ROBOTS {
        let model = robot(name);
        let dof = model.dof();
        let ours = base(&model, &[]);
        let theta = ours.values(&model.parameter_vector());
        let mut workspace = Workspace::new(&model);
        for _ in 0..20 {
            let mut vector = || (0..dof).map(|_| random.uniform(-2.0, 2.0)).collect::<Vec<f64>>();
            let (q, dq, ddq) = (vector(), vector(), vector());
            let tau = inverse_dynamics(&model, &mut workspace, &q, &dq, &ddq).to_vec();
            let largest = tau.iter().fold(0.0_f64, |largest, t| largest.max(t.abs()));
            let regressor = torque_regressor(&model, &mut workspace, &q, &dq, &ddq);
            for (row, tau) in regressor.chunks_exact(10 * dof).zip(&tau) {
                let by_base: f64 = ours.independent().iter().zip(&theta).map(|(&column, t)| row[column] * t).sum();
                // Angles rounded to twelve digits are exact zeros within the structure's tolerance.
                assert!((by_base - tau).abs() <= 1e-9 * largest, "{name}: {by_base} against {tau}");
            }
        }
    }
}

/// `Ixx2 - 1.0*Iyy2 - 0.050625*m3` as symbols and factors.
fn published_sum(expression: &str) -> BTreeMap<String, f64> {
    let mut sum = BTreeMap::new();
    let mut sign = 1.0;
    for term in expression.split_whitespace() {
        match term {
            "+" => sign = 1.0,
            "-" => sign = -1.0,
            _ => {
                let (factor, symbol) = term.split_once('*').map_or((1.0, term), |(f, s)| (f.parse().unwrap(), s));
                // Their names of Coulomb friction and of the wrist's shared drive.
                let symbol = match symbol {
                    "Iam6" => "Ia_m6".to_owned(),
                    "fvm6" => "fv_m6".to_owned(),
                    "fsm6" => "fc_m6".to_owned(),
                    _ => symbol.replace("fs", "fc"),
                };
                sum.insert(symbol, sign * factor);
            }
        }
    }
    sum
}

/// Stäubli TX40 with drive inertias, friction, offsets and the coupled wrist: 61 base parameters, as in figaroh-plus.
#[test]
fn the_tx40_has_the_published_base_parameters() {
    let Some(folder) = recordings().map(|folder| folder.join("staubli_tx40")).filter(|folder| folder.is_dir()) else {
        println!("skipped: no recordings (set DYNIDENT_DATA to the folder that holds staubli_tx40)");
        return;
    };
    let model = load_robot(folder.join("tx40_mdh_modified.urdf")).unwrap().model;
    let mut terms = drive_inertia_and_friction(&model);
    terms.extend([CouplingEffect::Inertia, CouplingEffect::Viscous, CouplingEffect::Coulomb(SIGN)].map(|effect| {
        TorqueTerm::Coupling(Coupling { name: "m6".to_owned(), first: 4, second: 5, ratios: [1.0, 1.0], effect })
    }));
    let ours = base(&model, &terms);
    println!("TX40: structural gap {:?}", ours.gap());
    assert_eq!(ours.count(), 61);
    let numerical = numerical_rank(&model, &terms, 5, 1e-9);
    assert_eq!(ours.independent(), numerical.independent);

    let table = std::fs::read_to_string(folder.join("published_base_parameters.csv")).unwrap();
    let published: Vec<BTreeMap<String, f64>> = table
        .lines()
        .filter(|line| !line.is_empty())
        .map(|line| published_sum(line.split(',').next().unwrap()))
        .collect();
    let symbols: Vec<String> = ours.all_columns().iter().map(Column::symbol).collect();
    let mut unpublished = Vec::new();
    for (b, &column) in ours.independent().iter().enumerate() {
        let mut sum = BTreeMap::from([(symbols[column].clone(), 1.0)]);
        for (d, &dependent) in ours.dependent().iter().enumerate() {
            let factor = ours.regrouping()[(b, d)];
            if factor.abs() > 1e-4 {
                sum.insert(symbols[dependent].clone(), factor);
            }
        }
        let same = |theirs: &&BTreeMap<String, f64>| {
            theirs.keys().eq(sum.keys()) && theirs.values().zip(sum.values()).all(|(a, b)| (a - b).abs() <= 2e-5)
        };
        if !published.iter().any(|theirs| same(&theirs)) {
            unpublished.push(sum);
        }
    }
    // Their table omits the drive inertia of joint 6, which their count of 61 includes.
    assert_eq!(unpublished, [BTreeMap::from([("Ia6".to_owned(), 1.0)])]);
    assert_eq!(published.len(), 60);
}
