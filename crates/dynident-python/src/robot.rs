//! `Robot`: a robot description, and its dynamics over arrays.

use crate::arrays::{Motion, array, joint_major};
use crate::assembled::{assembled, json_of};
use crate::callables::Callables;
use crate::description::{described, is_xml, of_format, of_text, study_of, xacro_settings};
use crate::errors;
use crate::kinematics::{self, POSE_VALUES};
use dynident::dynamics::{
    BaseParameterSettings, BaseParameters, BatchWorkspace, PanelLayout, Panels, Workspace, all_columns,
    forward_dynamics, inverse_dynamics_batch, inverse_dynamics_derivatives, mass_matrix, regressor_panels,
};
use dynident::model::terms::JointMotion;
use dynident::model::{DescriptionFormat, JointLimits, Model, Robot as Description, read_robot};
use dynident::{Folders, StudyRobot};
use numpy::PyArrayDyn;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, OnceLock};

/// Samples per block of a batch: enough for full SIMD lanes, few enough for the cache.
const BLOCK_SAMPLES: usize = 128;

/// Regressor rows that are written together, so that their pages fit into the first level of the TLB.
const ROWS_AT_ONCE: usize = 16;

type Array<'py> = Bound<'py, PyArrayDyn<f64>>;
type Matrices<'py> = (Array<'py>, Array<'py>, Array<'py>);

/// A robot on a fixed base: links, joints, gravity.
///
/// Created by ``Robot.load(path)``, or by ``from_urdf``, ``from_mjcf``, ``from_sdf``, ``from_dh`` from a path or a
/// text. Keyword arguments are the keys of ``[robot]`` of a study: moving joints, mimic joints, direction of gravity.
///
/// Vectors over joints follow ``joint_names``; SI units, rad. All methods take one posture, shape ``(n,)``, or any
/// number of them, shape ``(..., n)``, and return the same leading axes.
///
/// >>> import dynident, numpy as np
/// >>> arm = dynident.Robot.load("robots/ur10.urdf")
/// >>> arm.dof, arm.joint_names[0], arm.limits["upper"].shape
/// (6, 'shoulder_pan_joint', (6,))
/// >>> q = np.zeros((100, 6))
/// >>> arm.inverse_dynamics(q, q, q).shape, arm.mass_matrix(q[0]).shape
/// ((100, 6), (6, 6))
/// >>> arm.forward_kinematics(q, "wrist_3_link").shape, arm.jacobian(q[0]).shape
/// ((100, 4, 4), (6, 6))
#[pyclass(frozen, module = "dynident")]
pub(crate) struct Robot {
    description: Description,
    /// Keys of ``[robot]`` in addition to the file, as JSON.
    settings: String,
    model: Model,
    /// Base parameters of the bodies, computed when first needed.
    base: OnceLock<BaseParameters>,
    /// Scratch memory of the calling threads.
    singles: Mutex<Vec<Workspace>>,
    batches: Mutex<Vec<BatchWorkspace>>,
    panels: Mutex<Vec<Panels>>,
    /// Layouts of the regressor with all columns, and with those of the base parameters.
    layouts: [OnceLock<PanelLayout>; 2],
}

impl Robot {
    fn base(&self) -> &BaseParameters {
        self.base.get_or_init(|| BaseParameters::new(&self.model, &[], &BaseParameterSettings::default()))
    }

