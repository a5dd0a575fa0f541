"""FIGAROH user code for the UR10: a configuration, a class, and the calls of the example."""
from pathlib import Path

import numpy as np
import pandas as pd
from figaroh.identification.base_identification import BaseIdentification
from figaroh.identification.identification_tools import calculate_first_second_order_differentiation
from figaroh.tools.regressor import build_regressor_basic, build_regressor_reduced
from figaroh.tools.robot import load_robot

# begin user
CONFIGURATION = """
robot:
  name: ur10
  properties:
    joints:
      active_joints: [shoulder_pan_joint, shoulder_lift_joint, elbow_joint, wrist_1_joint, wrist_2_joint, wrist_3_joint]
      joint_limits:
        velocity: [2.0943951, 2.0943951, 3.14159265, 3.14159265, 3.14159265, 3.14159265]
        torque: [330.0, 330.0, 150.0, 54.0, 54.0, 54.0]
    mechanics:
      friction_coefficients: {{viscous: [0, 0, 0, 0, 0, 0], static: [0, 0, 0, 0, 0, 0]}}
      actuator_inertias: [0, 0, 0, 0, 0, 0]
      joint_offsets: [0, 0, 0, 0, 0, 0]
tasks:
  identification:
    problem:
      include_external_forces: false
      use_joint_torques: true
      model_components: {{friction: {friction}, joint_offset: {offset}, actuator_inertia: false}}
    signal_processing: {{sampling_frequency: 100.0, cutoff_frequency: {cutoff_hz}, filter_type: butterworth, filter_order: 4}}
    select_stage: {stage}
    data:
      validation_data_file: "{test}"
"""


class UR10(BaseIdentification):
    def load_trajectory_data(self, data_source=None):
        table = pd.read_csv(data_source or self.train)
        q = table[[f"q{i}" for i in range(6)]].to_numpy()
        q, dq, ddq = calculate_first_second_order_differentiation(self.model, q, self.identif_config)
        rows = len(q)
        return {
            "timestamps": table["t"].to_numpy()[:rows].reshape(-1, 1),
            "positions": q,
            "velocities": dq,
            "accelerations": ddq,
            "torques": table[[f"tau{i}" for i in range(6)]].to_numpy()[:rows],
        }


def identify(urdf, configuration, train, kind=UR10, wls=False, decimate=False):
    found = kind(load_robot(str(urdf), package_dirs=str(Path(urdf).parent)), str(configuration))
    found.train = str(train)
    joints = [found.model.joints[found.model.getJointId(name)] for name in found.identif_config["active_joints"]]
    found.identif_config["act_idxq"] = [joint.idx_q for joint in joints]
    found.identif_config["act_idxv"] = [joint.idx_v for joint in joints]
    found.initialize()
    found.solve(decimate=decimate, plotting=False, wls=wls)
    return found


# end user


class GradientUR10(UR10):
    """Uses the derivatives of FIGAROH's pipeline: central differences of the filtered positions."""

    def load_trajectory_data(self, data_source=None):
        table = pd.read_csv(data_source or self.train)
        return {
            "timestamps": table["t"].to_numpy().reshape(-1, 1),
            "positions": table[[f"q{i}" for i in range(6)]].to_numpy(),
            "velocities": None,
            "accelerations": None,
            "torques": table[[f"tau{i}" for i in range(6)]].to_numpy(),
        }


class ExactUR10(UR10):
    """Uses recorded velocities and accelerations without a filter, as the reference case does."""

    def load_trajectory_data(self, data_source=None):
        table = pd.read_csv(data_source or self.train)
        columns = {"positions": "q", "velocities": "dq", "accelerations": "ddq", "torques": "tau"}
        found = {key: table[[f"{column}{i}" for i in range(6)]].to_numpy() for key, column in columns.items()}
        return {"timestamps": table["t"].to_numpy().reshape(-1, 1), **found}

    def process_kinematics_data(self, filter_config=None):
        self.processed_data = {key: self.raw_data[key] for key in ("timestamps", "positions", "velocities", "accelerations")}


def write_configuration(path, test, *, friction=False, offset=False, cutoff_hz=10.0, stage="fit"):
    words = dict(friction=str(friction).lower(), offset=str(offset).lower())
    Path(path).write_text(CONFIGURATION.format(test=test, cutoff_hz=cutoff_hz, stage=stage, **words))


def write_recording(path, recording, exact):
    """The input table: recorded t, q, tau; with `exact` also the exact derivatives of the motion."""
    groups = dict(q=recording.q_measured, tau=recording.tau_measured)
    if exact:
        groups |= dict(dq=recording.dq, ddq=recording.ddq)
    columns = {f"{key}{i}": values[:, i] for key, values in groups.items() for i in range(values.shape[1])}
    pd.DataFrame({"t": recording.t, **columns}).to_csv(path, index=False, float_format="%.17g")


def base_regressor(found, q, dq, ddq):
    """Regressor of the selected base parameters, rows sorted by joint. FIGAROH has no public name for the selected columns."""
    W = build_regressor_basic(found.robot, q, dq, ddq, found.identif_config)
    return build_regressor_reduced(W, found._idx_eliminated)[:, list(found._base_indices)]


def predict(found, q, dq, ddq):
    """Torques, Nm, shape (samples, joints); of the physically consistent bodies if these were selected."""
    if found.selected is not None:
        tau = found.selected.predict(build_regressor_basic(found.robot, q, dq, ddq, found.identif_config))
    else:
        tau = base_regressor(found, q, dq, ddq) @ found.phi_base
    return tau.reshape(-1, len(q)).T
