"""Tests identification from arrays, tables and files."""

from __future__ import annotations

import concurrent.futures
import csv
import json
import multiprocessing
import pickle
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from conftest import motion

import dynident

DRIVE = {"viscous": True, "coulomb": "none", "offset": False}


@pytest.fixture(scope="module")
def model(planar: dynident.Robot, planar_logs: list[dynident.Log]) -> dynident.Model:
    return dynident.identify(planar, planar_logs, drive=DRIVE, friction="stated")


def test_arrays_to_a_model(model: dynident.Model, planar: dynident.Robot) -> None:
    assert model.ok, model.problems
    assert set(model.validation_error_percent) == {"run 2"}
    assert model.validation_error_percent["run 2"] < 1.0
    friction = {symbol: value for joint in model.friction.values() for symbol, value in joint.items()}
    truth = dict(zip(planar.base_parameters, planar.base_projection @ planar.inertial_parameters.ravel(), strict=True))
    truth |= {"fv1": 0.8, "fv2": 0.4}
    off = [abs(value - truth[name]) / bar for name, value, bar in zip(model.names, model.values, model.std, strict=True)]
    # One of eight values exceeds four standard deviations in one of 2,000 draws; the draw is fixed.
    assert max(off) < 4.0, dict(zip(model.names, off, strict=True))
    assert abs(friction["fv1"] - 0.8) < 0.01
    assert model.covariance.shape == (len(model.names),) * 2
    np.testing.assert_allclose(np.sqrt(np.diag(model.covariance)), model.std, rtol=1e-12)


def test_prediction_is_the_dynamics_of_what_was_found(model: dynident.Model) -> None:
    _, q, dq, ddq = motion(2, seed=5)
    tau, half = model.predict_with_band(q, dq, ddq)
    assert tau.shape == half.shape == q.shape
    assert (half > 0).all()
    found = model.robot()
    viscous = [joint[f"fv{k + 1}"] for k, joint in enumerate(model.friction.values())]
    np.testing.assert_allclose(tau, found.inverse_dynamics(q, dq, ddq) + dq * viscous, atol=1e-9)
    np.testing.assert_array_equal(model.predict(q[3], dq[3], ddq[3]), tau[3])


def test_pickled_models_and_studies_are_the_same(model: dynident.Model, planar_logs: list[dynident.Log]) -> None:
    again = pickle.loads(pickle.dumps(model))
    assert again.result == model.result
    _, q, dq, ddq = motion(2, seed=5)
    np.testing.assert_array_equal(again.predict(q, dq, ddq), model.predict(q, dq, ddq))
    assert again.to_c() == model.to_c()
    study = dynident.study(model.robot(), planar_logs, drive=DRIVE, friction="stated")
    twice = [dynident.identify(one, threads=1) for one in (study, pickle.loads(pickle.dumps(study)))]
    np.testing.assert_array_equal(twice[0].values, twice[1].values)


def test_models_are_saved_and_loaded(model: dynident.Model, tmp_path: Path, planar_logs: list[dynident.Log]) -> None:
    model.save(tmp_path)
    again = dynident.Model.load(tmp_path, model.study)
    assert again.result == model.result
    tested = dynident.validate(again, planar_logs[1])
    errors = [one["validation"][0]["physical"]["relative_error_percent"] for one in (tested, model.result)]
    assert errors[0] == pytest.approx(errors[1], abs=1e-9)
    assert "<table" in model._repr_html_()
    assert "held out run 2" in repr(model)


def test_every_form_is_written(model: dynident.Model) -> None:
    for form in ["c", "cpp", "rust", "python", "matlab", "mjcf", "urdf", "sdf", "ros2-yaml", "json"]:
        assert len(model.export(form)) > 200, form
    with pytest.raises(dynident.ResultError, match="no form `java`"):
        model.export("java")
    assert dynident.Robot.from_mjcf(model.to_mjcf()).n == dynident.Robot.from_sdf(model.to_sdf()).n == 2