    /// A robot description of one format with the keys of ``[robot]``: `source` is its text, or the path of its file.
    fn new(
        py: Python<'_>,
        source: &Path,
        wanted: DescriptionFormat,
        name: &str,
        is_text: impl FnOnce(&str) -> bool,
        settings: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<Self> {
        let settings = settings.map_or_else(|| Ok("{}".to_owned()), |settings| json_of(py, settings))?;
        let text = source.to_string_lossy();
        let description = if is_text(&text) {
            of_text(py, &text, wanted, name)?
        } else {
            of_format(described(py, source, xacro_settings(source, &settings)?, false)?, wanted)?
        };
        Self::with_settings(py, description, settings)
    }

    fn with_settings(py: Python<'_>, description: Description, settings: String) -> PyResult<Self> {
        let path = description.path.clone();
        let study = assembled(
            py,
            &study_of(&path, &settings)?,
            &path,
            Some(description.clone()),
            Vec::new(),
            &Callables::default(),
        )?;
        let folders = Folders::new(&study, &path, None);
        let made = StudyRobot::new(&study, &path, &folders).map_err(|error| errors::job(py, &error.into()))?;
        let model = made.model().clone();
        let (base, layouts) = (OnceLock::new(), Default::default());
        let (singles, batches, panels) = (Mutex::default(), Mutex::default(), Mutex::default());
        Ok(Self { description, settings, model, base, singles, batches, panels, layouts })
    }

    pub(crate) fn description(&self) -> &Description {
        &self.description
    }

    /// Lends scratch memory to `work`, without waiting for a lock: a process that was forked while another thread held
    /// the lock would wait forever.
    fn with_single<R>(&self, work: impl FnOnce(&mut Workspace) -> R) -> R {
        lend(&self.singles, || Workspace::new(&self.model), work)
    }

    fn with_batch<R>(&self, work: impl FnOnce(&mut BatchWorkspace) -> R) -> R {
        lend(&self.batches, || BatchWorkspace::new(&self.model), work)
    }

    /// Calls `each(row, values)` for every sample, where `values` are the `size` values of its result in `out`.
    fn for_each(&self, out: &mut [f64], size: usize, each: impl Fn(&mut Workspace, usize, &mut [f64]) + Sync) {
        in_blocks(out, size, |(number, block): (usize, &mut [f64])| {
            self.with_single(|workspace| {
                for (row, numbers) in block.chunks_exact_mut(size.max(1)).enumerate() {
                    each(workspace, number * BLOCK_SAMPLES + row, numbers);
                }
            });
        });
    }

    /// Calls `each(motion, values)` for blocks of samples with joint-major motion.
    fn for_blocks(
        &self,
        motion: [&[f64]; 3],
        out: &mut [f64],
        size: usize,
        each: impl Fn(&mut BatchWorkspace, &JointMotion<'_>, &mut [f64]) + Sync,
    ) {
        let [q, dq, ddq] = motion;
        let dof = self.model.dof();
        in_blocks(out, size, |(number, block): (usize, &mut [f64])| {
            let samples = block.len() / size.max(1);
            let first = number * BLOCK_SAMPLES * dof;
            let of = |rows: &[f64]| joint_major(&rows[first..first + samples * dof], samples, dof);
            let (q, dq, ddq) = (of(q), of(dq), of(ddq));
            let motion = JointMotion { samples, q: &q, dq: &dq, ddq: &ddq };
            self.with_batch(|workspace| each(workspace, &motion, block));
        });
    }
}

fn lend<W, R>(kept: &Mutex<Vec<W>>, make: impl FnOnce() -> W, work: impl FnOnce(&mut W) -> R) -> R {
    let lent = kept.try_lock().ok().and_then(|mut all| all.pop());
    let mut workspace = lent.unwrap_or_else(make);
    let result = work(&mut workspace);
    if let Ok(mut all) = kept.try_lock() {
        all.push(workspace);
    }
    result
}

/// Processes blocks of samples, with all threads of the current pool, if any.
fn in_blocks(out: &mut [f64], size: usize, each: impl Fn((usize, &mut [f64])) + Sync) {
    let chunk = (BLOCK_SAMPLES * size).max(1);
    if rayon::current_thread_index().is_none() {
        out.chunks_mut(chunk).enumerate().for_each(each);
    } else {
        out.par_chunks_mut(chunk).enumerate().for_each(&each);
    }
}

#[pymethods]
impl Robot {
    /// Reads a robot description: URDF, MJCF, SDF or a D-H table in TOML, recognised by its content. The program
    /// ``xacro`` expands a file with macros only with ``allow_command=True``, because it runs Python code of the file.
    /// Its arguments are given as ``xacro={"ur_type": "ur5e"}``.
    #[staticmethod]
    #[pyo3(signature = (path, *, allow_command=false, **settings))]
    fn load(
        py: Python<'_>,
        path: PathBuf,
        allow_command: bool,
        settings: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<Self> {
        let settings = settings.map_or_else(|| Ok("{}".to_owned()), |settings| json_of(py, settings))?;
        let description = described(py, &path, xacro_settings(&path, &settings)?, allow_command)?;
        Self::with_settings(py, description, settings)
    }

    /// Creates a robot from a URDF: a path, or the text.
    #[staticmethod]
    #[pyo3(signature = (source, **settings))]
    fn from_urdf(py: Python<'_>, source: PathBuf, settings: Option<&Bound<'_, PyDict>>) -> PyResult<Self> {
        Self::new(py, &source, DescriptionFormat::Urdf, "robot.urdf", is_xml, settings)
    }

    /// Creates a robot from an MJCF (MuJoCo): a path, or the text.
    #[staticmethod]
    #[pyo3(signature = (source, **settings))]
    fn from_mjcf(py: Python<'_>, source: PathBuf, settings: Option<&Bound<'_, PyDict>>) -> PyResult<Self> {
        Self::new(py, &source, DescriptionFormat::Mjcf, "robot.xml", is_xml, settings)
    }

    /// Creates a robot from an SDF (Gazebo): a path, or the text.
    #[staticmethod]
    #[pyo3(signature = (source, **settings))]
    fn from_sdf(py: Python<'_>, source: PathBuf, settings: Option<&Bound<'_, PyDict>>) -> PyResult<Self> {
        Self::new(py, &source, DescriptionFormat::Sdf, "robot.sdf", is_xml, settings)
    }

    /// Creates a robot from a Denavit-Hartenberg table in TOML: a path, or the text (more than one line).
    #[staticmethod]
    #[pyo3(signature = (source, **settings))]
    fn from_dh(py: Python<'_>, source: PathBuf, settings: Option<&Bound<'_, PyDict>>) -> PyResult<Self> {
        let is_text = |source: &str| source.contains('\n');
        Self::new(py, &source, DescriptionFormat::Dh, "robot.toml", is_text, settings)
    }

    /// The inverse of ``__reduce__``.
    #[staticmethod]
    fn _restore(py: Python<'_>, text: String, path: PathBuf, settings: String) -> PyResult<Self> {
        Self::with_settings(py, read_robot(text, &path).map_err(|error| errors::robot(py, &error))?, settings)
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<(Bound<'py, PyAny>, (String, PathBuf, String))> {
        let own = slf.get();
        let state = (own.description.text.clone(), own.description.path.clone(), own.settings.clone());
        Ok((slf.get_type().getattr("_restore")?, state))
    }

    /// The keys of ``[robot]`` in addition to the file, as JSON.
    #[getter]
    fn _settings(&self) -> &str {
        &self.settings
    }

    /// The robot's name.
    #[getter]
    fn name(&self) -> &str {
        self.model.name()
    }

    /// The file that it was read from; for a text only a name.
    #[getter]
    fn path(&self) -> &Path {
        &self.description.path
    }

    /// The text of the robot description.
    #[getter]
    fn text(&self) -> &str {
        &self.description.text
    }

    /// Names of the degrees of freedom, from base to tip: the order of all vectors.
    #[getter]
    fn joint_names(&self) -> Vec<String> {
        self.model.joints().iter().map(|joint| joint.name.clone()).collect()
    }

    /// Names of the moving bodies: the order of the regressor's blocks of ten columns.
    #[getter]
    fn body_names(&self) -> Vec<String> {
        self.model.bodies().iter().map(|body| body.name().to_owned()).collect()
    }

    /// Degrees of freedom; the same as ``dof``.
    #[getter]
    fn n(&self) -> usize {
        self.model.dof()
    }

    /// Degrees of freedom.
    #[getter]
    fn dof(&self) -> usize {
        self.model.dof()
    }

    /// Names of all links, those of the base first. Several links may belong to one body.
    #[getter]
    fn link_names(&self) -> Vec<String> {
        kinematics::link_names(&self.model)
    }

    /// Limits of the joints in the robot description, each of shape ``(n,)``: ``lower`` and ``upper``, rad (m),
    /// ``velocity``, rad/s (m/s), and ``effort``, Nm (N). Infinite if the description states none.
    #[getter]
    fn limits<'py>(&self, py: Python<'py>) -> PyResult<BTreeMap<&'static str, Array<'py>>> {
        let of = |value: fn(&JointLimits) -> Option<f64>, none: f64| {
            let values = self.model.joints().iter().map(|joint| value(&joint.limits).unwrap_or(none)).collect();
            array(py, &[self.model.dof()], &[], values)
        };
        Ok(BTreeMap::from([
            ("lower", of(|limits| limits.lower, f64::NEG_INFINITY)?),
            ("upper", of(|limits| limits.upper, f64::INFINITY)?),
            ("velocity", of(|limits| limits.velocity, f64::INFINITY)?),
            ("effort", of(|limits| limits.effort, f64::INFINITY)?),
        ]))
    }

    /// Pose of a link in the base frame as homogeneous matrices, shape ``(..., 4, 4)``, for positions ``(..., n)``. By
    /// default the last link of ``link_names``.
    #[pyo3(signature = (q, link=None))]
    fn forward_kinematics<'py>(
        &self,
        py: Python<'py>,
        q: &Bound<'py, PyAny>,
        link: Option<&str>,
    ) -> PyResult<Array<'py>> {
        let (dof, link) = (self.model.dof(), kinematics::link(&self.model, link)?);
        Motion::of(dof, q, None, None)?.fill(py, &[4, 4], |[q, ..], out| {
            self.for_each(out, POSE_VALUES, |workspace, row, out| {
                kinematics::pose(&self.model, workspace, &link, &q[row * dof..(row + 1) * dof], out);
            });
        })
    }

    /// Jacobian of a point of a link in the base frame, shape ``(..., 6, n)``: rows 0 to 2 give the linear velocity of
    /// the point, rows 3 to 5 the angular velocity of the link, for ``dq``. ``point`` is in the frame of the link, m;
    /// by default its origin. By default the last link of ``link_names``.
    #[pyo3(signature = (q, link=None, point=[0.0; 3]))]
    fn jacobian<'py>(
        &self,
        py: Python<'py>,
        q: &Bound<'py, PyAny>,
        link: Option<&str>,
        point: [f64; 3],
    ) -> PyResult<Array<'py>> {
        let (dof, link) = (self.model.dof(), kinematics::link(&self.model, link)?);
        Motion::of(dof, q, None, None)?.fill(py, &[6, dof], |[q, ..], out| {
            self.for_each(out, 6 * dof, |workspace, row, out| {
                kinematics::jacobian(&self.model, workspace, &link, point, &q[row * dof..(row + 1) * dof], out);
            });
        })
    }

    /// Ten inertial parameters of each body in its frame, shape ``(bodies, 10)``: ``m, mx, my, mz, Ixx, Ixy, Ixz, Iyy,
    /// Iyz, Izz`` about the frame's origin, kg, kg m, kg m². Zeros if the robot description has none.
    #[getter]
    fn inertial_parameters<'py>(&self, py: Python<'py>) -> PyResult<Array<'py>> {
        array(py, &[self.model.body_count()], &[10], self.model.parameter_vector())
    }

    /// The same robot with the named joints locked, ``{name: position}`` in rad or m.
    fn locked(&self, py: Python<'_>, positions: BTreeMap<String, f64>) -> PyResult<Self> {
        let wrong = |error: serde_json::Error| errors::RobotError::new_err(error.to_string());
        let mut settings: serde_json::Map<String, serde_json::Value> =
            serde_json::from_str(&self.settings).map_err(wrong)?;
        let held = settings.entry("lock").or_insert_with(|| serde_json::json!({}));
        if let Some(held) = held.as_object_mut() {
            held.extend(positions.into_iter().map(|(name, at)| (name, at.into())));
        }
        let settings = serde_json::to_string(&settings).map_err(wrong)?;
        Self::with_settings(py, self.description.clone(), settings)
    }

    /// Joint torques of a motion, Nm (N): ``M(q) ddq + C(q, dq) dq + g(q)`` of the rigid bodies. Shapes ``(..., n)``;
    /// ``dq`` and ``ddq`` are zero by default.
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
        motion.fill(py, &[dof], |numbers, out| {
            self.for_blocks(numbers, out, dof, |workspace, motion, out| {
                let mut tau = vec![0.0; out.len()];
                inverse_dynamics_batch(&self.model, workspace, motion, &mut tau);
                for (sample, row) in out.chunks_exact_mut(dof.max(1)).enumerate() {
                    for (joint, to) in row.iter_mut().enumerate() {
                        *to = tau[joint * motion.samples + sample];
                    }
                }
            });
        })
    }

    /// Gravity torques, Nm (N), shape ``(..., n)``.
    fn gravity<'py>(&self, py: Python<'py>, q: &Bound<'py, PyAny>) -> PyResult<Array<'py>> {
        self.inverse_dynamics(py, q, None, None)
    }

    /// Accelerations for given torques, rad/s² (m/s²), shape ``(..., n)``.
    fn forward_dynamics<'py>(
        &self,
        py: Python<'py>,
        q: &Bound<'py, PyAny>,
        dq: &Bound<'py, PyAny>,
        tau: &Bound<'py, PyAny>,
    ) -> PyResult<Array<'py>> {
        let dof = self.model.dof();
        // The torque is passed in the place of the acceleration.
        let motion = Motion::of(dof, q, Some(dq), Some(tau))?;
        motion.fill(py, &[dof], |[q, dq, tau], out| {
            self.for_each(out, dof, |workspace, row, out| {
                let of = row * dof..(row + 1) * dof;
                let (q, dq, tau) = (&q[of.clone()], &dq[of.clone()], &tau[of]);
                out.copy_from_slice(forward_dynamics(&self.model, workspace, q, dq, tau));
            });
        })
    }

    /// Mass matrices ``M(q)``, kg m² (kg m, kg), shape ``(..., n, n)``.
    fn mass_matrix<'py>(&self, py: Python<'py>, q: &Bound<'py, PyAny>) -> PyResult<Array<'py>> {
        let dof = self.model.dof();
        let motion = Motion::of(dof, q, None, None)?;
        motion.fill(py, &[dof, dof], |[q, ..], out| {
            self.for_each(out, dof * dof, |workspace, row, out| {
                out.copy_from_slice(mass_matrix(&self.model, workspace, &q[row * dof..(row + 1) * dof]));
            });
        })
    }

    /// Derivatives of the torques with respect to position, velocity and acceleration: three arrays of shape ``(..., n,
    /// n)``, row = torque, column = variable.
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
        let (count, size) = (motion.count(), dof * dof);
        let all = motion.compute(py, 3 * count * size, |[q, dq, ddq]| {
            let mut all = vec![0.0; 3 * count * size];
            self.for_each(&mut all, 3 * size, |workspace, row, out| {
                let of = row * dof..(row + 1) * dof;
                let found =
                    inverse_dynamics_derivatives(&self.model, workspace, &q[of.clone()], &dq[of.clone()], &ddq[of]);
                out[..size].copy_from_slice(found.by_position);
                out[size..2 * size].copy_from_slice(found.by_velocity);
                out[2 * size..].copy_from_slice(found.by_acceleration);
            });
            all
        });
        let part = |which: usize| {
            let rows = all.chunks_exact((3 * size).max(1));
            let numbers = rows.flat_map(|row| &row[which * size..(which + 1) * size]).copied().collect();
            array(py, motion.lead(), &[dof, dof], numbers)
        };
        Ok((part(0)?, part(1)?, part(2)?))
    }

    /// The regressor ``Y(q, dq, ddq)`` with ``Y @ inertial_parameters.ravel() == tau``, shape ``(..., n, 10 bodies)``.
    /// With ``base`` only the columns of the base parameters, shape ``(..., n, base parameters)``, for which ``Y @
    /// (base_projection @ inertial_parameters.ravel()) == tau``. ``out`` is an array of this shape for the result, for
    /// example from an earlier call; this saves the allocation, which takes longer than the computation.
    #[pyo3(signature = (q, dq=None, ddq=None, *, base=false, out=None))]
    fn regressor<'py>(
        &self,
        py: Python<'py>,
        q: &Bound<'py, PyAny>,
        dq: Option<&Bound<'py, PyAny>>,
        ddq: Option<&Bound<'py, PyAny>>,
        base: bool,
        out: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Array<'py>> {
        let dof = self.model.dof();
        let layout = self.layouts[usize::from(base)].get_or_init(|| {
            let columns = if base { self.base().base_columns() } else { all_columns(&self.model, &[]) };
            PanelLayout::new(&self.model, columns)
        });
        let columns = layout.columns().len();
        let size = (dof * columns).max(1);
        let motion = Motion::of(dof, q, dq, ddq)?;
        // New memory is zero, and the other columns contain only zeros.
        let is_zero = out.is_none();
        let array = match out {
            Some(out) => motion.given(out, &[dof, columns])?,
            None => PyArrayDyn::<f64>::zeros(py, motion.shape(&[dof, columns]), false),
        };
        motion.fill_into(py, &array, |numbers, out| {
            self.for_blocks(numbers, out, dof * columns, |workspace, motion, out| {
                lend(&self.panels, Panels::default, |panels| {
                    regressor_panels(&self.model, workspace, layout, motion, panels);
                    if !is_zero {
                        out.fill(0.0);
                    }
                    for joint in 0..dof {
                        let panel = panels.joint(joint);
                        // A few rows at a time, otherwise every value is written to another page.
                        for (part, rows) in out.chunks_mut(ROWS_AT_ONCE * size).enumerate() {
                            let from = part * ROWS_AT_ONCE;
                            for (place, &column) in layout.joint_columns(joint).iter().enumerate() {
                                let entries = &panel[place * motion.samples + from..];
                                for (row, entry) in rows.chunks_exact_mut(size).zip(entries) {
                                    row[joint * columns + column] = *entry;
                                }
                            }
                        }
                    }
                });
            });
        })?;
        Ok(array)
    }

    /// The base parameters of the bodies: the combinations of inertial parameters that torque determines.
    #[getter]
    fn base_parameters(&self) -> Vec<String> {
        self.base().expressions()
    }

    /// The matrix of shape ``(base parameters, 10 bodies)``; ``base_projection @ inertial_parameters.ravel()`` are the
    /// values of ``base_parameters``.
    #[getter]
    fn base_projection<'py>(&self, py: Python<'py>) -> PyResult<Array<'py>> {
        let (base, columns) = (self.base(), self.model.inertial_count());
        let rows = base.count();
        let mut numbers = vec![0.0; rows * columns];
        for column in 0..columns {
            let mut one = vec![0.0; columns];
            one[column] = 1.0;
            for (row, value) in base.values(&one).into_iter().enumerate() {
                numbers[row * columns + column] = value;
            }
        }
        array(py, &[rows], &[columns], numbers)
    }

    /// Indices of the regressor's columns of the base parameters: ``regressor(...)[..., base_columns] @ values ==
    /// tau``.
    #[getter]
    fn base_columns(&self) -> Vec<usize> {
        self.base().independent().to_vec()
    }

    fn __repr__(&self) -> String {
        let joints = self.model.dof();
        format!("Robot({:?}, {joints} joints, {} bodies)", self.model.name(), self.model.body_count())
    }
}
