"""Dynident user code for both robots."""
import dynident

# begin ur10


def identify_ur10(urdf, train, test, **sections):
    columns = dict(position="q{0..5}", torque="tau{0..5}", time="t")
    logs = [dynident.Log.read(train, **columns, name="train"), dynident.Log.read(test, **columns, name="test", role="validate")]
    return dynident.identify(dynident.Robot.load(urdf), logs, threads=1, **sections)


# end ur10
NO_FRICTION = dict(drive={"viscous": False, "coulomb": "none", "offset": False}, friction="stated")

# begin arm


def identify_arm(xml, recording, damping=None):
    """Identifies armatures and, unless given, dampings of an arm with known bodies."""
    arm = dynident.Robot.from_mjcf(xml)
    log = dynident.Log.from_arrays(recording.t, recording.q_measured, recording.tau)
    known = {f"link{i}": {"known": body.tolist()} for i, body in enumerate(arm.inertial_parameters, 1)}
    # Equal limits are rejected, so the limits differ by 1e-6 (relative).
    laws = {} if damping is None else {f"fv{i}": [0.999999 * one, 1.000001 * one] for i, one in enumerate(damping, 1)}
    drive = {"drive_inertia": True, "coulomb": "none", "offset": False}
    estimator = {"physical": {"bodies": known, "laws": laws}}
    return dynident.identify(arm, log, threads=1, drive=drive, friction="stated", estimator=estimator)


# end arm
PARAMETERS = ["m", "mx", "my", "mz", "Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "Izz"]


def symbols(bodies, **drives):
    """Values of all symbols in names of base parameters: `bodies` has ten numbers each, `drives` one per joint."""
    found = {f"{symbol}{i}": value for i, body in enumerate(bodies, 1) for symbol, value in zip(PARAMETERS, body)}
    return found | {f"{symbol}{i}": value for symbol, values in drives.items() for i, value in enumerate(values, 1)}


def value_of(name, truth):
    """True value of a base parameter such as `Izz1 + 0.49 m2 - my3`; symbols without a true value are zero."""
    total, sign, factor = 0.0, 1.0, 1.0
    for word in name.split():
        if word in "+-":
            sign, factor = (1.0 if word == "+" else -1.0), 1.0
        elif word[0].isdigit():
            factor = float(word)
        else:
            total += sign * factor * truth.get(word, 0.0)
    return total


def errors_in_bars(model, truth, counts=lambda name: True):
    """For all excited base parameters selected by `counts`: errors in standard deviations, and whether the interval contains the true value."""
    excited = [one["excited"] for one in model.result["base_parameters"]]
    rows = [
        (value - value_of(name, truth), std, half_width)
        for name, value, std, half_width, told in zip(model.names, model.values, model.std, model.half_width_95, excited)
        if told and counts(name)
    ]
    return [error / std for error, std, _ in rows], [abs(error) <= half_width for error, _, half_width in rows]
