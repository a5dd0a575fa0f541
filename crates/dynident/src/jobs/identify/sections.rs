//! Sections of `result.json`.

use crate::jobs::violations::violations;
use crate::result::{
    BaseParameterResult, BodyResult, ErrorTermResult, JointFrictionResult, JointResult, LogOffset, MethodSummary,
    PhysicalBodyResult, PhysicalFitResult, PhysicalVerdict, RobotSummary, TermResult, TrainingErrors, TrainingJoint,
    TrainingResult, ValueSource,
};
use crate::study::{JointDrive, Study, StudyRobot};
use dynident_dynamics::Determination;
use dynident_estimation::consistent::{PhysicalFit, PhysicalStatus};
use dynident_estimation::{Estimate, EstimateStatus};
use dynident_identification::consistent::typical_length_m;
use dynident_identification::estimators::Estimator;
use dynident_identification::examination::TorqueLag;
use dynident_identification::friction::JointFriction;
use dynident_identification::{
    ConditionalEstimate, ErrorSource, Identification, Recording, RegressorModel, resting_joints,
};
use dynident_model::terms::{StateFunction, TorqueTerm};
use dynident_model::{INERTIAL_NAMES, InertialParameters, JointKind};

pub(super) fn robot_summary(robot: &StudyRobot) -> RobotSummary {
    RobotSummary {
        name: robot.model().name().to_owned(),
        file: robot.robot.path.display().to_string(),
        dof: robot.model().dof(),
        joints: robot.parametric.joint_names(),
        torque_units: robot.model().joints().iter().map(|joint| torque_unit(joint.kind).to_owned()).collect(),
        gravity_m_s2: robot.model().gravity().0,
        parameter_order: INERTIAL_NAMES.map(str::to_owned),
    }
}

fn torque_unit(joint: JointKind) -> &'static str {
    match joint {
        JointKind::Revolute | JointKind::Continuous => "Nm",
        JointKind::Prismatic => "N",
    }
}

pub(super) fn method_summary(study: &Study, identification: &Identification) -> MethodSummary {
    let (model, estimate, motion) = (identification.model(), identification.estimate(), &identification.motion);
    let (weakest, strongest) = model.base().gap();
    MethodSummary {
        estimator: identification.estimator.name().to_owned(),
        status: match estimate.status {
            EstimateStatus::Complete => "complete",
            EstimateStatus::NotAllExcited => "not-all-excited",
            EstimateStatus::IterationLimit => "iteration-limit",
        }
        .to_owned(),
        iterations: estimate.iterations,
        functions: study.functions(),
        covariance: match &identification.estimator {
            _ if estimate.clusters > 0 => "time segments: accounts for residuals correlated in time",
            Estimator::Function(_) if estimate.covariance_method != study.estimator.covariance => {
                "as the function gave it"
            }
            _ => "white residuals",
        }
        .to_owned(),
        clusters: estimate.clusters,
        motion: motion.clone(),
        cutoff: identification.cutoff.clone(),
        torque_lag: identification.torque_lag.clone(),
        between_logs: identification.between_logs,
        motion_hz: identification.motion_hz,
        condition_number: estimate.condition_number_raw,
        condition_number_scaled: estimate.condition_number_scaled,
        base_columns: "from the robot's structure: columns from base to tip, bodies before friction and drives; a column that depends on earlier ones is regrouped into them"
            .to_owned(),
        base_gap: [weakest, strongest],
        not_excited: estimate.rank.fixed.iter().map(|fixed| fixed.name.clone()).collect(),
        coincident: coincident(model),
        resting_joints: resting_joints(&identification.training).into_iter().map(|joint| model.joint_names()[joint].clone()).collect(),
        gain_std_percent: study.drive.gain_std_percent,
        load_parameters: model.load_parameters.clone(),
    }
}

