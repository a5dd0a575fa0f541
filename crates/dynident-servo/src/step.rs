//! Velocities at the end of one time step: an implicit step with exact dry friction.
//!
//! For each joint the torque is a piecewise linear, falling function of the velocity `x` at the end of the step, with a
//! jump at zero:
//!
//! ```text
//! t(x) = clip(pull - slope x, ±limit) - damping x - friction sign(x)
//! A x - w = t(x)          A = (M + armature) / h
//! ```
//!
//! `A` is positive definite, so exactly one solution exists (Moreau's time stepping; Anitescu and Potra 1997). Each
//! joint is assumed to be in one mode (moving or resting, controller at its limit or not). Modes that the solution
//! contradicts are changed: first all of them, later only the one with the smallest index, which is known to terminate
//! for such problems (Murty 1974).

/// The torque of one joint as a function of the velocity at the end of the step.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct JointLaw {
    /// Position gain in this run.
    pub(crate) stiffness: f64,
    /// Torque of the position controller at zero velocity.
    pub(crate) pull: f64,
    /// Decrease of this torque per velocity: stiffness × time step.
    pub(crate) slope: f64,
    /// Largest torque of the position controller.
    pub(crate) limit: f64,
    /// Damping torque per velocity.
    pub(crate) damping: f64,
    /// Largest friction torque.
    pub(crate) friction: f64,
}

impl JointLaw {
    /// The law with the limit applied to the sum of position controller and damping.
    pub(crate) fn with_limited_damping(self) -> Self {
        Self { slope: self.slope + self.damping, damping: 0.0, ..self }
    }

    /// A constant torque with friction.
    pub(crate) fn held(torque: f64, friction: f64) -> Self {
        Self { pull: torque, limit: f64::INFINITY, friction, ..Self::default() }
    }
}

/// Direction of motion of a joint in a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub(crate) enum Motion {
    #[default]
    Rests,
    Forward,
    Backward,
}

impl Motion {
    /// Sign of the velocity.
    pub(crate) fn sign(self) -> f64 {
        match self {
            Self::Rests => 0.0,
            Self::Forward => 1.0,
            Self::Backward => -1.0,
        }
    }

    fn of(sign: f64) -> Self {
        if sign > 0.0 { Self::Forward } else { Self::Backward }
    }
}

/// Whether the torque of the position controller is at its limit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub(crate) enum Clip {
    #[default]
    Inside,
    Upper,
    Lower,
}

/// Mode of a joint: the piece of its piecewise linear torque that applies.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub(crate) struct Mode {
    pub(crate) motion: Motion,
    pub(crate) clip: Clip,
}

impl Mode {
    /// Torque at zero velocity without friction, and its decrease per velocity, for this mode.
    fn piece(self, law: &JointLaw) -> (f64, f64) {
        match self.clip {
            Clip::Inside => (law.pull, law.slope + law.damping),
            Clip::Upper => (law.limit, law.damping),
            Clip::Lower => (-law.limit, law.damping),
        }
    }

    /// The next mode on the way to `required`: only one condition changes, and a controller changes from one limit to
    /// the other through its linear range.
    fn towards(self, required: Self) -> Self {
        match (self.clip, required.clip) {
            (own, other) if own == other => required,
            (Clip::Inside, clip) => Self { clip, ..self },
            _ => Self { clip: Clip::Inside, ..self },
        }
    }

    /// The mode that belongs to velocity `x` and to `rest`, the torque without friction at rest.
    fn required(self, law: &JointLaw, x: f64, rest: f64) -> Self {
        let controller = law.pull - law.slope * x;
        let clip = if controller > law.limit {
            Clip::Upper
        } else if controller < -law.limit {
            Clip::Lower
        } else {
            Clip::Inside
        };
        let motion = match self.motion {
            Motion::Rests if rest.abs() <= law.friction => Motion::Rests,
            Motion::Rests => Motion::of(rest),
            moving if x * moving.sign() > 0.0 => moving,
            // A joint without friction has no reason to rest.
            moving if law.friction == 0.0 => Motion::of(-moving.sign()),
            _ => Motion::Rests,
        };
        Self { motion, clip }
    }
}

