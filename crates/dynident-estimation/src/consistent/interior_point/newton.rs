//! State of the path-following method, and its Newton systems.

use super::super::cone::Scaling;
use super::super::conic::{Block, BlockMap, Program};
use super::super::coordinates::{Matrix10, Vector10, matrix_of, vector_of};
use super::super::precise::Precise;
use super::super::stacked::{LocalRows, RightSide, Rows, Singles, StackedSystem};
use nalgebra::{DMatrix, DVector, Matrix4};

#[derive(Clone, Debug)]
pub(super) struct Cone {
    pub(super) scaling: Scaling,
    /// The body whose variables are S up to a constant: its scaling is the frame of those variables.
    pub(super) owner: Option<usize>,
}

#[derive(Clone, Copy, Debug)]
pub(super) struct Pair {
    pub(super) slack: f64,
    pub(super) force: f64,
}

#[derive(Clone, Debug)]
pub(super) struct State {
    pub(super) x: Precise,
    pub(super) cones: Vec<Cone>,
    pub(super) rows: Vec<Pair>,
    /// Whether a full step was taken: the multipliers then balance the gradient up to rounding.
    pub(super) balanced: bool,
}

pub(super) struct Direction {
    pub(super) x: DVector<f64>,
    pub(super) primal: Vec<Matrix4<f64>>,
    pub(super) dual: Vec<Matrix4<f64>>,
    pub(super) row_primal: Vec<f64>,
    pub(super) row_dual: Vec<f64>,
}

pub(super) struct Targets {
    pub(super) blocks: Vec<Matrix4<f64>>,
    pub(super) rows: Vec<f64>,
}

/// A Newton system with the data of its right-hand sides.
pub(super) struct Newton<'a> {
    pub(super) program: &'a Program,
    pub(super) state: &'a State,
    pub(super) system: StackedSystem,
    /// Coefficients of every row of the program in the frame (not scaled).
    pub(super) framed_rows: Vec<DVector<f64>>,
    pub(super) singles: Singles,
    /// `b − A x` (zero for limited data), and the same for the local squares.
    pub(super) data_rest: DVector<f64>,
    pub(super) local_rest: Vec<DVector<f64>>,
    pub(super) linear: DVector<f64>,
}

pub(super) fn add_block(rows: &mut Rows, map: &BlockMap, cone: &Cone, state: &State) {
    let square = |matrix: &Matrix10| DMatrix::from_column_slice(10, 10, matrix.as_slice());
    match (map, cone.owner) {
        (BlockMap::Own(first), Some(_)) => {
            rows.local.push(LocalRows { first: *first, matrix: square(&cone.scaling.scaled_frame()) });
        }
        (BlockMap::Own(first), None) => {
            let matrix = match state.cones.iter().find(|cone| cone.owner == Some(*first)) {
                Some(owner) => cone.scaling.scaled_frame_of(&owner.scaling),
                None => cone.scaling.inverse_frame(),
            };
            rows.local.push(LocalRows { first: *first, matrix: square(&matrix) });
        }
        (BlockMap::General(map), _) => {
            let framed = rows.framed(map);
            rows.wide.push(square(&cone.scaling.inverse_frame()) * framed);
        }
    }
}

impl<'a> Newton<'a> {
    pub(super) fn new(program: &'a Program, state: &'a State) -> Option<Self> {
        let mut rows = Rows::default();
        for cone in &state.cones {
            if let Some(first) = cone.owner {
                rows.frames.push((first, cone.scaling.frame()));
            }
        }
        // Limited squares are weighted by their multiplier.
        let limiting = program.data_limit.and_then(|_| state.rows.last()).map(|pair| pair.force);
        let mut data = rows.framed(&program.data);
        if let Some(force) = limiting {
            data *= force.sqrt();
        }
        rows.wide.push(data);
        for term in &program.local {
            let framed = rows.framed_part(term.first, &term.matrix);
            rows.local.push(LocalRows { first: term.first, matrix: framed });
        }
        for (block, cone) in program.blocks.iter().zip(&state.cones) {
            add_block(&mut rows, &block.map, cone, state);
        }
        let of_limit = limiting.map(|_| program.data_slope(&state.x));
        let framed_rows: Vec<DVector<f64>> = program
            .rows
            .iter()
            .map(|row| {
                let mut dense = DVector::zeros(program.variables);
                row.add_to(1.0, &mut dense);
                dense
            })
            .chain(of_limit)
            .map(|dense| rows.framed_gradient(&dense))
            .collect();
        let scaled = |(row, pair): (&DVector<f64>, &Pair)| row * (pair.force / pair.slack).sqrt();
        let scaled: Vec<DVector<f64>> = framed_rows.iter().zip(&state.rows).map(scaled).collect();
        let singles = rows.add_singles(&scaled);
        let linear = rows.framed_gradient(&program.linear);
        let system = StackedSystem::new(program.variables, rows)?;
        let local_rest = program
            .local
            .iter()
            .map(|term| &term.target - &term.matrix * state.x.high.rows(term.first, term.matrix.ncols()));
        let data_rest = state.x.data_rest(&program.data, &program.target);
        Some(Self {
            program,
            state,
            framed_rows,
            singles,
            data_rest: if limiting.is_some() { DVector::zeros(data_rest.len()) } else { data_rest.clone() },
            local_rest: local_rest.collect(),
            linear,
            system,
        })
    }

    /// Products at μ; those of an entropic block at its weight.
    pub(super) fn targets(&self, mu: f64) -> Targets {
        let goal = |block: &Block| if block.entropy > 0.0 { block.entropy } else { mu };
        let blocks = self.program.blocks.iter().map(|block| Matrix4::identity() * goal(block)).collect();
        Targets { blocks, rows: vec![mu; self.state.rows.len()] }
    }

