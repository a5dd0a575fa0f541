//! Accelerations for given torques, as symbols.

use crate::drive_torque::Drives;
use crate::equation::Inputs;
use crate::error::ExportError;
use crate::symbol::Symbol;
use dynident_dynamics::{inverse_dynamics_over, mass_matrix_over};
use dynident_lanes::{Real, Scalar};
use dynident_model::Model;

/// Mass matrix of the bodies and the drives, row-major.
pub(crate) fn mass_matrix(reduced: &Model, q: &[Symbol], rotors: &[f64]) -> Vec<Symbol> {
    let mut mass_matrix = mass_matrix_over(reduced, q);
    for (entry, &rotor) in mass_matrix.iter_mut().zip(rotors) {
        *entry += Symbol::splat(rotor);
    }
    mass_matrix
}

/// Accelerations `M⁻¹ (τ − C q̇ − g − friction)`.
///
/// # Errors
/// A joint without inertia.
pub(crate) fn forward(
    reduced: &Model,
    load: Option<&Model>,
    inputs: &Inputs,
    mass_matrix: &[Symbol],
    drives: &Drives,
) -> Result<Vec<Symbol>, ExportError> {
    let Inputs { q, dq, tau, rest, .. } = inputs;
    let bias = inverse_dynamics_over(reduced, q, dq, rest);
    let other = drives.torque(&[]);
    let left = (0..tau.len()).map(|joint| tau[joint] - (bias[joint] + other[joint])).collect();
    let factor = Factor::of(mass_matrix.to_vec(), tau.len())
        .map_err(|joint| ExportError::NoInertia { joint: reduced.joints()[joint].name.clone() })?;
    let acceleration = factor.solve(left);
    Ok(match (load, &drives.load_shares) {
        (Some(load), Some(shares)) => under_load(load, inputs, &factor, shares, acceleration),
        _ => acceleration,
    })
}

/// Number of iterations in which load-dependent friction converges. Each reduces the error by about the share of the
/// transmitted torque that is lost to friction: to 1e-9 in all for a share of 0.25, which is more than gears lose in
/// motion.
const LOAD_PASSES: usize = 15;

/// Subtracts load-dependent friction `f_i = s_i |l_i|` from the accelerations `a₀` without it. The transmitted torque
/// l depends on the acceleration: `l = l₀ − B f` with `l₀` at `a₀` and `B = L M⁻¹`, where `L` is the mass matrix of
/// the bodies that determine l. Solved by Gauss-Seidel iteration.
fn under_load(load: &Model, inputs: &Inputs, factor: &Factor, shares: &[Symbol], a: Vec<Symbol>) -> Vec<Symbol> {
    let Inputs { q, dq, rest, .. } = inputs;
    let dof = shares.len();
    let joints: Vec<usize> = (0..dof).filter(|&joint| !shares[joint].is_zero()).collect();
    let (matrix, bias) = (mass_matrix_over(load, q), inverse_dynamics_over(load, q, dq, rest));
    let row = |joint: usize, x: &[Symbol]| {
        (0..dof).fold(Symbol::ZERO, |sum, column| sum + matrix[joint * dof + column] * x[column])
    };
    let unit = |joint: usize| (0..dof).map(|k| if k == joint { Symbol::ONE } else { Symbol::ZERO }).collect();
    let responses: Vec<Vec<Symbol>> = joints.iter().map(|&joint| factor.solve(unit(joint))).collect();
    let loads: Vec<Symbol> = joints.iter().map(|&joint| bias[joint] + row(joint, &a)).collect();
    let compliance: Vec<Vec<Symbol>> =
        joints.iter().map(|&joint| responses.iter().map(|response| row(joint, response)).collect()).collect();
    let mut friction: Vec<Symbol> =
        joints.iter().zip(&loads).map(|(&joint, load)| shares[joint] * load.abs()).collect();
    for _ in 0..LOAD_PASSES {
        for (place, &joint) in joints.iter().enumerate() {
            let taken = compliance[place].iter().zip(&friction);
            let load = taken.fold(loads[place], |load, (&compliance, &friction)| load - compliance * friction);
            friction[place] = shares[joint] * load.abs();
        }
    }
    let mut found = a;
    for (response, &friction) in responses.iter().zip(&friction) {
        found.iter_mut().zip(response).for_each(|(a, &response)| *a -= response * friction);
    }
    found
}

/// Factorisation `M = Lᵀ D L`, from the tip to the base, so that the zeros between independent branches are kept
/// (Featherstone, *Rigid Body Dynamics Algorithms* (2008), section 6.5).
struct Factor {
    m: Vec<Symbol>,
    inverses: Vec<Symbol>,
}

impl Factor {
    /// Returns the index of a joint as an error if its pivot is constant and not positive.
    fn of(mut m: Vec<Symbol>, dof: usize) -> Result<Self, usize> {
        let mut inverses = vec![Symbol::ZERO; dof];
        for k in (0..dof).rev() {
            let pivot = m[k * dof + k];
            if pivot.number().is_some_and(|pivot| pivot <= 0.0) {
                return Err(k);
            }
            inverses[k] = pivot.recip();
            for i in 0..k {
                let factor = m[k * dof + i] * inverses[k];
                if factor.is_zero() {
                    continue;
                }
                for j in 0..=i {
                    let taken = factor * m[k * dof + j];
                    m[i * dof + j] -= taken;
                }
            }
            for i in 0..k {
                m[k * dof + i] = m[k * dof + i] * inverses[k];
            }
        }
        Ok(Self { m, inverses })
    }

    /// `M⁻¹ b`.
    fn solve(&self, mut b: Vec<Symbol>) -> Vec<Symbol> {
        let (m, dof) = (&self.m, b.len());
        for k in (0..dof).rev() {
            for i in 0..k {
                let taken = m[k * dof + i] * b[k];
                b[i] -= taken;
            }
        }
        for k in 0..dof {
            b[k] = b[k] * self.inverses[k];
            for i in 0..k {
                let taken = m[k * dof + i] * b[i];
                b[k] -= taken;
            }
        }
        b
    }
}