/// A point that can touch the floor. At velocity `x` the contact force is `max(0, push - slope J x)`, where J is the
/// Jacobian of the point's height.
#[derive(Clone, Debug, Default)]
pub(crate) struct Contact {
    /// Contact force at zero velocity.
    pub(crate) push: f64,
    /// Decrease of the force per velocity of the point: stiffness × time step.
    pub(crate) slope: f64,
    /// Jacobian of the point's height: velocity of the point along the floor's normal per velocity of each joint.
    pub(crate) by_joint: Vec<f64>,
    /// Whether the point touches the floor.
    pub(crate) touches: bool,
    /// Contact force in the solution.
    pub(crate) force: f64,
}

/// The torques of all joints and contacts in a step, as functions of the velocities at its end.
#[derive(Debug)]
pub(crate) struct StepLaws {
    pub(crate) joints: Vec<JointLaw>,
    pub(crate) modes: Vec<Mode>,
    pub(crate) contacts: Vec<Contact>,
}

/// Solver for one step. It keeps the factorised matrix of the last solution for the computation of derivatives.
#[derive(Debug)]
pub(crate) struct StepSolver {
    dof: usize,
    /// Lower triangle of the Cholesky factor of the matrix for the moving joints, dof × dof.
    factor: Vec<f64>,
    /// Indices of the moving joints, in increasing order.
    pub(crate) moving: Vec<usize>,
    solution: Vec<f64>,
}

/// Number of changes of all contradicted modes at once, after which only one joint changes at a time.
const JOINT_CHANGES: usize = 8;
/// Maximum number of mode changes; no problem of practical size needs more.
const MOST_CHANGES: usize = 400;

impl StepSolver {
    pub(crate) fn new(dof: usize) -> Self {
        Self { dof, factor: vec![0.0; dof * dof], moving: Vec::with_capacity(dof), solution: vec![0.0; dof] }
    }

    /// Computes the velocities `x` at the end of the step from the matrix `a` (dof × dof, row-major), the right side
    /// `w` and the laws. The modes in the laws are a first guess and are replaced by the modes of the solution. Returns
    /// false if no consistent modes are found or the matrix is not positive definite; `x` is then not a solution.
    #[must_use]
    pub(crate) fn solve(&mut self, a: &[f64], w: &[f64], laws: &mut StepLaws, x: &mut [f64]) -> bool {
        for change in 0..MOST_CHANGES {
            if !self.solve_in_modes(a, w, laws, x) {
                return false;
            }
            if !self.change_modes(a, w, laws, x, change >= JOINT_CHANGES) {
                return true;
            }
        }
        false
    }

    /// Changes the modes that the solution contradicts, only one of them if `one` is true. Returns whether any mode
    /// changed.
    fn change_modes(&self, a: &[f64], w: &[f64], laws: &mut StepLaws, x: &[f64], one: bool) -> bool {
        let mut changed = false;
        for contact in &mut laws.contacts {
            let speed: f64 = contact.by_joint.iter().zip(x).map(|(j, x)| j * x).sum();
            let force = contact.push - contact.slope * speed;
            contact.force = if contact.touches { force } else { 0.0 };
            if contact.touches != (force > 0.0) {
                contact.touches = force > 0.0;
                changed = true;
                if one {
                    return true;
                }
            }
        }
        for joint in 0..self.dof {
            let row = &a[joint * self.dof..(joint + 1) * self.dof];
            let (law, mode) = (&laws.joints[joint], laws.modes[joint]);
            let inertial: f64 = row.iter().zip(x).map(|(a, x)| a * x).sum::<f64>() - w[joint];
            let contacts: f64 = laws.contacts.iter().map(|contact| contact.by_joint[joint] * contact.force).sum();
            let required = mode.required(law, x[joint], mode.piece(law).0 + contacts - inertial);
            if required != mode {
                laws.modes[joint] = if one { mode.towards(required) } else { required };
                changed = true;
                if one {
                    return true;
                }
            }
        }
        changed
    }

