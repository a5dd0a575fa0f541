//! Assembly of the convex program from a [`PhysicalProblem`], and the way back to parameters.

use super::conic::{Block, BlockMap, Certificate, LocalSquares, Program, Row};
use super::constraints::{cone_name, linear_constraints};
use super::coordinates::{Vector10, vector_of};
use super::description::PhysicalProblem;
use super::interior_point::interior_point_until;
use super::priors::PriorBody;
use super::{PhysicalError, PhysicalSettings};
use nalgebra::{DMatrix, DVector, Matrix4};

/// A program with the meaning of its variables and constraints.
#[derive(Clone, Debug)]
pub(super) struct AssembledProgram {
    pub(super) program: Program,
    pub(super) names: Vec<String>,
    pub(super) starts: Vec<Option<usize>>,
    first_scalar: usize,
    /// Constant part of the prior, not included in the program's objective.
    pub(super) constant: f64,
}

impl AssembledProgram {
    pub(super) fn new(problem: &PhysicalProblem, settings: &PhysicalSettings) -> Self {
        let mut count = 0;
        let starts: Vec<Option<usize>> = problem
            .bodies
            .iter()
            .map(|body| {
                body.known.is_none().then(|| {
                    count += 10;
                    count - 10
                })
            })
            .collect();
        let first_scalar = count;
        let variables = count + problem.scalars.len();
        let mut program = Program::new(variables);
        let mut names = Vec::new();
        let mut constant = 0.0;
        let all = &problem.triangle * problem.base.matrix();
        let mut data = DMatrix::zeros(all.nrows(), variables);
        let mut target = problem.rotated.clone();
        for (index, body) in problem.bodies.iter().enumerate() {
            let columns = all.columns(10 * index, 10);
            let (Some(first), whitening) = (starts[index], &problem.whitenings[index]) else {
                target -= columns * DVector::from_column_slice(&body.known.unwrap_or_default());
                continue;
            };
            data.columns_mut(first, 10).copy_from(&(columns * whitening.to_parameters));
            let label = names.len();
            names.push(cone_name(&body.name));
            let offset = vector_of(&Matrix4::identity()) * -settings.margin;
            program.blocks.push(Block { map: BlockMap::Own(first), offset, entropy: 0.0, label });
            let prior = PriorBody { reference: &body.reference, whitening, label };
            constant += settings.prior.add_to(&mut program, first, &prior, settings.prior_weight);
            let rows = problem.prior_rows(index).into_iter();
            program.local.extend(rows.map(|(matrix, target)| LocalSquares { first, matrix, target }));
        }
        for (index, scalar) in problem.scalars.iter().enumerate() {
            let column = all.column(10 * problem.bodies.len() + index) * scalar.scale;
            data.set_column(first_scalar + index, &column);
            let weight = settings.prior_weight.sqrt();
            program.local.push(LocalSquares {
                first: first_scalar + index,
                matrix: DMatrix::from_element(1, 1, weight),
                target: DVector::from_element(1, weight * scalar.prior / scalar.scale),
            });
        }
        (program.data, program.target) = (data, target);
        let mut assembled = Self { program, names, starts, first_scalar, constant };
        for constraint in linear_constraints(problem) {
            let label = assembled.names.len();
            assembled.names.push(constraint.name);
            let row = assembled.row(problem, &constraint.entries, constraint.offset, label);
            assembled.program.rows.push(row);
        }
        assembled
    }

    /// Converts a constraint on standard parameters into one on variables, scaled to unit length.
    pub(super) fn row(&self, problem: &PhysicalProblem, entries: &[(usize, f64)], offset: f64, label: usize) -> Row {
        let found = self.functional(problem, entries);
        let length = found.iter().map(|(_, value)| value * value).sum::<f64>().sqrt();
        let scale = if length > 0.0 { 1.0 / length } else { 1.0 };
        let entries = found.into_iter().map(|(column, value)| (column, value * scale)).collect();
        Row { entries, offset: offset * scale, label }
    }

