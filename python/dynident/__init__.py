"""Robot dynamic identification: estimates a dynamic model with error bars from a robot description and logs.

>>> import dynident
>>> given = dynident.example()                      # for your arm: Robot.load("arm.urdf"), Log.from_arrays(t, q, tau)
>>> model = dynident.identify(given.robot, given.logs)
>>> model.ok, model.predict(given.logs[1].q).shape
(True, (..., 6))
"""

from . import fleet
from ._describe import Inspection, NewStudy, inspect, new
from ._example import Example, example
from ._functions import FunctionWarning
from ._iterate import Iteration, iterate
from ._jobs import (
    Check,
    Design,
    ProblemWarning,
    Simulation,
    check,
    design,
    identify,
    identify_servos,
    log_contents,
    simulate,
    validate,
)
from ._log import Log
from ._model import Model, Residuals
from ._native import (
    Error,
    EstimatorRows,
    Factors,
    LogError,
    ResultError,
    Robot,
    RobotError,
    Run,
    StopRun,
    Study,
    StudyError,
    Watch,
    __version__,
)
from ._servo import ServoModel, ServoScale, ServoValue
from ._study import study, with_logs

__all__ = [
    "Check",
    "Design",
    "Error",
    "EstimatorRows",
    "Example",
    "Factors",
    "FunctionWarning",
    "Inspection",
    "Iteration",
    "Log",
    "LogError",
    "Model",
    "NewStudy",
    "ProblemWarning",
    "Residuals",
    "ResultError",
    "Robot",
    "RobotError",
    "Run",
    "ServoModel",
    "ServoScale",
    "ServoValue",
    "Simulation",
    "StopRun",
    "Study",
    "StudyError",
    "Watch",
    "__version__",
    "check",
    "design",
    "example",
    "fleet",
    "identify",
    "identify_servos",
    "inspect",
    "iterate",
    "log_contents",
    "new",
    "simulate",
    "study",
    "validate",
    "with_logs",
]