def test_a_file_a_table_and_arrays_are_one(
    planar: dynident.Robot, planar_logs: list[dynident.Log], model: dynident.Model, tmp_path: Path
) -> None:
    pandas = pytest.importorskip("pandas")
    columns = planar_logs[0].columns
    assert columns is not None
    file = tmp_path / "run.csv"
    with file.open("w", newline="") as out:
        writer = csv.writer(out)
        writer.writerow(columns)
        writer.writerows([map(repr, row) for row in np.array(list(columns.values())).T.tolist()])
    read = dynident.Log.read(file, "q{1..2}", "tau{1..2}", time="t_s", name="run 1")
    table = dynident.Log.from_pandas(pandas.read_csv(file), "q{1..2}", ["tau1", "tau2"], time="t_s")
    indexed = dynident.Log.from_pandas(pandas.read_csv(file).set_index("t_s"), "q{1..2}", "tau{1..2}")
    for log in [read, table, indexed]:
        found = dynident.identify(planar, [log, planar_logs[1]], drive=DRIVE, friction="stated")
        np.testing.assert_array_equal(found.values, model.values)
    degrees = {column: np.degrees(values) if column.startswith("q") else values for column, values in columns.items()}
    turned = dynident.Log.from_pandas(
        pandas.DataFrame(degrees), {"columns": "q{1..2}", "unit": "deg"}, "tau{1..2}", time="t_s"
    )
    found = dynident.identify(planar, [turned, planar_logs[1]], drive=DRIVE, friction="stated")
    np.testing.assert_allclose(found.values, model.values, rtol=1e-9, atol=1e-9)
    assert dynident.log_contents(file)["channels"][0]["name"] == "t_s"


def test_the_command_gives_the_same_bits(root: Path, tmp_path: Path) -> None:
    study = root / "examples" / "ur10_simulated.toml"
    command = [sys.executable, "-m", "dynident", "identify", str(study), "--out", str(tmp_path / "out"), "--quiet"]
    subprocess.run(command, check=True)
    from_command = json.loads((tmp_path / "out" / "result.json").read_text())
    from_python = dynident.identify(study, threads=1).result
    for result in (from_command, from_python):
        result.pop("timings_s")
        result["provenance"].pop("command")
    assert from_python == from_command


def test_parts_of_one_recording(planar: dynident.Robot, planar_logs: list[dynident.Log]) -> None:
    log = planar_logs[0]
    parts = [log.fraction(0.0, 0.6), log.fraction(0.65, 1.0).validating()]
    assert dynident.identify(planar, parts, drive=DRIVE, friction="stated").validation_error_percent
    with pytest.raises(dynident.StudyError, match="contains samples of the training log"):
        dynident.identify(planar, [log, log.validating()], drive=DRIVE)


def test_a_problem_is_warned_of(planar: dynident.Robot, planar_logs: list[dynident.Log]) -> None:
    reversed_torque = [
        dynident.Log.from_arrays(
            log.columns["t_s"],
            np.stack([log.columns["q1"], log.columns["q2"]], axis=1),
            np.stack([log.columns["tau1"], -log.columns["tau2"]], axis=1),
            name=log.name,
            role=log.role,
        )
        for log in planar_logs
        if log.columns is not None
    ]
    with pytest.warns(dynident.ProblemWarning):
        found = dynident.identify(planar, reversed_torque, drive=DRIVE, friction="stated")
    assert not found.ok
    examined = dynident.check(planar, reversed_torque, drive=DRIVE, friction="stated")
    assert not examined.ok
    assert "torque" in str(examined)
    assert dynident.check(planar, planar_logs, drive=DRIVE, friction="stated").ok