/// Messages about declared torques that are combinations of other parameters.
fn coincident(model: &RegressorModel) -> Vec<String> {
    let of_term = |(term, others): (&TorqueTerm, Vec<String>)| {
        let joint = term.own_joint().map_or("", |joint| &model.model().joints()[joint].name);
        let nominal = term.described(model.model());
        let held = nominal.map_or("0 (no nominal value stated)".to_owned(), |value| format!("its nominal {value}"));
        format!(
            "torque {} of joint {joint} coincides with that of {}: its coefficient is unidentifiable and stays near {held}; the sums are identifiable",
            term.symbol(),
            others.join(", ")
        )
    };
    model.base().coincident().into_iter().map(of_term).collect()
}

/// The base parameters. Error terms are listed only for the estimator's estimate without fixed parameters.
pub(super) fn base_parameters(
    found: &Identification,
    conditionals: &[ConditionalEstimate],
) -> Vec<BaseParameterResult> {
    let (model, estimate, physical) = (found.model(), found.estimate(), found.consistent_base_values());
    let expressions = model.base().expressions();
    let columns = model.layout().columns();
    let error_terms = |index: usize| -> Vec<ErrorTermResult> {
        let of_nominal = conditionals.get(index).and_then(|own| own.nominal_std);
        let of_nominal = of_nominal.map(|std| (ErrorSource::NominalValues, std));
        let terms = found.bars.std_by_source(&found.estimation.estimate, index).into_iter().chain(of_nominal);
        let terms: Vec<_> = terms.map(|(source, std)| ErrorTermResult { source, std }).collect();
        let is_fixed = estimate.rank.fixed.iter().any(|fixed| fixed.column == index);
        if is_fixed || terms.len() < 2 || found.essential.is_some() { Vec::new() } else { terms }
    };
    (0..columns.len())
        .map(|index| BaseParameterResult {
            symbol: columns[index].symbol(),
            expression: expressions[index].clone(),
            unit: columns[index].unit().to_owned(),
            value: estimate.values[index],
            std: estimate.std[index],
            half_width_95: estimate.half_width_95[index],
            std_white: estimate.covariance_white[(index, index)].max(0.0).sqrt(),
            relative_std_percent: estimate.relative_std_percent[index],
            prior: model.parametric.nominal_base().map(|prior| prior[index]),
            physical: physical.map(|values| values[index]),
            conditional_on: conditionals.get(index).map_or_else(Vec::new, |own| own.on.clone()),
            half_width_95_with_nominal: conditionals.get(index).and_then(|own| own.half_width_95),
            error_terms: error_terms(index),
            excited: !estimate.rank.fixed.iter().any(|fixed| fixed.column == index),
        })
        .collect()
}

/// Sources of the ten values of each body. A value is not measured if the logs do not excite its base parameters.
pub(super) fn sources(model: &RegressorModel, estimate: &Estimate) -> Vec<[ValueSource; 10]> {
    let fixed: Vec<usize> = estimate.rank.fixed.iter().map(|fixed| fixed.column).collect();
    let all = model.base().determination(&fixed, typical_length_m(model.model()));
    let source = |determination: Determination| match determination {
        Determination::Measured => ValueSource::Measured,
        Determination::Partly => ValueSource::Partly,
        Determination::Nominal => ValueSource::Nominal,
    };
    (0..model.model().body_count()).map(|body| core::array::from_fn(|k| source(all[10 * body + k]))).collect()
}

pub(super) fn bodies(
    model: &RegressorModel,
    inertials: &[InertialParameters],
    sources: &[[ValueSource; 10]],
    std: &[Option<f64>],
) -> Vec<BodyResult> {
    model
        .model()
        .bodies()
        .iter()
        .zip(inertials)
        .zip(sources)
        .zip(std.chunks(10))
        .map(|(((body, inertial), sources), std)| BodyResult {
            name: body.name().to_owned(),
            links: body.links.iter().map(|link| link.name.clone()).collect(),
            mass_kg: inertial.mass_kg(),
            com_m: inertial.com_m().map(|com| com.0),
            inertia_at_origin_kgm2: core::array::from_fn(|k| inertial.0[4 + k]),
            parameters: inertial.0,
            prior: body.prior().map(|prior| prior.0),
            pseudo_inertia_min_eigenvalue: inertial.pseudo_inertia().symmetric_eigenvalues().min(),
            sources: Some(*sources),
            std: std.iter().copied().collect::<Option<Vec<f64>>>().and_then(|std| std.try_into().ok()),
        })
        .collect()
}

