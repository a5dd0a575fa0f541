"""mujoco.sysid user code for the arm of its tutorial."""
import mujoco
import numpy as np
from mujoco import sysid

# begin user


def identify(xml, recording, unknown, first_guess, most):
    """Fits the attributes `unknown` ("armature", "damping") of all joints; returns values, half widths of the 95 % intervals and the model."""
    spec = mujoco.MjSpec.from_string(xml)
    model = spec.compile()
    parameters = sysid.ParameterDict()
    for attribute in unknown:
        for joint in [one.name for one in spec.joints]:

            def write(spec, parameter, joint=joint, attribute=attribute):
                if attribute == "armature":
                    spec.joint(joint).armature = parameter.value[0]
                else:
                    spec.joint(joint).damping = [parameter.value[0], 0.0, 0.0]

            name = f"{joint}_{attribute}"
            parameters.add(sysid.Parameter(name, nominal=first_guess[attribute], min_value=0.01, max_value=most[attribute], modifier=write))
    control = sysid.TimeSeries(recording.t, recording.tau)
    # In a rollout, sensors belong to the state before each step, and times to the state after the step.
    positions = sysid.TimeSeries.from_names(recording.t[:-1] + model.opt.timestep, recording.q_measured[:-1], model)
    data = mujoco.MjData(model)
    start = sysid.create_initial_state(model, data.qpos, data.qvel, data.act)
    sequence = sysid.ModelSequences("arm", spec, "train", start, control, positions)
    residual = sysid.build_residual_fn(models_sequences=[sequence], n_threads=1)
    found, result = sysid.optimize(initial_params=parameters, residual_fn=residual, optimizer="mujoco", verbose=False)
    residuals, _, _ = residual(result.x, found)
    _, half_width = sysid.calculate_intervals(residuals, result.jac)
    return found, half_width, sysid.apply_param_modifiers(found, spec)


# end user
