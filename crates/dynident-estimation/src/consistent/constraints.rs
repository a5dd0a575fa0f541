//! Linear constraints on standard parameters, with their names.

use super::description::PhysicalProblem;

/// `Σ a π + o ≥ 0` over free standard parameters.
pub(super) struct LinearConstraint {
    pub(super) entries: Vec<(usize, f64)>,
    pub(super) offset: f64,
    pub(super) name: String,
}

pub(super) fn linear_constraints(problem: &PhysicalProblem) -> Vec<LinearConstraint> {
    let mut found = Vec::new();
    let mut add = |entries: Vec<(usize, f64)>, offset: f64, name: String| {
        found.push(LinearConstraint { entries, offset, name });
    };
    for (index, body) in problem.bodies.iter().enumerate().filter(|(_, body)| body.known.is_none()) {
        let (first, name) = (10 * index, &body.name);
        if let Some([least, greatest]) = body.mass_kg {
            // A positive mass needs no constraint.
            if least > 0.0 {
                add(vec![(first, 1.0)], -least, format!("body {name}: mass at least {least} kg"));
            }
            add(vec![(first, -1.0)], greatest, format!("body {name}: mass at most {greatest} kg"));
        }
        if let Some([low, high]) = body.com_box_m {
            for axis in 0..3 {
                let (letter, moment) = (["x", "y", "z"][axis], first + 1 + axis);
                let (low, high) = (low[axis], high[axis]);
                let place = format!("body {name}: centre of mass along {letter}");
                add(vec![(first, -low), (moment, 1.0)], 0.0, format!("{place} at least {low} m"));
                add(vec![(first, high), (moment, -1.0)], 0.0, format!("{place} at most {high} m"));
            }
        }
        if let Some(ellipsoid) = body.inside {
            let (c, squares) = (ellipsoid.centre_m, ellipsoid.semi_axes_m.map(|a| a * a));
            let mass = 1.0 - (0..3).map(|k| c[k] * c[k] / squares[k]).sum::<f64>();
            let mut entries = vec![(first, mass)];
            entries.extend((0..3).map(|k| (first + 1 + k, 2.0 * c[k] / squares[k])));
            // −Σ_xx / a² with Σ_xx = ½ (Iyy + Izz − Ixx), and so on.
            for (k, place) in [4, 7, 9].into_iter().enumerate() {
                let own: f64 = (0..3).map(|j| if j == k { 0.5 } else { -0.5 } / squares[j]).sum();
                entries.push((first + place, own));
            }
            add(entries, 0.0, format!("body {name}: all mass inside the ellipsoid"));
        }
    }
    if let Some([least, greatest]) = problem.total_mass_kg {
        let known: f64 = problem.bodies.iter().filter_map(|body| body.known).map(|known| known[0]).sum();
        let free = problem.bodies.iter().enumerate().filter(|(_, body)| body.known.is_none());
        let masses: Vec<usize> = free.map(|(index, _)| 10 * index).collect();
        let all = |sign: f64| masses.iter().map(|&column| (column, sign)).collect();
        add(all(1.0), known - least, format!("total mass at least {least} kg"));
        add(all(-1.0), greatest - known, format!("total mass at most {greatest} kg"));
    }
    let first = 10 * problem.bodies.len();
    for (index, scalar) in problem.scalars.iter().enumerate() {
        let name = &scalar.name;
        if let Some(lower) = scalar.lower {
            add(vec![(first + index, 1.0)], -lower, format!("{name} at least {lower}"));
        }
        if let Some(upper) = scalar.upper {
            add(vec![(first + index, -1.0)], upper, format!("{name} at most {upper}"));
        }
    }
    found
}

pub(super) fn cone_name(body: &str) -> String {
    format!("body {body}: pseudo-inertia positive definite")
}
