//! Is a base vector one of a possible machine? With all sets of bodies that give it, or a proof that there is none.

use super::assembly::RoomProgram;
use super::cone::least_eigenvalue;
use super::conic::{Block, BlockMap, Program, Row};
use super::constraints::{cone_name, linear_constraints};
use super::coordinates::{Vector10, matrix_of, vector_of};
use super::description::{PhysicalProblem, expect, finite};
use super::fit::{PhysicalFit, physical_fit};
use super::interior_point::interior_point;
use super::{PhysicalError, PhysicalSettings};
use dynident_dynamics::independent_columns;
use nalgebra::{DMatrix, DVector};
use serde::Serialize;

/// Whether a base vector is possible.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum BaseVerdict {
    /// Some bodies strictly inside all constraints give it.
    Possible,
    /// Within accuracy on the boundary of what is possible.
    Boundary,
    /// No bodies give it.
    Impossible,
}

/// A weighted sum of base parameters that no possible machine has so small: `w·θ = value < least`, though `w·B π ≥ least` for every possible π. It proves
/// the verdict and can be checked by hand.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SeparatingSum {
    /// w, one weight per base parameter; the largest is ±1.
    pub weights: Vec<f64>,
    /// The sum for the vector in question.
    pub value: f64,
    /// The least that a possible machine can have.
    pub least: f64,
}

/// What is known of a base vector.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct BaseFeasibility {
    /// The verdict.
    pub verdict: BaseVerdict,
    /// The largest t for which some bodies with this base vector have `P_i ⪰ t P0_i` and every limit kept by t (of its constraint scaled to unit length in units
    /// of the reference); looked for up to 1. Negative: by so much every choice fails.
    pub margin: f64,
    /// The standard parameters with that margin.
    pub parameters: Vec<f64>,
    /// The constraints that keep the margin from growing.
    pub limiting: Vec<String>,
    /// The proof of an impossible verdict.
    pub separating: Option<SeparatingSum>,
}

/// Margins within this of zero are not told from zero: some ten times the accuracy they are found with.
const BOUNDARY: f64 = 1.0e-7;