    /// Converts coefficients of standard parameters into those of variables; known bodies have no variables.
    pub(super) fn functional(&self, problem: &PhysicalProblem, entries: &[(usize, f64)]) -> Vec<(usize, f64)> {
        let bodies = problem.bodies.len();
        let mut by_body: Vec<(usize, [f64; 10])> = Vec::new();
        let mut found = Vec::new();
        for &(column, value) in entries {
            if column >= 10 * bodies {
                let index = column - 10 * bodies;
                found.push((self.first_scalar + index, value * problem.scalars[index].scale));
                continue;
            }
            let body = column / 10;
            match by_body.iter_mut().find(|(at, _)| *at == body) {
                Some((_, w)) => w[column % 10] += value,
                None => by_body.push((body, core::array::from_fn(|k| if k == column % 10 { value } else { 0.0 }))),
            }
        }
        for (body, w) in by_body {
            if let Some(first) = self.starts[body] {
                let functional = problem.whitenings[body].functional(&w);
                found.extend(functional.iter().enumerate().map(|(k, &value)| (first + k, value)));
            }
        }
        found.retain(|&(_, value)| value != 0.0);
        found
    }

    pub(super) fn parameters(&self, problem: &PhysicalProblem, x: &DVector<f64>) -> Vec<f64> {
        let mut parameters = Vec::with_capacity(10 * problem.bodies.len() + problem.scalars.len());
        for (index, body) in problem.bodies.iter().enumerate() {
            match (self.starts[index], body.known) {
                (Some(first), _) => {
                    let x = Vector10::from_column_slice(&x.as_slice()[first..first + 10]);
                    parameters.extend((problem.whitenings[index].to_parameters * x).iter());
                }
                (None, known) => parameters.extend(known.unwrap_or_default()),
            }
        }
        let scalars = problem.scalars.iter().enumerate();
        parameters.extend(scalars.map(|(index, scalar)| x[self.first_scalar + index] * scalar.scale));
        parameters
    }

    /// A point strictly inside all constraints: the prior if it is inside, otherwise the point farthest from the
    /// constraints.
    pub(super) fn interior_start(&self, problem: &PhysicalProblem) -> Result<DVector<f64>, PhysicalError> {
        let mut x = DVector::zeros(self.program.variables);
        for first in self.starts.iter().flatten() {
            x.rows_mut(*first, 10).copy_from(&vector_of(&Matrix4::identity()));
        }
        for (index, scalar) in problem.scalars.iter().enumerate() {
            let inside = match (scalar.lower, scalar.upper) {
                (Some(lower), Some(upper)) => {
                    let room = (0.1 * (upper - lower)).min(scalar.scale);
                    scalar.prior.clamp(lower + room, upper - room)
                }
                (Some(lower), None) => scalar.prior.max(lower + scalar.scale),
                (None, Some(upper)) => scalar.prior.min(upper - scalar.scale),
                (None, None) => scalar.prior,
            };
            x[self.first_scalar + index] = inside / scalar.scale;
        }
        if self.program.strictly_inside(&x) { Ok(x) } else { self.roomiest(&x) }
    }

    /// Maximises t with `S_k ⪰ t 1` and every unit row at least t. If t is not positive, the constraints contradict
    /// each other, and those with nonzero multipliers are the conflicting ones (theorem of the alternative: Boyd and
    /// Vandenberghe 5.8).
    fn roomiest(&self, x: &DVector<f64>) -> Result<DVector<f64>, PhysicalError> {
        let phase = RoomProgram::new(&self.program, x);
        let count = self.program.variables;
        // A start point with half of the largest possible room t is sufficient; the duality gap bounds that room.
        let enough = |x: &DVector<f64>, now: &Certificate| {
            x[count] > SUFFICIENT_ROOM && x[count] > now.gap * (1.0 + now.objective.abs()) && now.stationarity < 1.0e-3
        };
        let solved = interior_point_until(&phase.program, phase.start, (ROOM_TOLERANCE, 300), enough)
            .ok_or(PhysicalError::Breakdown)?;
        let room = solved.x[count];
        let found = solved.x.rows(0, count).into_owned();
        if room > MIN_ROOM && self.program.strictly_inside(&found) {
            return Ok(found);
        }
        let mut shares: Vec<(usize, f64)> = Vec::new();
        let limits = phase.program.blocks.iter().zip(&solved.multipliers.blocks).map(|(b, z)| (b.label, z.trace()));
        let rows = phase.program.rows.iter().zip(&solved.multipliers.rows).map(|(r, &z)| (r.label, z));
        for (label, share) in limits.chain(rows).filter(|(label, _)| *label < self.names.len()) {
            match shares.iter_mut().find(|(at, _)| *at == label) {
                Some((_, sum)) => *sum += share,
                None => shares.push((label, share)),
            }
        }
        let largest = shares.iter().map(|&(_, share)| share).fold(0.0, f64::max);
        let constraints = shares
            .into_iter()
            .filter(|&(_, share)| share >= 1.0e-3 * largest)
            .map(|(label, _)| self.names[label].clone())
            .collect();
        Err(PhysicalError::Contradictory { constraints, shortfall: (-room).max(0.0) })
    }
}