    fn solve_in_modes(&mut self, a: &[f64], w: &[f64], laws: &StepLaws, x: &mut [f64]) -> bool {
        self.moving.clear();
        self.moving.extend((0..self.dof).filter(|&joint| laws.modes[joint].motion != Motion::Rests));
        for (row, &joint) in self.moving.iter().enumerate() {
            let (law, mode) = (&laws.joints[joint], laws.modes[joint]);
            let (torque, slope) = mode.piece(law);
            for (column, &other) in self.moving[..=row].iter().enumerate() {
                self.factor[row * self.dof + column] = a[joint * self.dof + other];
            }
            self.factor[row * self.dof + row] += slope;
            self.solution[row] = w[joint] + torque - mode.motion.sign() * law.friction;
        }
        for contact in laws.contacts.iter().filter(|contact| contact.touches) {
            for (row, &joint) in self.moving.iter().enumerate() {
                let by_joint = contact.by_joint[joint];
                self.solution[row] += by_joint * contact.push;
                for (column, &other) in self.moving[..=row].iter().enumerate() {
                    self.factor[row * self.dof + column] += contact.slope * by_joint * contact.by_joint[other];
                }
            }
        }
        if !self.factorise() {
            return false;
        }
        self.solve_rows(1);
        x.fill(0.0);
        for (row, &joint) in self.moving.iter().enumerate() {
            x[joint] = self.solution[row];
        }
        true
    }

    fn factorise(&mut self) -> bool {
        let (dof, factor) = (self.dof, &mut self.factor);
        for row in 0..self.moving.len() {
            for column in 0..=row {
                let mut sum = factor[row * dof + column];
                for k in 0..column {
                    sum -= factor[row * dof + k] * factor[column * dof + k];
                }
                if row == column {
                    if sum.is_nan() || sum <= 0.0 {
                        return false;
                    }
                    factor[row * dof + row] = sum.sqrt();
                } else {
                    factor[row * dof + column] = sum / factor[column * dof + column];
                }
            }
        }
        true
    }

    fn solve_rows(&mut self, width: usize) {
        let mut solution = std::mem::take(&mut self.solution);
        self.apply_inverse(&mut solution, width);
        self.solution = solution;
    }

    /// Solves for several right sides at once. `rows` contains one row of `width` values for each moving joint.
    #[inline(always)]
    pub(crate) fn apply_inverse(&self, rows: &mut [f64], width: usize) {
        let dof = self.dof;
        let count = self.moving.len();
        for row in 0..count {
            let (above, rest) = rows.split_at_mut(row * width);
            let own = &mut rest[..width];
            for k in 0..row {
                subtract(own, &above[k * width..(k + 1) * width], self.factor[row * dof + k]);
            }
            scale(own, 1.0 / self.factor[row * dof + row]);
        }
        for row in (0..count).rev() {
            let (head, below) = rows.split_at_mut((row + 1) * width);
            let own = &mut head[row * width..];
            for k in row + 1..count {
                subtract(own, &below[(k - row - 1) * width..(k - row) * width], self.factor[k * dof + row]);
            }
            scale(own, 1.0 / self.factor[row * dof + row]);
        }
    }
}

/// Computes `own -= factor · other`.
#[inline(always)]
pub(crate) fn subtract(own: &mut [f64], other: &[f64], factor: f64) {
    for (own, other) in own.iter_mut().zip(other) {
        *own -= factor * other;
    }
}

#[inline(always)]
fn scale(own: &mut [f64], factor: f64) {
    for own in own {
        *own *= factor;
    }
}