/// Whether bodies exist with `B π = theta` that meet all constraints of a problem (its data play no part): maximises the margin t over all π with that base vector,
/// a semidefinite program with duality (Sousa and Cortesão, IJRR 33 (2014) 931, section 4).
///
/// # Errors
/// [`PhysicalError::Mismatch`], [`PhysicalError::NotFinite`], [`PhysicalError::Breakdown`].
pub fn base_feasibility(problem: &PhysicalProblem, theta: &[f64]) -> Result<BaseFeasibility, PhysicalError> {
    let b = problem.base.matrix();
    expect("base parameters", b.nrows(), theta.len())?;
    finite("a base parameter", theta)?;
    let free: Vec<usize> = (0..b.ncols()).filter(|&c| known_value(problem, c).is_none()).collect();
    let units = units(problem);
    // Columns in their own units, so that independence is judged on numbers of one size.
    let scaled = DMatrix::from_fn(b.nrows(), free.len(), |r, c| b[(r, free[c])] * units[free[c]]);
    let known: DVector<f64> = DVector::from_fn(b.nrows(), |r, _| {
        (0..b.ncols()).filter_map(|c| known_value(problem, c).map(|value| b[(r, c)] * value)).sum()
    });
    let right = DVector::from_column_slice(theta) - &known;
    let split = independent_columns(&scaled, 1.0e-9);
    let own = DMatrix::from_fn(b.nrows(), split.independent.len(), |r, c| scaled[(r, split.independent[c])]);
    let particular = least_squares(&own, &right)?;
    let missed = (&own * &particular - &right).amax();
    let size = right.amax().max(1.0e-300);
    if missed > 1.0e-7 * size {
        // Known bodies leave base parameters that nothing free can change.
        let rest = &right - &own * &particular;
        let scale = rest.amax();
        let weights: Vec<f64> = rest.iter().map(|v| -v / scale).collect();
        let at = |v: &DVector<f64>| v.iter().zip(&weights).map(|(v, w)| v * w).sum::<f64>();
        let (value, least) = (at(&DVector::from_column_slice(theta)), at(&known));
        let mut parameters: Vec<f64> = (0..b.ncols()).map(|c| known_value(problem, c).unwrap_or(0.0)).collect();
        for (k, &c) in split.independent.iter().enumerate() {
            parameters[free[c]] = particular[k] * units[free[c]];
        }
        return Ok(BaseFeasibility {
            verdict: BaseVerdict::Impossible,
            margin: f64::NEG_INFINITY.max(-missed / size),
            parameters,
            limiting: problem
                .bodies
                .iter()
                .filter(|b| b.known.is_some())
                .map(|b| format!("body {}: known", b.name))
                .collect(),
            separating: Some(SeparatingSum { weights, value, least }),
        });
    }
    // π = origin + span y over all columns: what the base vector leaves open.
    let mut origin = DVector::from_fn(b.ncols(), |c, _| known_value(problem, c).unwrap_or(0.0));
    let mut span = DMatrix::zeros(b.ncols(), split.dependent.len());
    for (k, &c) in split.independent.iter().enumerate() {
        let column = free[c];
        origin[column] = particular[k] * units[column];
        for d in 0..split.dependent.len() {
            span[(column, d)] = -split.regrouping[(k, d)] * units[column];
        }
    }
    for (d, &c) in split.dependent.iter().enumerate() {
        span[(free[c], d)] = units[free[c]];
    }
    let (program, names) = open_program(problem, &origin, &span);
    // The prior's own values of what is open are as good a start as any.
    let start = DVector::from_fn(split.dependent.len(), |d, _| {
        let column = free[split.dependent[d]];
        let bodies = 10 * problem.bodies.len();
        if column < bodies {
            problem.bodies[column / 10].reference[column % 10] / units[column]
        } else {
            problem.scalars[column - bodies].prior / units[column]
        }
    });
    let phase = RoomProgram::new(&program, &start);
    let solved = interior_point(&phase.program, phase.start, 1.0e-9, 300).ok_or(PhysicalError::Breakdown)?;
    let count = program.variables;
    let margin = solved.x[count];
    let parameters: Vec<f64> = (&origin + &span * solved.x.rows(0, count)).iter().copied().collect();
    let verdict = if margin > BOUNDARY {
        BaseVerdict::Possible
    } else if margin >= -BOUNDARY {
        BaseVerdict::Boundary
    } else {
        BaseVerdict::Impossible
    };
    // Multipliers as a functional on standard parameters: it is blind to what is open, so it is one on base parameters.
    let mut functional = DVector::zeros(b.ncols());
    let mut least = 0.0;
    let mut limiting = Vec::new();
    let heaviest = solved
        .multipliers
        .blocks
        .iter()
        .map(nalgebra::Matrix4::trace)
        .chain(solved.multipliers.rows.iter().copied())
        .fold(0.0, f64::max);
    let mut note = |label: usize, share: f64| {
        if share >= 1.0e-3 * heaviest && label < names.len() && !limiting.contains(&names[label]) {
            limiting.push(names[label].clone());
        }
    };
    for (block, z) in phase.program.blocks.iter().zip(&solved.multipliers.blocks) {
        note(block.label, z.trace());
        let weights = problem.whitenings[block.label].to_coordinates().tr_mul(&vector_of(z));
        let mut place = functional.rows_mut(10 * block.label, 10);
        place += weights;
    }
    let constraints = linear_constraints(problem);
    for (row, &z) in phase.program.rows.iter().zip(&solved.multipliers.rows) {
        note(row.label, z);
        if let Some(constraint) = row.label.checked_sub(problem.bodies.len()).and_then(|at| constraints.get(at)) {
            let length = constraint_length(problem, &constraint.entries);
            for &(column, value) in &constraint.entries {
                functional[column] += z * value / length;
            }
            least -= z * constraint.offset / length;
        }
    }
    let separating = if verdict == BaseVerdict::Impossible {
        let wanted = DVector::from_fn(split.independent.len(), |k, _| {
            let column = free[split.independent[k]];
            functional[column] * units[column]
        });
        // The shortest w with w·B = functional on the independent columns.
        let w = &own * least_squares_gram(&own, &wanted)?;
        let scale = w.amax();
        (scale > 0.0).then(|| {
            let value = w.dot(&DVector::from_column_slice(theta)) / scale;
            let weights = w.iter().map(|v| v / scale).collect();
            SeparatingSum { weights, value, least: (least + w.dot(&known)) / scale }
        })
    } else {
        None
    };
    Ok(BaseFeasibility { verdict, margin, parameters, limiting, separating })
}

