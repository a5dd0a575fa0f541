"""Robot dynamic identification: from a description and logs to a dynamic model with error bars."""

from ._native import Error, LogError, Robot, RobotError, StudyError

__all__ = ["Error", "LogError", "Robot", "RobotError", "StudyError"]
