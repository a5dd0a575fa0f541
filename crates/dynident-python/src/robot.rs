//! `Robot`: a description, and its dynamics over arrays.

use crate::arrays::{Samples, array};
use crate::errors;
use dynident::dynamics::{
    BaseParameterSettings, BaseParameters, BatchWorkspace, PanelLayout, Panels, Workspace, all_columns,
    forward_dynamics, inverse_dynamics_batch, inverse_dynamics_derivatives, mass_matrix, regressor_panels,
};
use dynident::model::terms::JointMotion;
use dynident::model::{Model, load_robot, read_dh, read_mjcf, read_sdf, read_urdf};
use numpy::PyArrayDyn;
use pyo3::prelude::*;
use rayon::prelude::*;
use std::path::PathBuf;
use std::sync::Mutex;

/// Samples of one block of a batch: enough for full lanes, little enough for the cache.
const BLOCK: usize = 128;
/// Numbers of a result from which on more than one thread is worth waking.
const WORTH_THREADS: usize = 50_000;

type Array<'py> = Bound<'py, PyArrayDyn<f64>>;
type Matrices<'py> = (Array<'py>, Array<'py>, Array<'py>);

/// A robot on a fixed base: links, joints, gravity.
///
/// Made by ``Robot.load(path)``, or ``from_urdf``, ``from_mjcf``, ``from_sdf``, ``from_dh`` of a text. Vectors over
/// joints follow ``joint_names``; SI units, rad. All methods take one posture, shape ``(n,)``, or any number of them,
/// shape ``(..., n)``, and give the axes before the last back.
#[pyclass(frozen, module = "dynident")]
pub(crate) struct Robot {
    model: Model,
    path: Option<PathBuf>,
    /// Scratch memory of threads that have called.
    singles: Mutex<Vec<Workspace>>,
    batches: Mutex<Vec<BatchWorkspace>>,
}

impl Robot {
    fn of(model: Model, path: Option<PathBuf>) -> Self {
        Self { model, path, singles: Mutex::default(), batches: Mutex::default() }
    }

    /// Lends scratch memory to `work`. A panic of another call leaves a poisoned lock, and memory like new.
    fn with_single<R>(&self, work: impl FnOnce(&mut Workspace) -> R) -> R {
        let lent = self.singles.lock().ok().and_then(|mut all| all.pop());
        let mut workspace = lent.unwrap_or_else(|| Workspace::new(&self.model));
        let result = work(&mut workspace);
        if let Ok(mut all) = self.singles.lock() {
            all.push(workspace);
        }
        result
    }

    fn with_batch<R>(&self, work: impl FnOnce(&mut BatchWorkspace) -> R) -> R {
        let lent = self.batches.lock().ok().and_then(|mut all| all.pop());
        let mut workspace = lent.unwrap_or_else(|| BatchWorkspace::new(&self.model));
        let result = work(&mut workspace);
        if let Ok(mut all) = self.batches.lock() {
            all.push(workspace);
        }
        result
    }

    /// `each(row, numbers)` for every sample, where `numbers` are the `size` ones of its result.
    fn for_each(&self, count: usize, size: usize, each: impl Fn(&mut Workspace, usize, &mut [f64]) + Sync) -> Vec<f64> {
        let mut out = vec![0.0; count * size];
        let block = |(number, block): (usize, &mut [f64])| {
            self.with_single(|workspace| {
                for (row, numbers) in block.chunks_exact_mut(size).enumerate() {
                    each(workspace, number * BLOCK + row, numbers);
                }
            });
        };
        in_blocks(&mut out, size, block);
        out
    }

