"""Tests robot descriptions, new studies, and exports of payloads and drives."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest
from conftest import motion

import dynident


def test_a_description_is_audited(ur10: dynident.Robot, root: Path) -> None:
    found = dynident.inspect(ur10)
    assert found.ok and found.fixed is None and not found.slips
    assert found.base_parameters == ur10.base_parameters or len(found.base_parameters) == len(ur10.base_parameters)
    assert found.result == dynident.inspect(root / "robots" / "ur10.urdf").result
    # An exporter error negates all first moments; the corrected copy must equal the original.
    text = (root / "robots" / "iiwa14.urdf").read_text()
    harmed = re.sub(r'(i[xyz][xyz]=")([1-9]|0\.0*[1-9])', r"\1-\2", text)
    slipped = dynident.inspect(dynident.Robot.from_urdf(harmed))
    assert not slipped.ok and slipped.slips and "slip" in str(slipped)
    assert slipped.fixed == text


def test_a_study_is_written(root: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(root)
    logs = [Path("examples/ur10_simulated") / name for name in ("train.csv", "test.csv")]
    place = tmp_path / "study.toml"
    # Stated lines replace generated lines.
    stated = [{"table": "format.torque", "line": 'unit = "Nm"'}]
    found = dynident.new("robots/ur10.urdf", logs, place, stated=stated)
    assert found.ok, found.unsure
    assert place.read_text() == found.text == str(found)
    assert 'unit = "Nm"' in found.text
    assert dynident.Study.load(place).log_names == found.study().log_names == ["train", "test"]
    with pytest.raises(dynident.StudyError, match="force=True"):
        dynident.new("robots/ur10.urdf", logs, place)
    with pytest.raises(dynident.StudyError, match="stated"):
        dynident.new("robots/ur10.urdf", logs, stated=[{"line": 'unit = "Nm"'}])


def test_drives_for_simulators(planar: dynident.Robot, planar_logs: list[dynident.Log]) -> None:
    drive = {"viscous": True, "coulomb": "none", "offset": False}
    model = dynident.identify(planar, planar_logs, drive=drive, friction="stated")
    found = model.to_simulator()
    assert found["schema"].startswith("dynident/simulator/")
    assert [joint["name"] for joint in found["joints"]] == planar.joint_names
    assert found["joints"][0]["damping"]["value"] == pytest.approx(model.friction["joint1"]["fv1"])
    assert planar.joint_names[1] in model.to_simulator_table()
    with pytest.raises(dynident.ResultError, match="no payload was estimated"):
        model.to_payload("ur")


def test_a_payload_in_a_controllers_form(planar: dynident.Robot) -> None:
    text = planar.text
    logs = []
    # The payload at the end of the second link: 1 kg.
    loaded = re.sub(
        r'(<link name="link2">.*?<mass value=")([^"]+)', lambda found: f"{found[1]}{float(found[2]) + 1.0}", text, flags=re.DOTALL
    )
    for seed, robot, payload in [(1, planar, None), (2, dynident.Robot.from_urdf(loaded), "load")]:
        t, q, dq, ddq = motion(planar.n, seed=seed)
        tau = robot.inverse_dynamics(q, dq, ddq) + dq * [0.8, 0.4]
        tau += 0.01 * np.random.default_rng(seed).standard_normal(q.shape)
        logs.append(dynident.Log.from_arrays(t, q, tau, name=f"run {seed}", payload=payload))
    drive = {"viscous": True, "coulomb": "none", "offset": False}
    model = dynident.identify(
        planar, logs, drive=drive, friction="stated", estimator="weighted", payload=[{"name": "load", "link": "link2"}]
    )
    assert model.result["payloads"][0]["name"] == "load"
    with pytest.raises(dynident.ResultError, match="give one of ur, franka, kuka, abb"):
        model.to_payload("fanuc")
    possible = model.result["payloads"][0]["possible"]
    assert possible is not None
    assert "set_target_payload" in model.to_payload("ur")
    assert json.loads(model.to_payload("franka", "load"))
    with pytest.raises(dynident.ResultError, match="no payload `other`"):
        model.to_payload("ur", "other")