def test_exceptions_say_where(planar: dynident.Robot, planar_logs: list[dynident.Log], tmp_path: Path) -> None:
    with pytest.raises(dynident.StudyError, match="unknown field `coulom`"):
        dynident.identify(planar, planar_logs, drive={"coulom": "sign"})
    with pytest.raises(dynident.LogError, match="one of time_s or rate_hz|either time_s or rate_hz"):
        dynident.Log.from_arrays(None, np.zeros((3, 2)), np.zeros((3, 2)))
    short = dynident.Log.from_arrays(np.arange(10.0), np.zeros((10, 3)), np.zeros((10, 3)))
    with pytest.raises(dynident.Error, match="3|joint"):
        dynident.identify(planar, short)
    bad = tmp_path / "study.toml"
    bad.write_text("[robot]\nfile = 3\n")
    with pytest.raises(dynident.StudyError) as raised:
        dynident.Study.load(bad)
    assert (str(raised.value.path), raised.value.line) == (str(bad), 2)
    with pytest.raises(TypeError, match="already contains its sections"):
        dynident.identify(dynident.study(planar, planar_logs), drive=DRIVE)


def test_progress_is_heard(planar: dynident.Robot) -> None:
    logs = []
    for seed, role in [(1, "identify"), (2, "validate")]:
        t, q, dq, ddq = motion(2, seconds=600.0, seed=seed)
        logs.append(dynident.Log.from_arrays(t, q, planar.inverse_dynamics(q, dq, ddq), name=str(seed), role=role))
    heard = []
    dynident.identify(planar, logs, progress=lambda stage, done, total: heard.append((stage, done, total)))
    assert heard
    assert all(isinstance(stage, str) and done >= 0 for stage, done, _ in heard)


LONG = """
import signal, sys, time, dynident
# A background job may inherit an ignored SIGINT.
signal.signal(signal.SIGINT, signal.default_int_handler)
study = dynident.Study.load(sys.argv[1])
print("begun", flush=True)
begin = time.monotonic()
try:
    while True:
        dynident.identify(study)
except KeyboardInterrupt:
    print("interrupted after", time.monotonic() - begin, flush=True)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="no signals to send")
def test_ctrl_c_ends_a_job(root: Path) -> None:
    study = str(root / "examples" / "ur10_simulated.toml")
    with subprocess.Popen([sys.executable, "-c", LONG, study], stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "begun\n"
        time.sleep(0.5)
        process.send_signal(signal.SIGINT)
        try:
            # The interrupt takes a fraction of a second; the limit allows for a busy machine.
            answer, _ = process.communicate(timeout=60)
        finally:
            process.kill()
        assert answer.startswith("interrupted after")
        assert process.returncode == 0


def _values(study: dynident.Study) -> list[float]:
    return dynident.identify(study, threads=2).values.tolist()


@pytest.mark.skipif("fork" not in multiprocessing.get_all_start_methods(), reason="the system does not fork")
@pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning")
def test_threads_and_processes_give_the_same(planar: dynident.Robot, planar_logs: list[dynident.Log]) -> None:
    study = dynident.study(planar, planar_logs, drive=DRIVE, friction="stated")
    expected = _values(study)
    with concurrent.futures.ThreadPoolExecutor(3) as threads:
        assert all(found == expected for found in threads.map(_values, [study] * 3))
    for method in ["fork", "spawn"]:
        context = multiprocessing.get_context(method)
        with concurrent.futures.ProcessPoolExecutor(2, mp_context=context) as processes:
            assert all(found == expected for found in processes.map(_values, [study] * 2, timeout=300))


def test_figures_for_papers(model: dynident.Model, tmp_path: Path) -> None:
    files = [tmp_path / name for name in ("f.svg", "f.csv", "f.tex")]
    for figure in ["parameters", "friction", "residuals"]:
        picture = model.plot(figure, files, width_mm=100.0)
        svg, csv, tex = (file.read_bytes() for file in files)
        assert picture._repr_svg_() == svg.decode() and 'width="100.0mm"' in picture.svg
        assert b"\\begin{tabular}" in tex
        rows_of_figure = len(model.names) if figure == "parameters" else 10
        assert len(csv.splitlines()) > rows_of_figure
    rows = [line.split(",") for line in csv.decode().splitlines()[1:]]
    # The residuals are those of the validation, in the band of the fit.
    (tested,) = dynident.validate(model)["validation"]
    for joint in tested["in_fit_band"]["joints"]:
        own = np.array([float(row[5]) for row in rows if row[1] == joint["name"]])
        assert np.sqrt(np.mean(own**2)) == pytest.approx(joint["rmse_nm"], rel=1e-6)
    # The wheel has no room for PDF and PNG.
    for form in ["PDF", "PNG"]:
        with pytest.raises(dynident.Error, match=f"writes no {form}"):
            model.plot("friction", tmp_path / f"f.{form.lower()}")
    with pytest.raises(dynident.ResultError, match="residuals, parameters, friction"):
        model.plot("nothing")
    with pytest.raises(dynident.Error, match=r"\.svg, \.pdf"):
        model.plot("friction", tmp_path / "f.bmp")


def test_pictures(model: dynident.Model) -> None:
    pytest.importorskip("matplotlib")
    t, q, dq, ddq = motion(2, seed=5)
    assert model.plot_parameters().axes
    assert len(model.plot_prediction(t, q, dq, ddq, model.predict(q, dq, ddq)).axes) == 2
    pytest.importorskip("pandas")
    assert model.to_pandas().loc["fv1", "value"] == pytest.approx(0.8, abs=0.01)


def test_noise_of_positions_is_no_other_robot(root: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The arm of mujoco.sysid's tutorial with encoder noise. Accelerations from 2 s of data are noisy; the torque
    check must not conclude that the robot description is wrong.
    """
    pytest.importorskip("mujoco")
    monkeypatch.syspath_prepend(str(root / "benchmarks" / "rivals"))
    import arm_tutorial
    import with_dynident

    arm = arm_tutorial.mjcf(arm_tutorial.ARMATURE, arm_tutorial.DAMPING)
    for noise_rad in (1e-3, 1e-4):
        for seed in (1, 2, 3):
            model = with_dynident.identify_arm(arm, arm_tutorial.record("train", noise_rad, seed))
            assert not [problem for problem in model.problems if "description" in problem], (noise_rad, seed)


