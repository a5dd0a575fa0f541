//! Minimisation of a smooth function inside a box by limited-memory BFGS on the free variables, with steps projected
//! onto the box.

use std::collections::VecDeque;

/// A smooth function whose gradient is requested only at the last evaluated point, so that it can store intermediate
/// values.
pub(crate) trait Smooth {
    /// Value at `x`; not finite where the function is undefined.
    fn value(&mut self, x: &[f64]) -> f64;
    fn gradient(&mut self, gradient: &mut [f64]);
    /// Prepares a model of the curvature at the point of the last [`gradient`](Smooth::gradient), from the gradient
    /// and the last step with its change of the gradient. Returns false if there is no model.
    fn prepare_metric(&mut self, _gradient: &[f64], _free: &[bool], _last: Option<Step<'_>>) -> bool {
        false
    }
    /// Multiplies a vector by the inverse of the prepared model.
    fn divide_by_metric(&self, _vector: &mut [f64]) {}
    fn halted(&self) -> bool;
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum End {
    /// The projected gradient is below the tolerance.
    Stationary,
    IterationLimit,
    /// No lower value along the steepest descent in double precision.
    NoDescent,
    Halted,
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct Effort {
    pub(crate) tolerance: f64,
    pub(crate) iterations: usize,
    pub(crate) memory: usize,
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct Step<'a> {
    /// Difference of the points.
    pub by: &'a [f64],
    /// Difference of the gradients.
    pub gradient_change: &'a [f64],
}

struct Pair {
    s: Vec<f64>,
    y: Vec<f64>,
}

/// Armijo's share of the predicted decrease, and Wolfe's share of the slope (Nocedal and Wright, *Numerical
/// Optimization*, 2006, section 3.1).
const MIN_DECREASE_SHARE: f64 = 1e-4;
const MAX_SLOPE_SHARE: f64 = 0.9;
const MAX_TRIALS: usize = 40;

/// Minimises from `x`, which must be inside the box, and moves it to the lowest point found. Returns the reason for the
/// end and the largest entry of the projected gradient `P(x - g) - x`.
///
/// Two-loop recursion (Nocedal and Wright 2006, algorithm 7.4) over the variables that the gradient does not press
/// against a bound (two-metric projection, Bertsekas 1982). The line search satisfies the weak Wolfe conditions by
/// bisection and doubling (Lewis and Overton 2013) along the projected path.
pub(crate) fn projected_lbfgs(
    function: &mut impl Smooth,
    bounds: &[[f64; 2]],
    x: &mut [f64],
    effort: &Effort,
) -> (End, f64) {
    let n = x.len();
    let value = function.value(x);
    let mut at = Point { x: x.to_vec(), value, gradient: vec![0.0; n] };
    function.gradient(&mut at.gradient);
    let mut pairs: VecDeque<Pair> = VecDeque::with_capacity(effort.memory);
    let mut end = End::IterationLimit;
    for _ in 0..effort.iterations {
        if function.halted() {
            end = End::Halted;
            break;
        }
        if projected_gradient(&at.x, &at.gradient, bounds) <= effort.tolerance {
            end = End::Stationary;
            break;
        }
        let held = |i: usize| {
            (at.x[i] <= bounds[i][0] && at.gradient[i] > 0.0) || (at.x[i] >= bounds[i][1] && at.gradient[i] < 0.0)
        };
        let free: Vec<bool> = (0..n).map(|i| !held(i)).collect();
        let last = pairs.back().map(|pair| Step { by: &pair.s, gradient_change: &pair.y });
        let shaped = function.prepare_metric(&at.gradient, &free, last);
        let shape = |vector: &mut [f64]| function.divide_by_metric(vector);
        let shape: Option<&Shape<'_>> = if shaped { Some(&shape) } else { None };
        let mut direction = quasi_newton(&pairs, &at.gradient, &free, shape);
        let steep = dot(&direction, &at.gradient) < -1e-10 * norm(&direction) * norm(&at.gradient);
        if !pairs.is_empty() && !steep {
            // The stored steps are deleted if the direction is not a descent direction or not finite.
            pairs.clear();
            direction = quasi_newton(&pairs, &at.gradient, &free, shape);
        }
        let first = if pairs.is_empty() && !shaped { cautious_step(&direction, bounds) } else { 1.0 };
        let Some(next) = line_search(function, bounds, &at, &direction, first) else {
            if function.halted() {
                end = End::Halted;
                break;
            }
            if pairs.is_empty() {
                end = End::NoDescent;
                break;
            }
            pairs.clear();
            continue;
        };
        let s: Vec<f64> = next.x.iter().zip(&at.x).map(|(a, b)| a - b).collect();
        let y: Vec<f64> = next.gradient.iter().zip(&at.gradient).map(|(a, b)| a - b).collect();
        if dot(&s, &y) > 1e-12 * norm(&s) * norm(&y) {
            if pairs.len() == effort.memory {
                pairs.pop_front();
            }
            pairs.push_back(Pair { s, y });
        }
        at = next;
    }
    x.copy_from_slice(&at.x);
    (end, projected_gradient(x, &at.gradient, bounds))
}

#[derive(Clone)]
struct Point {
    x: Vec<f64>,
    value: f64,
    gradient: Vec<f64>,
}

/// Searches along `P(from + step·direction)` for a point with sufficient decrease and a small enough slope. Returns
/// the last point with sufficient decrease.
fn line_search(
    function: &mut impl Smooth,
    bounds: &[[f64; 2]],
    from: &Point,
    direction: &[f64],
    first_step: f64,
) -> Option<Point> {
    let slope = dot(direction, &from.gradient);
    let (mut low, mut high, mut step) = (0.0, f64::INFINITY, first_step);
    let mut found: Option<Point> = None;
    for _ in 0..MAX_TRIALS {
        let straight: Vec<f64> = from.x.iter().zip(direction).map(|(x, d)| x + step * d).collect();
        let x: Vec<f64> = straight.iter().zip(bounds).map(|(x, &[lower, upper])| x.clamp(lower, upper)).collect();
        if x == from.x {
            break;
        }
        let value = function.value(&x);
        let predicted: f64 = (0..x.len()).map(|i| from.gradient[i] * (x[i] - from.x[i])).sum();
        let lower_enough = value.is_finite() && predicted < 0.0 && value <= from.value + MIN_DECREASE_SHARE * predicted;
        if lower_enough {
            let mut gradient = vec![0.0; x.len()];
            function.gradient(&mut gradient);
            // A variable at its bound does not move further along this path.
            let ahead: f64 = (0..x.len()).filter(|&i| x[i] == straight[i]).map(|i| gradient[i] * direction[i]).sum();
            found = Some(Point { x, value, gradient });
            if ahead >= MAX_SLOPE_SHARE * slope {
                break;
            }
            low = step;
        } else {
            high = step;
        }
        if function.halted() {
            break;
        }
        step = if high.is_infinite() {
            2.0 * step
        } else if low == 0.0 && value.is_finite() {
            // Minimum of the parabola through the known values.
            let parabola = -0.5 * slope * step * step / (value - from.value - slope * step);
            if parabola.is_finite() { parabola.clamp(0.1 * step, 0.5 * step) } else { 0.5 * step }
        } else {
            0.5 * (low + high)
        };
    }
    found
}

/// Multiplies a vector by the initial matrix of the recursion.
type Shape<'a> = dyn Fn(&mut [f64]) + 'a;

/// `-H g` on the free variables by the two-loop recursion, zero on the other variables. The initial matrix is `shape`
/// or a multiple of the identity.
fn quasi_newton(pairs: &VecDeque<Pair>, gradient: &[f64], free: &[bool], shape: Option<&Shape<'_>>) -> Vec<f64> {
    let masked = |v: &[f64], w: &[f64]| -> f64 { (0..v.len()).filter(|&i| free[i]).map(|i| v[i] * w[i]).sum() };
    let mut direction: Vec<f64> = gradient.iter().zip(free).map(|(&g, &free)| if free { -g } else { 0.0 }).collect();
    // Steps without positive curvature in the free variables are not used.
    let useful: Vec<(&Pair, f64)> = pairs
        .iter()
        .map(|pair| (pair, masked(&pair.s, &pair.y)))
        .filter(|(pair, sy)| *sy > 1e-12 * (masked(&pair.s, &pair.s) * masked(&pair.y, &pair.y)).sqrt())
        .collect();
    let mut weights = Vec::with_capacity(useful.len());
    for (pair, sy) in useful.iter().rev() {
        let weight = masked(&pair.s, &direction) / sy;
        weights.push(weight);
        add(&mut direction, -weight, &pair.y, free);
    }
    if let Some(shape) = shape {
        shape(&mut direction);
    } else if let Some((pair, sy)) = useful.last() {
        let scale = sy / masked(&pair.y, &pair.y);
        for d in &mut direction {
            *d *= scale;
        }
    }
    for ((pair, sy), weight) in useful.iter().zip(weights.iter().rev()) {
        let correction = masked(&pair.y, &direction) / sy;
        add(&mut direction, weight - correction, &pair.s, free);
    }
    direction
}

fn add(to: &mut [f64], factor: f64, v: &[f64], free: &[bool]) {
    for i in 0..to.len() {
        if free[i] {
            to[i] += factor * v[i];
        }
    }
}

/// Largest step, at most one, with which no variable moves by more than one unit or a tenth of its range.
fn cautious_step(direction: &[f64], bounds: &[[f64; 2]]) -> f64 {
    direction.iter().zip(bounds).fold(1.0, |step: f64, (d, &[lower, upper])| {
        let reach = (0.1 * (upper - lower)).min(1.0);
        if *d == 0.0 { step } else { step.min(reach / d.abs()) }
    })
}

/// Largest entry of `P(x - g) - x`: zero if no step inside the box decreases the function.
fn projected_gradient(x: &[f64], gradient: &[f64], bounds: &[[f64; 2]]) -> f64 {
    (0..x.len())
        .fold(0.0, |largest: f64, i| largest.max(((x[i] - gradient[i]).clamp(bounds[i][0], bounds[i][1]) - x[i]).abs()))
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn norm(a: &[f64]) -> f64 {
    dot(a, a).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The chained Rosenbrock function, with its minimum at (1, ..., 1).
    struct Rosenbrock(Vec<f64>);
    impl Smooth for Rosenbrock {
        fn value(&mut self, x: &[f64]) -> f64 {
            self.0 = x.to_vec();
            x.windows(2).map(|w| 100.0 * (w[1] - w[0] * w[0]).powi(2) + (1.0 - w[0]).powi(2)).sum()
        }
        fn gradient(&mut self, gradient: &mut [f64]) {
            gradient.fill(0.0);
            for (i, w) in self.0.windows(2).enumerate() {
                let bend = w[1] - w[0] * w[0];
                gradient[i] += -400.0 * w[0] * bend - 2.0 * (1.0 - w[0]);
                gradient[i + 1] += 200.0 * bend;
            }
        }
        fn halted(&self) -> bool {
            false
        }
    }
    const EFFORT: Effort = Effort { tolerance: 1e-9, iterations: 2000, memory: 10 };

    #[test]
    fn rosenbrocks_valley_has_its_end() {
        let mut x = vec![-1.2; 20];
        let bounds = vec![[f64::NEG_INFINITY, f64::INFINITY]; 20];
        let (end, _) = projected_lbfgs(&mut Rosenbrock(Vec::new()), &bounds, &mut x, &EFFORT);
        assert_eq!(end, End::Stationary);
        // Gradient 1e-9 over the smallest curvature, about 0.1 at the solution.
        assert!(x.iter().all(|x| (x - 1.0).abs() < 1e-7), "{x:?}");
    }

    #[test]
    fn bounds_are_kept_and_can_be_active() {
        // With x1 <= 0.5 the minimum is exactly (0.5, 0.25) (x2 = x1², slope in x1 is -1).
        let mut x = [-1.0, 2.0];
        let (end, _) = projected_lbfgs(&mut Rosenbrock(Vec::new()), &[[-2.0, 0.5], [-3.0, 3.0]], &mut x, &EFFORT);
        assert_eq!(end, End::Stationary);
        assert_eq!(x[0], 0.5);
        assert!((x[1] - 0.25).abs() < 1e-10, "{x:?}");
    }
}