pub(super) fn term_results(
    model: &RegressorModel,
    estimate: &Estimate,
    parameters: &[f64],
    wanted: impl Fn(&TorqueTerm) -> bool,
) -> Vec<TermResult> {
    let first_term = model.model().inertial_count();
    let expressions = model.base().expressions();
    let of_term = |(x, term): (usize, &TorqueTerm)| {
        let column = first_term + x;
        let place = model.base().independent().iter().position(|&index| index == column);
        // A term with other parameters regrouped into it is not a base parameter by itself.
        let alone = place.filter(|&place| expressions[place] == term.symbol());
        let home = place.or_else(|| {
            let d = model.base().dependent().iter().position(|&index| index == column)?;
            let column = model.base().regrouping().column(d);
            (0..column.len()).find(|&b| column[b].abs() > 1e-9)
        });
        TermResult {
            symbol: term.symbol(),
            unit: term.unit().to_owned(),
            value: parameters[column],
            std: alone.map(|place| estimate.std[place]),
            base_parameter: home.map(|place| expressions[place].clone()),
            law: term.state_function().map(StateFunction::description),
        }
    };
    model.terms().iter().enumerate().filter(|(_, term)| wanted(term)).map(of_term).collect()
}

/// Deviations of each log's offsets from their mean. The deviation of the last log is minus the sum of the others.
pub(super) fn offset_results(identification: &Identification, recordings: &[Recording]) -> Vec<LogOffset> {
    let (model, columns, estimate) =
        (identification.model(), &identification.training.columns, identification.estimate());
    let training: Vec<usize> = identification.training.logs.iter().map(|log| log.index).collect();
    let joints = model.joint_names();
    let mut offsets = Vec::new();
    for (joint, name) in joints.iter().enumerate() {
        let own: Vec<&(usize, usize, usize)> = columns.offsets.iter().filter(|(_, of, _)| *of == joint).collect();
        if own.is_empty() {
            continue;
        }
        let mut add = |log: usize, deviation_nm: f64, variance: f64| {
            let std_nm = variance.max(0.0).sqrt();
            offsets.push(LogOffset { log: recordings[log].name.clone(), joint: name.clone(), deviation_nm, std_nm });
        };
        for &&(log, _, column) in &own {
            add(log, estimate.values[column], estimate.covariance[(column, column)]);
        }
        let sum: f64 = own.iter().map(|(_, _, column)| estimate.values[*column]).sum();
        let pairs = own.iter().flat_map(|a| own.iter().map(move |b| (a.2, b.2)));
        let variance = pairs.map(|pair| estimate.covariance[pair]).sum();
        if let Some(&last) = training.last() {
            add(last, -sum, variance);
        }
    }
    offsets
}

pub(super) fn joint_results(
    model: &RegressorModel,
    estimate: &Estimate,
    parameters: &[f64],
    lags: &[Option<TorqueLag>],
) -> Vec<JointResult> {
    model
        .model()
        .joints()
        .iter()
        .enumerate()
        .map(|(index, joint)| JointResult {
            name: joint.name.clone(),
            terms: term_results(model, estimate, parameters, |term| term.own_joint() == Some(index)),
            residual_std_nm: estimate.joint_sigma[index],
            residual_correlation: estimate.effective_lag1.get(index).copied().filter(|rho| rho.is_finite()),
            torque_lag: lags[index],
        })
        .collect()
}