/// Accuracy and minimum of the room t: a feasible set with less room has no interior in double precision.
const ROOM_TOLERANCE: f64 = 1.0e-9;
const MIN_ROOM: f64 = 1.0e-8;
const SUFFICIENT_ROOM: f64 = 1.0e-6;

/// A program that maximises the room t of another program's constraints; t is its last variable.
pub(super) struct RoomProgram {
    pub(super) program: Program,
    pub(super) start: DVector<f64>,
}

/// Limit of mass and size in multiples of the references, to keep the search bounded.
const MAX_SIZE_RATIO: f64 = 1.0e6;

impl RoomProgram {
    pub(super) fn new(constrained: &Program, x: &DVector<f64>) -> Self {
        let count = constrained.variables;
        let mut program = Program::new(count + 1);
        let mut least = 1.0_f64;
        // Unconstrained variables (an offset) are fixed, because without data they would be undetermined.
        let mut held = vec![true; count];
        for block in constrained.blocks.iter().filter(|block| block.entropy == 0.0) {
            let mut map = DMatrix::zeros(10, count + 1);
            match &block.map {
                BlockMap::Own(first) => map.view_mut((0, *first), (10, 10)).fill_with_identity(),
                BlockMap::General(general) => map.columns_mut(0, count).copy_from(general),
            }
            for (held, column) in held.iter_mut().zip(map.column_iter()) {
                *held &= column.amax() == 0.0;
            }
            let unit = vector_of(&Matrix4::identity());
            let trace = map.tr_mul(&unit);
            map.set_column(count, &-unit);
            let s = block.value(x);
            least = least.min(super::cone::least_eigenvalue(&s));
            let entries: Vec<(usize, f64)> =
                trace.iter().enumerate().filter(|(_, v)| **v != 0.0).map(|(k, &v)| (k, -v)).collect();
            if !entries.is_empty() {
                let offset = 4.0 * MAX_SIZE_RATIO + 2.0 * s.trace().abs() - block.offset.dot(&unit);
                let length = entries.iter().map(|(_, v)| v * v).sum::<f64>().sqrt();
                let entries = entries.into_iter().map(|(k, v)| (k, v / length)).collect();
                program.rows.push(Row { entries, offset: offset / length, label: usize::MAX });
            }
            program.blocks.push(Block { map: BlockMap::General(map), ..block.clone() });
        }
        for row in &constrained.rows {
            least = least.min(row.value(x));
            row.entries.iter().for_each(|&(column, _)| held[column] = false);
            let mut row = row.clone();
            row.entries.push((count, -1.0));
            program.rows.push(row);
        }
        for first in (0..count).filter(|&column| held[column]) {
            let (matrix, target) = (DMatrix::from_element(1, 1, 1.0), DVector::from_element(1, x[first]));
            program.local.push(LocalSquares { first, matrix, target });
        }
        program.rows.push(Row { entries: vec![(count, -1.0)], offset: 1.0, label: usize::MAX });
        program.linear[count] = -1.0;
        let mut start = x.clone().resize_vertically(count + 1, 0.0);
        start[count] = least - 1.0 - 0.1 * least.abs();
        Self { program, start }
    }
}