def test_logs_with_the_same_name_are_all_listed(planar: dynident.Robot, planar_logs: list[dynident.Log]) -> None:
    logs = []
    for seed in range(3):
        t, q, dq, ddq = motion(2, seed=seed)
        tau = planar.inverse_dynamics(q, dq, ddq) + dq * [0.8, 0.4] + 0.02 * np.random.default_rng(seed).standard_normal(q.shape)
        logs.append(dynident.Log.from_arrays(t, q, tau, role="identify" if seed == 0 else "validate"))
    found = dynident.identify(planar, logs, drive=DRIVE, friction="stated")
    assert list(found.validation_error_percent) == ["log (2)", "log (3)"]
    assert found.study.log_names == ["log", "log (2)", "log (3)"]
    assert dynident.with_logs(found.study, logs[1:]).log_names == ["log", "log (2)"]


def test_a_log_is_a_copy(planar_logs: list[dynident.Log]) -> None:
    t, q, _, _ = motion(2, seconds=1.0)
    log = dynident.Log.from_arrays(t, q, q)
    before = q.copy()
    q[:] = 0.0
    t += 1.0
    np.testing.assert_array_equal(log.q, before)
    assert log.time_s[0] == 0.0
    assert log.fraction(0.5, 1.0).q.shape == (100, 2)
    with pytest.raises(dynident.LogError, match="no commands"):
        _ = log.command


def test_arrays_of_a_log_are_in_si(tmp_path: Path) -> None:
    file = tmp_path / "log.csv"
    file.write_text("t_ms,a,b,i1,i2\n0,180,0,1,2\n5,90,1,3,4\n")
    log = dynident.Log.read(
        file,
        {"columns": ["a", "b"], "unit": "deg"},
        {"columns": "i{1..2}", "unit": "A", "scale": 10.0},
        time={"column": "t_ms", "unit": "ms"},
    )
    np.testing.assert_allclose(log.q, np.radians([[180, 0], [90, 1]]))
    np.testing.assert_array_equal(log.tau, [[10, 20], [30, 40]])
    np.testing.assert_allclose(log.time_s, [0.0, 0.005])
    file.write_text("t_ms,a,b,i1,i2\n0,180,0,1,2\n5,90,oops,3,4\n")
    broken = dynident.Log.read(file, ["a", "b"], ["i1", "i2"], time="t_ms")
    with pytest.raises(dynident.LogError) as raised:
        _ = broken.q
    assert (raised.value.path, raised.value.line) == (file, 3)