/// The possible base vector nearest to `theta` in the metric of the problem's data, `½‖R₁(θ' − theta)‖²`: [`physical_fit`] with the data's optimum put there.
///
/// # Errors
/// As [`physical_fit`].
pub fn nearest_feasible(
    problem: &PhysicalProblem,
    theta: &[f64],
    settings: &PhysicalSettings,
) -> Result<PhysicalFit, PhysicalError> {
    physical_fit(&problem.around(theta)?, settings)
}

/// A program over what the base vector leaves open, with no objective; labels count bodies, then linear constraints.
fn open_program(problem: &PhysicalProblem, origin: &DVector<f64>, span: &DMatrix<f64>) -> (Program, Vec<String>) {
    let mut program = Program::new(span.ncols());
    for (index, _) in problem.bodies.iter().enumerate().filter(|(_, body)| body.known.is_none()) {
        let to_coordinates = problem.whitenings[index].to_coordinates();
        let map = to_coordinates * span.rows(10 * index, 10);
        let offset = to_coordinates * Vector10::from_column_slice(origin.rows(10 * index, 10).as_slice());
        debug_assert!(!least_eigenvalue(&matrix_of(&offset)).is_nan());
        let map = DMatrix::from_column_slice(10, span.ncols(), map.as_slice());
        program.blocks.push(Block { map: BlockMap::General(map), offset, entropy: 0.0, label: index });
    }
    let mut names: Vec<String> = problem.bodies.iter().map(|body| cone_name(&body.name)).collect();
    for constraint in linear_constraints(problem) {
        let length = constraint_length(problem, &constraint.entries);
        let mut dense = DVector::zeros(span.ncols());
        let mut offset = constraint.offset / length;
        for &(column, value) in &constraint.entries {
            dense.axpy(value / length, &span.row(column).transpose(), 1.0);
            offset += value / length * origin[column];
        }
        let entries = dense.iter().copied().enumerate().filter(|(_, value)| *value != 0.0).collect();
        program.rows.push(Row { entries, offset, label: names.len() });
        names.push(constraint.name);
    }
    (program, names)
}

/// Length of a constraint in the units of the reference bodies.
fn constraint_length(problem: &PhysicalProblem, entries: &[(usize, f64)]) -> f64 {
    let units = units(problem);
    let square: f64 = entries.iter().map(|&(column, value)| (value * units[column]).powi(2)).sum();
    square.sqrt().max(f64::MIN_POSITIVE)
}

/// Ordinary size of every standard parameter.
fn units(problem: &PhysicalProblem) -> Vec<f64> {
    let bodies = problem.whitenings.iter().flat_map(super::coordinates::Whitening::units);
    bodies.chain(problem.scalars.iter().map(|scalar| scalar.scale)).collect()
}

fn known_value(problem: &PhysicalProblem, column: usize) -> Option<f64> {
    problem.bodies.get(column / 10)?.known.map(|known| known[column % 10])
}

fn least_squares(a: &DMatrix<f64>, b: &DVector<f64>) -> Result<DVector<f64>, PhysicalError> {
    let qr = a.clone().qr();
    qr.r().solve_upper_triangular(&qr.q().tr_mul(b)).ok_or(PhysicalError::Breakdown)
}

/// `(AᵀA)⁻¹ b` by the triangle of A.
fn least_squares_gram(a: &DMatrix<f64>, b: &DVector<f64>) -> Result<DVector<f64>, PhysicalError> {
    let r = a.clone().qr().r();
    let y = r.tr_solve_upper_triangular(b).ok_or(PhysicalError::Breakdown)?;
    r.solve_upper_triangular(&y).ok_or(PhysicalError::Breakdown)
}