    /// `each(block, first row, numbers)` for blocks of samples, whose motion stands joint by joint.
    fn for_blocks(
        &self,
        [q, dq, ddq]: [&[f64]; 3],
        size: usize,
        each: impl Fn(&mut BatchWorkspace, &JointMotion<'_>, &mut [f64]) + Sync,
    ) -> Vec<f64> {
        let dof = self.model.dof();
        let mut out = vec![0.0; q.len() / dof.max(1) * size];
        let block = |(number, block): (usize, &mut [f64])| {
            let samples = block.len() / size.max(1);
            let first = number * BLOCK * dof;
            let of = |rows: &[f64]| joint_major(&rows[first..first + samples * dof], samples, dof);
            let (q, dq, ddq) = (of(q), of(dq), of(ddq));
            let motion = JointMotion { samples, q: &q, dq: &dq, ddq: &ddq };
            self.with_batch(|workspace| each(workspace, &motion, block));
        };
        in_blocks(&mut out, size, block);
        out
    }
}

/// Hands out blocks of samples, to several threads where that is worth it.
fn in_blocks(out: &mut [f64], size: usize, each: impl Fn((usize, &mut [f64])) + Sync) {
    let chunk = (BLOCK * size).max(1);
    if out.len() < WORTH_THREADS {
        out.chunks_mut(chunk).enumerate().for_each(each);
    } else {
        out.par_chunks_mut(chunk).enumerate().for_each(&each);
    }
}

/// Rows of samples as rows of joints.
fn joint_major(rows: &[f64], samples: usize, joints: usize) -> Vec<f64> {
    let mut out = vec![0.0; rows.len()];
    for (sample, row) in rows.chunks_exact(joints.max(1)).enumerate() {
        for (joint, value) in row.iter().enumerate() {
            out[joint * samples + sample] = *value;
        }
    }
    out
}

/// A motion of `(..., n)` arrays, of which velocity and acceleration may be left out: at rest.
struct Motion<'py> {
    q: Samples<'py>,
    dq: Option<Samples<'py>>,
    ddq: Option<Samples<'py>>,
}

impl<'py> Motion<'py> {
    fn of(
        dof: usize,
        q: &Bound<'py, PyAny>,
        dq: Option<&Bound<'py, PyAny>>,
        ddq: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Self> {
        let q = Samples::of(q, "q", dof)?;
        let other = |array: Option<&Bound<'py, PyAny>>, name: &str| {
            array.map(|array| Samples::of(array, name, dof)?.like(&q, name)).transpose()
        };
        let (dq, ddq) = (other(dq, "dq")?, other(ddq, "ddq")?);
        Ok(Self { q, dq, ddq })
    }

    /// Runs `work` on the numbers, without the interpreter's lock.
    fn compute<R: Send>(&self, py: Python<'py>, work: impl FnOnce([&[f64]; 3]) -> R + Send) -> R {
        let q = self.q.numbers();
        let rest = vec![0.0; if self.dq.is_none() || self.ddq.is_none() { q.len() } else { 0 }];
        let dq = self.dq.as_ref().map(Samples::numbers);
        let ddq = self.ddq.as_ref().map(Samples::numbers);
        let (q, dq, ddq) = (&*q, dq.as_deref().unwrap_or(&rest), ddq.as_deref().unwrap_or(&rest));
        py.detach(move || work([q, dq, ddq]))
    }
}

#[pymethods]
impl Robot {
    /// Reads a description: URDF, MJCF, SDF or a D-H table in TOML, told by its content.
    #[staticmethod]
    fn load(path: PathBuf) -> PyResult<Self> {
        let robot = load_robot(&path).map_err(errors::robot)?;
        Ok(Self::of(robot.model, Some(path)))
    }

    /// A robot of the text of a URDF.
    #[staticmethod]
    fn from_urdf(text: &str) -> PyResult<Self> {
        Ok(Self::of(read_urdf(text).map_err(errors::robot)?.model, None))
    }

    /// A robot of the text of MuJoCo's MJCF.
    #[staticmethod]
    fn from_mjcf(text: &str) -> PyResult<Self> {
        Ok(Self::of(read_mjcf(text).map_err(errors::robot)?.model, None))
    }

    /// A robot of the text of Gazebo's SDF.
    #[staticmethod]
    fn from_sdf(text: &str) -> PyResult<Self> {
        Ok(Self::of(read_sdf(text).map_err(errors::robot)?.model, None))
    }

    /// A robot of a Denavit-Hartenberg table in TOML.
    #[staticmethod]
    fn from_dh(text: &str) -> PyResult<Self> {
        Ok(Self::of(read_dh(text).map_err(errors::robot)?, None))
    }