def test_errors_of_logs_have_a_place(planar: dynident.Robot, tmp_path: Path) -> None:
    file = tmp_path / "log.csv"
    file.write_text("t,q1,q2,tau1,tau2\n0,0,0,0,0\n0.1,0,x,0,0\n")
    log = dynident.Log.read(file, "q{1..2}", "tau{1..2}", time="t")
    with pytest.raises(dynident.LogError, match="`x` is not a number") as raised:
        dynident.identify(planar, log)
    assert (raised.value.path, raised.value.line) == (file, 3)
    with pytest.raises(dynident.StudyError) as study:
        dynident.identify(planar, dynident.Log.read(tmp_path / "gone.csv", "q{1..2}", "tau{1..2}", time="t"))
    assert study.value.path == tmp_path / "gone.csv"


def test_frames_with_any_usual_index(planar: dynident.Robot, planar_logs: list[dynident.Log]) -> None:
    pd = pytest.importorskip("pandas")
    columns = dict(planar_logs[0].columns or {})
    t = columns.pop("t_s")
    table = pd.DataFrame(columns)
    seconds = pd.to_timedelta(t, unit="s")
    dates = pd.Timestamp("2026-01-05 10:00") + seconds
    named = {"position": "q{1..2}", "torque": "tau{1..2}"}
    indexes = {
        "seconds": t,
        "dates": dates,
        "dates with a zone": dates.tz_localize("Europe/Berlin"),
        "durations": seconds,
    }
    for name, index in indexes.items():
        log = dynident.Log.from_pandas(table.set_index(pd.Index(index)), **named)
        np.testing.assert_allclose(log.time_s, t, atol=1e-8, err_msg=name)
    counts = table.set_index(pd.Index(np.round(t * 1000).astype(np.int64)))
    np.testing.assert_allclose(dynident.Log.from_pandas(counts, **named, time={"unit": "ms"}).time_s, t, atol=1e-9)
    for column in (dates, dates.tz_localize("UTC"), seconds, t):
        log = dynident.Log.from_pandas(table.assign(when=column), **named, time="when")
        np.testing.assert_allclose(log.time_s, t, atol=1e-8)
    nullable = table.convert_dtypes().set_index(pd.Index(t))
    np.testing.assert_array_equal(dynident.Log.from_pandas(nullable, **named).q, planar_logs[0].q)
    refused = [
        (table, {}, "whole numbers: give its unit"),
        (counts, {}, "whole numbers: give its unit"),
        (table.set_index(pd.Index(dates.astype(str))), {}, "pandas.to_datetime"),
        (table.assign(when=dates.astype(str)), {"time": "when"}, "`when` has the type .* pandas.to_datetime"),
        (table.assign(q1="x").set_index(pd.Index(t)), {"position": ["q1", "q2"]}, "`q1` has the type .* pandas.to_numeric"),
        (pd.concat([table, table["q1"]], axis=1), {"time": "q2"}, "two columns are named `q1`"),
        (table.assign(when=dates), {"time": {"column": "when", "unit": "ms"}}, "omit unit"),
        (table.set_index([pd.Index(t), pd.Index(t)]), {}, "several levels"),
    ]
    for frame, further, words in refused:
        with pytest.raises(dynident.LogError, match=words):
            dynident.Log.from_pandas(frame, **{**named, **further})