    pub(super) fn direction(&self, targets: &Targets, share: f64) -> Option<Direction> {
        let cones = &self.state.cones;
        let wanted: Vec<Matrix4<f64>> =
            cones.iter().zip(&targets.blocks).map(|(cone, target)| cone.scaling.divided(target)).collect();
        let right = self.right_side(&wanted, &targets.rows, share);
        let u = self.system.solve(&right);
        if !u.iter().all(|value| value.is_finite()) {
            return None;
        }
        let x = self.system.rows().unframed(&u);
        let primal: Vec<Matrix4<f64>> = self
            .program
            .blocks
            .iter()
            .zip(cones)
            .map(|(block, cone)| match cone.owner {
                Some(first) => {
                    let own = Vector10::from_column_slice(&u.as_slice()[first..first + 10]);
                    matrix_of(&(cone.scaling.scaled_frame() * own))
                }
                None => cone.scaling.scaled_primal(&matrix_of(&block.linear_part(&x))),
            })
            .collect();
        let dual = wanted
            .iter()
            .zip(&primal)
            .zip(cones)
            .map(|((wanted, primal), cone)| wanted - Matrix4::from_diagonal(&cone.scaling.lambda) - primal)
            .collect();
        let row_primal: Vec<f64> = self.framed_rows.iter().map(|row| row.dot(&u)).collect();
        let row_dual = targets
            .rows
            .iter()
            .zip(&row_primal)
            .zip(&self.state.rows)
            .map(|((target, ds), p)| (target - p.force * ds) / p.slack - p.force)
            .collect();
        Some(Direction { x: u, primal, dual, row_primal, row_dual })
    }

    /// Mean excess of the products over their final values.
    pub(super) fn excess(&self, step: Option<(&Direction, f64)>) -> f64 {
        let plain =
            || self.state.cones.iter().zip(&self.program.blocks).enumerate().filter(|(_, (_, b))| b.entropy == 0.0);
        let degree = (4 * plain().count() + self.state.rows.len()).max(1) as f64;
        let blocks = plain().map(|(k, (cone, _))| {
            let diagonal = Matrix4::from_diagonal(&cone.scaling.lambda);
            let (s, z) = step.map_or((diagonal, diagonal), |(d, alpha)| {
                (diagonal + d.primal[k] * alpha, diagonal + d.dual[k] * alpha)
            });
            s.dot(&z).max(0.0)
        });
        let rows = self.state.rows.iter().enumerate().map(|(l, p)| {
            let (ds, dz) = step.map_or((0.0, 0.0), |(d, alpha)| (alpha * d.row_primal[l], alpha * d.row_dual[l]));
            ((p.slack + ds) * (p.force + dz)).max(0.0)
        });
        (blocks.sum::<f64>() + rows.sum::<f64>()) / degree
    }

    /// Right-hand side of a direction that removes `share` of the dual residual and changes the products to `wanted`
    /// (scaled, `½ (Λ D + D Λ)` is the new product) and `rows`.
    pub(super) fn right_side(&self, wanted: &[Matrix4<f64>], rows: &[f64], share: f64) -> RightSide {
        let mut local: Vec<DVector<f64>> = self.local_rest.iter().map(|rest| rest * share).collect();
        let mut wide = vec![&self.data_rest * share];
        for ((block, wanted), cone) in self.program.blocks.iter().zip(wanted).zip(&self.state.cones) {
            let kept = Matrix4::from_diagonal(&cone.scaling.lambda) * (1.0 - share);
            let h = DVector::from_column_slice(vector_of(&(wanted - kept)).as_slice());
            match block.map {
                BlockMap::Own(_) => local.push(h),
                BlockMap::General(_) => wide.push(h),
            }
        }
        let of_row = |(p, target): (&Pair, &f64)| {
            let root = (p.slack * p.force).sqrt();
            target / root - (1.0 - share) * root
        };
        let of_rows: Vec<f64> = self.state.rows.iter().zip(rows).map(of_row).collect();
        self.singles.append(&of_rows, &mut local, &mut wide);
        RightSide { local, wide, direct: &self.linear * -share }
    }

    /// Dual residual in the frames. Divided by √μ it is the displacement by the imbalance relative to the room of the
    /// barrier.
    pub(super) fn residual(&self) -> f64 {
        let now: Vec<Matrix4<f64>> =
            self.state.cones.iter().map(|cone| Matrix4::from_diagonal(&cone.scaling.lambda)).collect();
        let rows: Vec<f64> = self.state.rows.iter().map(|p| p.slack * p.force).collect();
        self.system.rows().transposed(&self.right_side(&now, &rows, 1.0)).amax()
    }

    /// Number of products in the mean μ.
    pub(super) fn degree(&self) -> f64 {
        let plain = self.program.blocks.iter().filter(|b| b.entropy == 0.0).count();
        (4 * plain + self.state.rows.len()).max(1) as f64
    }

    pub(super) fn longest(&self, d: &Direction) -> f64 {
        let mut alpha = f64::INFINITY;
        for (k, cone) in self.state.cones.iter().enumerate() {
            alpha = alpha.min(cone.scaling.largest_step(&d.primal[k])).min(cone.scaling.largest_step(&d.dual[k]));
        }
        if self.program.data_limit.is_some() {
            alpha = alpha.min(self.longest_within_limit(d));
        }
        for (l, pair) in self.state.rows.iter().enumerate() {
            for (value, change) in [(pair.slack, d.row_primal[l]), (pair.force, d.row_dual[l])] {
                if change < 0.0 {
                    alpha = alpha.min(-value / change);
                }
            }
        }
        alpha
    }
}
