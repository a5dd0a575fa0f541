"""Corpus of log files as other laboratories write them: simulated arms (arms.py, known truth) and independent writers.

For each case `dynident log`, `new` and `identify` run; the identified URDF is compared with the truth.
usage: corpus.py [NAME-PART ..]     writes OUT/files/NAME/.., OUT/results.json, OUT/results.md
       corpus.py NOTHING            rewrites results.md only
Environment: DYNIDENT (program, default target/release/dynident), OUT (folder, default corpus), ERD (folder of the
robots of example-robot-data), ONLY_NEW=1 (no identify: shows the chosen columns). Packages: requirements.txt.
"""
import json, os, re, shutil, subprocess, sys, time, traceback
import numpy as np
from arms import OUT, Arm

DYN = os.path.abspath(os.environ.get("DYNIDENT", "target/release/dynident"))
ROOT = OUT + "files"
CASES = {}


def case(robot, rate=125.0, seconds=20.0, expect="right", say="", args=(), fix=None, true_rate=None, want=(), noise=0.01):
    """expect: right | unsure | refused | problem; say: regex that new, log or identify must print; want: column patterns that the study must name; fix: study text -> study text."""
    def wrap(f):
        CASES[f.__name__] = dict(write=f, robot=robot, rate=rate, seconds=seconds, expect=expect, say=say, args=list(args), fix=fix, true_rate=true_rate, want=want, noise=noise)
        return f
    return wrap


def run(arguments, cwd):
    try:
        p = subprocess.run([DYN, *arguments], cwd=cwd, capture_output=True, text=True, timeout=200, stdin=subprocess.DEVNULL)
        return p.returncode, p.stdout, p.stderr
    except subprocess.TimeoutExpired:
        return 99, "", "TIMEOUT"


def held_out(result):
    try:
        r = json.load(open(result))
        imp = r["logs"][0]["import"]
        return dict(held=[round(v["physical"]["relative_error_percent"], 2) for v in r["validation"]],
                    joints=[round(j["relative_error_percent"], 1) for j in r["validation"][0]["joints"]],
                    rate=imp.get("rate_hz"), rows=imp.get("rows"), velocities=r["logs"][0].get("velocities"))
    except Exception as e:
        return dict(held=[], joints=[], rate=None, error=str(e))


def one(name, c):
    folder = os.path.join(ROOT, name)
    shutil.rmtree(folder, ignore_errors=True)
    os.makedirs(folder)
    arm = Arm(c["robot"])
    a = arm.log(c["seconds"], c["rate"], seed=1, noise=c["noise"])
    b = arm.log(c["seconds"] * 0.7, c["rate"], seed=2, noise=c["noise"])
    out = dict(name=name, robot=c["robot"], expect=c["expect"], doc=(c["write"].__doc__ or "").strip())
    logs = c["write"](folder + "/", a, b, arm)
    robot = os.path.relpath(arm.urdf, folder)
    if isinstance(logs, tuple):
        logs, robot = logs
    s, o, e = run(["log", logs[0]], folder)
    open(folder + "/log.out", "w").write(f"exit {s}\n{o}\n--\n{e}")
    out["log"] = s
    s, o, e = run(["new", "--robot", robot, "--log", *logs, *c["args"], "--out", "study.toml"], folder)
    said = o + e
    open(folder + "/new.out", "w").write(f"exit {s}\n{o}\n--\n{e}")
    out["new"] = s
    study = folder + "/study.toml"
    if not os.path.exists(study):
        out["verdict"] = "refused"
        out["text"] = e.strip()[:600]
    else:
        text = open(study).read()
        out["unsure"] = [x.strip() for x in text.splitlines() if "UNSURE" in x and not x.startswith("# Written by")]
        sections = {k: v for k, v in re.findall(r"^\[format\.(\w+)\]\n((?:.+\n)*)", text, re.M)}
        out["mapped"] = all(re.search('"' + re.sub(r"\\{.*?\\}", r"(\\{.*\\}|\\d+)", re.escape(w)) + '"', sections.get(k, "")) is not None for k, w in zip(("position", "torque"), c["want"]))
        if os.environ.get("ONLY_NEW"):
            out["verdict"] = ("columns right" if out["mapped"] else "SILENTLY WRONG") if s == 0 else ("flagged by new" if out["mapped"] else "wrong columns, flagged by new")
            out["columns"] = re.findall(r"^(?:columns|time|unit|scale|rate_hz) = .*", text, re.M)
            out["notes"] = [x[:200] for x in e.splitlines() if x.startswith("note: check")]
            return out
        s, o, e = run(["identify", "study.toml", "--out", "r"], folder)
        said += text + o + e
        open(folder + "/identify.out", "w").write(f"exit {s}\n{o}\n--\n{e}")
        out["identify"] = s
        out.update(held_out(folder + "/r/result.json"))
        out["true"] = truth(arm, folder + "/r/identified.urdf")
        good = out["true"] is not None and out["true"] < 4 and out["mapped"] and (out["rate"] is None or abs(out["rate"] / a_rate(c) - 1) < 0.02)
        if s == 0 and out["new"] == 0:
            out["verdict"] = "right" if good else "SILENTLY WRONG"
        elif out["new"] == 1 and s == 0:
            out["verdict"] = "unsure, right" if good else "unsure"
        else:
            out["verdict"] = ("flagged, right" if good else "flagged") + (f" (identify {s})")
        if c["fix"]:
            open(folder + "/fixed.toml", "w").write(c["fix"](text))
            s, o, e = run(["identify", "fixed.toml", "--out", "rf"], folder)
            open(folder + "/fixed.out", "w").write(f"exit {s}\n{o}\n--\n{e}")
            out["fixed"] = [s, truth(arm, folder + "/rf/identified.urdf")]
    if c["say"]:
        out["said"] = bool(re.search(c["say"], said, re.S | re.I))
    return out


