"""Robot dynamic identification: estimates a dynamic model with error bars from a robot description and logs.

>>> import dynident
>>> arm = dynident.Robot.load("arm.urdf")                               # doctest: +SKIP
>>> log = dynident.Log.from_arrays(t, q, tau)                           # doctest: +SKIP
>>> model = dynident.identify(arm, [log.fraction(0.0, 0.65), log.fraction(0.7, 1.0).validating()])  # doctest: +SKIP
>>> tau = model.predict(q, dq, ddq)                                     # doctest: +SKIP
"""

from . import fleet
from ._describe import Inspection, NewStudy, inspect, new
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
from ._model import Model
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
    "Factors",
    "FunctionWarning",
    "Inspection",
    "Iteration",
    "Log",
    "LogError",
    "Model",
    "NewStudy",
    "ProblemWarning",
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
