"""What a user of Dynident writes for either robot."""
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
    """Armatures and, unless they are given, dampings of an arm whose bodies are known."""
    arm = dynident.Robot.from_mjcf(xml)
    log = dynident.Log.from_arrays(recording.t, recording.q_measured, recording.tau)
    known = {f"link{i}": {"known": body.tolist()} for i, body in enumerate(arm.inertial_parameters, 1)}
    # Limits that touch are refused; these leave a millionth.
    laws = {} if damping is None else {f"fv{i}": [0.999999 * one, 1.000001 * one] for i, one in enumerate(damping, 1)}
    drive = {"drive_inertia": True, "coulomb": "none", "offset": False}
    estimator = {"physical": {"bodies": known, "laws": laws}}
    return dynident.identify(arm, log, threads=1, drive=drive, friction="stated", estimator=estimator)


# end arm
PARAMETERS = ["m", "mx", "my", "mz", "Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "Izz"]


def symbols(bodies, **drives):
    """What every symbol in the name of a base parameter stands for: `bodies` ten numbers each, `drives` one of each joint."""
    found = {f"{symbol}{i}": value for i, body in enumerate(bodies, 1) for symbol, value in zip(PARAMETERS, body)}
    return found | {f"{symbol}{i}": value for symbol, values in drives.items() for i, value in enumerate(values, 1)}


def value_of(name, truth):
    """The sum that a base parameter is, `Izz1 + 0.49 m2 - my3`, of the true values; what the truth does not have is nothing."""
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
    """Of every excited base parameter that counts its error in standard deviations, and whether the truth lies in its interval."""
    excited = [one["excited"] for one in model.result["base_parameters"]]
    rows = [
        (value - value_of(name, truth), std, half_width)
        for name, value, std, half_width, told in zip(model.names, model.values, model.std, model.half_width_95, excited)
        if told and counts(name)
    ]
    return [error / std for error, std, _ in rows], [abs(error) <= half_width for error, _, half_width in rows]