def a_rate(c):
    return c.get("true_rate") or c["rate"]


def truth(arm, urdf):
    try:
        return round(arm.truth_error(urdf), 3)
    except Exception:
        return None


def main():
    import cases_text, cases_binary, cases_more, cases_clock  # noqa: F401  registers the cases
    picked = [n for n in CASES if len(sys.argv) == 1 or any(p in n for p in sys.argv[1:])]
    path = OUT + "results.json"
    results = json.load(open(path)) if os.path.exists(path) else {}
    for n in picked:
        t0 = time.time()
        try:
            r = one(n, CASES[n])
        except Exception:
            r = dict(name=n, robot=CASES[n]["robot"], verdict="WRITER FAILED", text=traceback.format_exc()[-500:], doc="", expect="")
        r["seconds"] = round(time.time() - t0, 1)
        results[n] = r
        print(f"{n:32s} {r['robot']:7s} exp={r['expect']:8s} {r['verdict']:24s} true={r.get('true')} held={r.get('held')} rate={r.get('rate')} new={r.get('new')} id={r.get('identify')} said={r.get('said')} fixed={r.get('fixed')} {r['seconds']}s", flush=True)
        for x in r.get("columns", []) + r.get("notes", []):
            print("        ", x[:220], flush=True)
        for x in r.get("unsure", []) + ([r["text"][:300]] if "text" in r else []):
            print("      ", x[:300], flush=True)
        json.dump(results, open(path + ".new", "w"), indent=1)
        os.replace(path + ".new", path)
    table(results, path.replace(".json", ".md"))
    wrong = [n for n in picked if results[n]["verdict"] in ("SILENTLY WRONG", "WRITER FAILED")]
    sys.exit(f"wrong: {', '.join(wrong)}" if wrong else 0)


def table(results, path):
    """results.md: counts of (expected, verdict), then all cases"""
    count = {}
    for r in results.values():
        k = (r["expect"], re.sub(r" \(.*", "", r["verdict"])); count[k] = count.get(k, 0) + 1
    lines = ["| expected | verdict | cases |", "| --- | --- | --- |"] + [f"| {a} | {b} | {n} |" for (a, b), n in sorted(count.items())] + [""]
    lines += ["| case | robot | content | expected | verdict | rigid torque error % | held-out % | new, identify |", "| --- | --- | --- | --- | --- | --- | --- | --- |"]
    for n, r in results.items():
        lines.append(f"| {n} | {r['robot']} | {r['doc']} | {r['expect']} | {r['verdict']} | {r.get('true', '')} | {r.get('held', '')} | {r.get('new')}, {r.get('identify')} |")
    open(path, "w").write("\n".join(lines) + "\n")


if __name__ == "__main__":
    sys.modules["corpus"] = sys.modules["__main__"]
    main()