def test_values_fit_on_a_screen(model: dynident.Model, planar: dynident.Robot, planar_logs: list[dynident.Log]) -> None:
    checked = dynident.check(planar, planar_logs, drive=DRIVE, friction="stated")
    simulated = dynident.simulate(planar, design={"duration_s": 2.0}, simulation={"rate_hz": 500.0})
    for value in (checked, simulated, dynident.inspect(planar), planar_logs[0], model, model.residuals()["run 2"], model.report):
        assert len(repr(value)) < 200, repr(value)[:400]
    assert model.report._repr_html_().startswith("<iframe srcdoc=") and "<html" in model.report
    assert "no mistake" in checked._repr_html_()


def test_a_saved_model_needs_no_study(model: dynident.Model, root: Path, tmp_path: Path) -> None:
    model.save(tmp_path / "saved")
    again = dynident.Model.load(tmp_path / "saved")
    assert again.result == model.result
    _, q, dq, ddq = motion(2, seed=5)
    np.testing.assert_array_equal(again.predict(q, dq, ddq), model.predict(q, dq, ddq))
    # A result of the command, with its study next to it.
    for name in ("study.toml", "ur10.urdf", "train.csv", "test.csv"):
        assert not (tmp_path / name).exists()
    given = dynident.example(tmp_path / "example")
    study = tmp_path / "example" / "study.toml"
    out = tmp_path / "example" / "result"
    assert dynident._native._command(["dynident", "identify", str(study), "--out", str(out), "--quiet"]) == 0
    found = dynident.Model.load(out)
    assert found.joint_names == given.robot.joint_names
    study.write_text(study.read_text() + "\n# changed\n")
    with pytest.raises(dynident.StudyError, match="or was changed: give it"):
        dynident.Model.load(out)


def test_model_dynamics_are_inverse_to_each_other(model: dynident.Model) -> None:
    _, q, dq, ddq = motion(2, seed=6, seconds=0.5)
    tau = model.predict(q, dq, ddq)
    np.testing.assert_allclose(model.forward_dynamics(q, dq, tau), ddq, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(model.mass_matrix(q), model.robot().mass_matrix(q), rtol=1e-9, atol=1e-12)
    np.testing.assert_array_equal(tau, model.predict_with_band(q, dq, ddq)[0])


def test_residuals_are_those_of_the_log(model: dynident.Model, planar: dynident.Robot, planar_logs: list[dynident.Log]) -> None:
    pytest.importorskip("pandas")
    found = model.residuals()
    assert list(found) == ["run 2"]
    one = found["run 2"]
    # The torque without noise.
    t, q, dq, ddq = motion(planar.n, seed=2)
    exact = planar.inverse_dynamics(q, dq, ddq) + dq * [0.8, 0.4]
    true = np.stack([np.interp(one.time_s, t - t[0], column) for column in exact.T], axis=1)
    inner = slice(len(true) // 20, -(len(true) // 20))
    rms = lambda values: np.sqrt(np.nanmean(values[inner] ** 2))
    assert rms(true) > 1.0
    # The noise of 0.02 Nm is white, so the filter of the fit leaves less of it in the measured torque, and hardly any in the prediction.
    assert rms(one.measured - true) < 0.02
    assert rms(one.predicted - true) < 0.01
    np.testing.assert_allclose(rms(one.residual), rms(one.measured - one.predicted))
    assert set(model.residuals(planar_logs[0].validating())) == {"run 1"}
    bodies = model.to_pandas("bodies")
    np.testing.assert_array_equal(bodies.to_numpy(), np.array(list(model.bodies.values())))
    assert model.to_pandas("friction").loc["joint1", "fv"] == model.friction["joint1"]["fv1"]


def test_many_threads_are_not_started(planar: dynident.Robot, planar_logs: list[dynident.Log], model: dynident.Model) -> None:
    # 10,000 threads took minutes.
    found = dynident.identify(planar, planar_logs, drive=DRIVE, friction="stated", threads=10_000)
    np.testing.assert_array_equal(found.values, model.values)


def test_figures_are_shown_in_notebooks(model: dynident.Model, planar_logs: list[dynident.Log]) -> None:
    pytest.importorskip("matplotlib")
    for figure in (model.plot_parameters(), planar_logs[0].plot()):
        assert figure._repr_png_()[:4] == b"\x89PNG"