    /// The robot's name.
    #[getter]
    fn name(&self) -> &str {
        self.model.name()
    }

    /// The file it was read from, if any.
    #[getter]
    fn path(&self) -> Option<PathBuf> {
        self.path.clone()
    }

    /// Names of the degrees of freedom, base to tip: the order of all vectors.
    #[getter]
    fn joint_names(&self) -> Vec<String> {
        self.model.joints().iter().map(|joint| joint.name.clone()).collect()
    }

    /// Names of the moving bodies: the order of the regressor's blocks of ten columns.
    #[getter]
    fn body_names(&self) -> Vec<String> {
        self.model.bodies().iter().map(|body| body.name().to_owned()).collect()
    }

    /// Degrees of freedom.
    #[getter]
    fn n(&self) -> usize {
        self.model.dof()
    }

    /// Ten inertial parameters of each body in its frame, shape ``(bodies, 10)``: ``m, mx, my, mz, Ixx, Ixy, Ixz, Iyy,
    /// Iyz, Izz`` about the frame's origin, kg, kg m, kg m². Zeros where the description has none.
    #[getter]
    fn inertial_parameters<'py>(&self, py: Python<'py>) -> PyResult<Array<'py>> {
        array(py, &[self.model.body_count()], &[10], self.model.parameter_vector())
    }

    /// The same robot with the named joints held, ``{name: position}`` in rad or m.
    fn locked(&self, positions: std::collections::BTreeMap<String, f64>) -> PyResult<Self> {
        let held: Vec<(String, f64)> = positions.into_iter().collect();
        Ok(Self::of(self.model.locked(&held).map_err(errors::robot)?, self.path.clone()))
    }

    /// Joint torques of a motion, Nm (N): ``M(q) ddq + C(q, dq) dq + g(q)`` of the rigid bodies. Shapes ``(..., n)``;
    /// without ``dq`` or ``ddq`` these are zero.
    #[pyo3(signature = (q, dq=None, ddq=None))]
    fn inverse_dynamics<'py>(
        &self,
        py: Python<'py>,
        q: &Bound<'py, PyAny>,
        dq: Option<&Bound<'py, PyAny>>,
        ddq: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Array<'py>> {
        let dof = self.model.dof();
        let motion = Motion::of(dof, q, dq, ddq)?;
        let tau = motion.compute(py, |motion| {
            self.for_blocks(motion, dof, |workspace, motion, out| {
                let mut tau = vec![0.0; out.len()];
                inverse_dynamics_batch(&self.model, workspace, motion, &mut tau);
                for (sample, row) in out.chunks_exact_mut(dof.max(1)).enumerate() {
                    for (joint, to) in row.iter_mut().enumerate() {
                        *to = tau[joint * motion.samples + sample];
                    }
                }
            })
        });
        array(py, motion.q.lead(), &[dof], tau)
    }

    /// Torques that hold the robot at rest, Nm (N), shape ``(..., n)``.
    fn gravity<'py>(&self, py: Python<'py>, q: &Bound<'py, PyAny>) -> PyResult<Array<'py>> {
        self.inverse_dynamics(py, q, None, None)
    }

    /// Accelerations under torques, rad/s² (m/s²), shape ``(..., n)``.
    fn forward_dynamics<'py>(
        &self,
        py: Python<'py>,
        q: &Bound<'py, PyAny>,
        dq: &Bound<'py, PyAny>,
        tau: &Bound<'py, PyAny>,
    ) -> PyResult<Array<'py>> {
        let dof = self.model.dof();
        // The torque takes the place of the acceleration.
        let motion = Motion::of(dof, q, Some(dq), Some(tau))?;
        let count = motion.q.count();
        let ddq = motion.compute(py, |[q, dq, tau]| {
            self.for_each(count, dof, |workspace, row, out| {
                let of = row * dof..(row + 1) * dof;
                let (q, dq, tau) = (&q[of.clone()], &dq[of.clone()], &tau[of]);
                out.copy_from_slice(forward_dynamics(&self.model, workspace, q, dq, tau));
            })
        });
        array(py, motion.q.lead(), &[dof], ddq)
    }

    /// Mass matrices ``M(q)``, kg m² (kg m, kg), shape ``(..., n, n)``.
    fn mass_matrix<'py>(&self, py: Python<'py>, q: &Bound<'py, PyAny>) -> PyResult<Array<'py>> {
        let dof = self.model.dof();
        let motion = Motion::of(dof, q, None, None)?;
        let count = motion.q.count();
        let matrices = motion.compute(py, |[q, ..]| {
            self.for_each(count, dof * dof, |workspace, row, out| {
                out.copy_from_slice(mass_matrix(&self.model, workspace, &q[row * dof..(row + 1) * dof]));
            })
        });
        array(py, motion.q.lead(), &[dof, dof], matrices)
    }

    /// Derivatives of the torques by position, velocity and acceleration: three arrays of shape ``(..., n, n)``, row =
    /// torque, column = what it is derived by.
    #[pyo3(signature = (q, dq=None, ddq=None))]
    fn derivatives<'py>(
        &self,
        py: Python<'py>,
        q: &Bound<'py, PyAny>,
        dq: Option<&Bound<'py, PyAny>>,
        ddq: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Matrices<'py>> {
        let dof = self.model.dof();
        let motion = Motion::of(dof, q, dq, ddq)?;
        let (count, size) = (motion.q.count(), dof * dof);
        let all = motion.compute(py, |[q, dq, ddq]| {
            self.for_each(count, 3 * size, |workspace, row, out| {
                let of = row * dof..(row + 1) * dof;
                let found =
                    inverse_dynamics_derivatives(&self.model, workspace, &q[of.clone()], &dq[of.clone()], &ddq[of]);
                out[..size].copy_from_slice(found.by_position);
                out[size..2 * size].copy_from_slice(found.by_velocity);
                out[2 * size..].copy_from_slice(found.by_acceleration);
            })
        });
        let part = |which: usize| {
            let rows = all.chunks_exact((3 * size).max(1));
            let numbers = rows.flat_map(|row| &row[which * size..(which + 1) * size]).copied().collect();
            array(py, motion.q.lead(), &[dof, dof], numbers)
        };
        Ok((part(0)?, part(1)?, part(2)?))
    }

    /// The regressor ``Y(q, dq, ddq)`` with ``Y @ inertial_parameters.ravel() == tau``, shape ``(..., n, 10 bodies)``.
    #[pyo3(signature = (q, dq=None, ddq=None))]
    fn regressor<'py>(
        &self,
        py: Python<'py>,
        q: &Bound<'py, PyAny>,
        dq: Option<&Bound<'py, PyAny>>,
        ddq: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Array<'py>> {
        let (dof, columns) = (self.model.dof(), self.model.inertial_count());
        let motion = Motion::of(dof, q, dq, ddq)?;
        let layout = PanelLayout::new(&self.model, all_columns(&self.model, &[]));
        let numbers = motion.compute(py, |motion| {
            self.for_blocks(motion, dof * columns, |workspace, motion, out| {
                let mut panels = Panels::default();
                regressor_panels(&self.model, workspace, &layout, motion, &mut panels);
                for joint in 0..dof {
                    for (place, &column) in layout.joint_columns(joint).iter().enumerate() {
                        let entries = &panels.joint(joint)[place * motion.samples..(place + 1) * motion.samples];
                        for (sample, entry) in entries.iter().enumerate() {
                            out[(sample * dof + joint) * columns + column] = *entry;
                        }
                    }
                }
            })
        });
        array(py, motion.q.lead(), &[dof, columns], numbers)
    }

    /// The base parameters of the bodies: what torque can tell, as sums of inertial parameters.
    #[getter]
    fn base_parameters(&self) -> Vec<String> {
        BaseParameters::new(&self.model, &[], &BaseParameterSettings::default()).expressions()
    }

    fn __repr__(&self) -> String {
        let joints = self.model.dof();
        format!("Robot({:?}, {joints} joints, {} bodies)", self.model.name(), self.model.body_count())
    }
}