pub(super) fn training_result(
    identification: &Identification,
    recordings: &[Recording],
) -> Result<TrainingResult, dynident_estimation::EstimationError> {
    let values = &identification.estimate().values;
    let base = identification.training.columns.base();
    let (samples, estimate) = training_errors(identification, values)?;
    // Offsets of single logs and payloads use the unconstrained estimate.
    let written = identification.consistent_base_values().map(|written| [written, &values[base..]].concat());
    let physical = written.map(|written| training_errors(identification, &written)).transpose()?;
    Ok(TrainingResult {
        logs: identification.training.logs.iter().map(|log| recordings[log.index].name.clone()).collect(),
        samples,
        relative_error_percent: estimate.relative_error_percent,
        joints: estimate.joints,
        physical: physical.map(|(_, errors)| errors),
    })
}

fn training_errors(
    identification: &Identification,
    values: &[f64],
) -> Result<(usize, TrainingErrors), dynident_estimation::EstimationError> {
    let problem = &identification.training.problem;
    let names = identification.model().joint_names();
    let mut sums = vec![(0_usize, 0.0, 0.0); names.len()];
    for equation in problem.equations() {
        let theta: Vec<f64> = equation.columns.iter().map(|&column| values[column]).collect();
        let factor = equation.factor.total();
        let sum = &mut sums[equation.joint];
        sum.0 += factor.rows();
        sum.1 += factor.residual_sum_of_squares(&theta)?;
        sum.2 += factor.torque_norm().powi(2);
    }
    let percent = |error: f64, torque: f64| (torque > 0.0).then(|| 100.0 * (error / torque).sqrt());
    let (error, torque) = sums.iter().fold((0.0, 0.0), |(e, t), sum| (e + sum.1, t + sum.2));
    let samples = sums.iter().map(|sum| sum.0).max().unwrap_or(0);
    let errors = TrainingErrors {
        relative_error_percent: percent(error, torque),
        joints: names
            .into_iter()
            .zip(sums)
            .map(|(name, (rows, error, torque))| TrainingJoint {
                name,
                rmse_nm: (error / rows.max(1) as f64).sqrt(),
                relative_error_percent: percent(error, torque),
            })
            .collect(),
    };
    Ok((samples, errors))
}

pub(super) fn verdict(model: &RegressorModel, inertials: &[InertialParameters], parameters: &[f64]) -> PhysicalVerdict {
    let violations = violations(&model.parametric, inertials, &parameters[model.model().inertial_count()..]);
    PhysicalVerdict {
        consistent: violations.is_empty(),
        violations,
        fit: None,
        failure: None,
        impossible_priors: Vec::new(),
        sign: None,
        note: "of the full set nearest to the prior; least squares does not enforce consistency, and another set with the same torques may be consistent"
            .to_owned(),
    }
}

pub(super) fn physical_fit_result(fit: &PhysicalFit, estimate: &Estimate) -> PhysicalFitResult {
    PhysicalFitResult {
        status: match fit.status {
            PhysicalStatus::Solved => "solved",
            PhysicalStatus::Stalled => "stalled",
            PhysicalStatus::IterationLimit => "iteration-limit",
        }
        .to_owned(),
        iterations: fit.iterations,
        stationarity: fit.stationarity,
        duality_gap: fit.duality_gap,
        moved_sigma: fit.moved_sigma,
        largest_move_std: fit
            .moves_in_std(&estimate.values, &estimate.std)
            .ok()
            .and_then(|moves| moves.into_iter().flatten().map(f64::abs).max_by(f64::total_cmp)),
        difference: fit.difference(estimate),
        active: fit.active.clone(),
        bodies: fit
            .bodies
            .iter()
            .map(|body| PhysicalBodyResult {
                name: body.name.clone(),
                margin: body.least_whitened_eigenvalue,
                on_the_boundary: body.on_the_boundary,
            })
            .collect(),
    }
}

pub(super) fn friction_results(choice: &[JointFriction]) -> Vec<JointFrictionResult> {
    let of_joint = |joint: &JointFriction| JointFrictionResult {
        joint: joint.joint.clone(),
        chosen: joint.chosen.clone(),
        drive: joint.terms.as_deref().map(JointDrive::stating),
        constants: joint.constants.clone(),
        folds: joint.folds,
        candidates: joint.candidates.clone(),
        unrestricted: joint.unrestricted.clone(),
    };
    choice.iter().map(of_joint).collect()
}
