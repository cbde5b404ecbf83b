"""Bad input on the command line: one line that names field, value and range; exit code 2; nothing run or written."""

from __future__ import annotations

import json
import os
import subprocess
import sys

import pytest

from comparisons import cli, isolation, run

BAD_INPUT, LOST_RUNS, INTERRUPTED = 2, 3, 130


@pytest.fixture(autouse=True)
def place(tmp_path, monkeypatch):
    """An empty working directory."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def nothing_runs(monkeypatch):
    """Any run, here or in a child, fails the test: input is judged before."""

    def ran(*_, **__):
        raise AssertionError("something ran before the input was judged")

    monkeypatch.setattr(isolation, "_start", ran)
    monkeypatch.setattr(run.Bound, "run", ran)


def one(*changes, scene="pendulum_chain", engine="pbd", dt="dt=0.01", extra=()):
    steps = [dt] if dt else []
    return ["run", scene, "--engine", engine, *extra, *sets(*steps, *changes), "--json", "records.json"]


def study(name, *changes, engines="pbd", scene="pendulum_chain"):
    return [name, scene, "--engines", engines, "-o", "out", "--json", "out.json", *sets(*changes)]


def sets(*changes):
    return [part for change in changes for part in ("--set", change)]


LONG = "x" * 300
CASES = {
    # time steps
    "dt zero": (one(dt="dt=0"), ["pbd.dt = 0.0", ">= 1e-12 and <= 1000 s"]),
    "dt negative": (one(dt="dt=-0.01"), ["pbd.dt = -0.01", ">= 1e-12"]),
    "dt NaN": (one(dt="dt=nan"), ["pbd.dt = nan", "a finite number"]),
    "dt inf": (one(dt="dt=inf"), ["pbd.dt = inf", "a finite number"]),
    "dt tiny": (one(dt="dt=1e-300"), ["pbd.dt = 1e-300", ">= 1e-12"]),
    "dt underflows": (one(dt="dt=1e-400"), ["pbd.dt = 0.0", ">= 1e-12"]),
    "dt huge": (one(dt="dt=1e6"), ["pbd.dt = 1000000.0", "<= 1000 s"]),
    "dt no number": (one(dt="dt=fast"), ["pbd.dt = 'fast'", "a finite number"]),
    "dt empty": (one(dt="dt="), ["pbd.dt = ''", "a finite number"]),
    "dt off the sample grid": (
        one(dt="dt=0.003"),
        ["dt = 0.003", "a whole fraction of the sample interval, 0.01 s", "0.003333333333"],
    ),
    "dt of pymunk": (one(dt="dt=nan", engine="pymunk"), ["pymunk.dt = nan", "finite"]),
    # settings
    "k above 1": (one("k=1.5"), ["pbd.k = 1.5", ">= 0 and <= 1"]),
    "k negative": (one("k=-0.1"), ["pbd.k = -0.1", ">= 0 and <= 1"]),
    "k NaN": (one("k=nan"), ["pbd.k = nan", ">= 0 and <= 1"]),
    "iterations 0": (one("iterations=0"), ["pbd.iterations = 0", ">= 1"]),
    "iterations 1e9": (one("iterations=1e9"), ["pbd.iterations = 1000000000", "<= 1e+06"]),
    "iterations fractional": (one("iterations=2.5"), ["pbd.iterations = '2.5'", "a whole number"]),
    "iterations infinite": (one("iterations=inf"), ["pbd.iterations = 'inf'", "a whole number"]),
    "substeps negative": (one("substeps=-1"), ["pbd.substeps = -1", ">= 1"]),
    "damping above 1": (one("damping=2"), ["pbd.damping = 2.0", "<= 1"]),
    "method unknown": (one("method=xpdb"), ["pbd.method = 'xpdb'", "one of", "did you mean 'xpbd'?"]),
    "method and k at odds": (one("method=xpbd", "k=0.5"), ["pbd.method = 'xpbd'", "must be pbd where k"]),
    "flag no flag": (one("raw=maybe"), ["pbd.raw = 'maybe'", "true or false"]),
    "stiffness 0": (one("stiffness=0", engine="symplectic_euler"), ["symplectic_euler.stiffness = 0.0", "> 0"]),
    "rtol 0": (one("rtol=0", engine="dop853", dt=""), ["dop853.rtol = 0.0", ">= 3e-14"]),
    # scene
    "mass negative": (one("scene.masses=-1"), ["scene.masses = -1.0", "> 0"]),
    "mass zero": (one("scene.masses=0"), ["scene.masses = 0.0", "> 0"]),
    "mass NaN in pymunk": (one("scene.masses=nan", engine="pymunk"), ["scene.masses = nan", "finite number > 0"]),
    "one mass NaN in pymunk": (
        one("scene.links=2", "scene.masses=1,nan", engine="pymunk"),
        ["scene.masses = [1.0, nan]", "> 0"],
    ),
    "mass inf in pybullet": (one("scene.masses=inf", engine="pybullet"), ["scene.masses = inf", "finite"]),
    "link of length zero": (one("scene.lengths=0"), ["scene.lengths = 0.0", ">= 1e-09 and <= 1e+06 m"]),
    "link of negative length": (one("scene.lengths=-1"), ["scene.lengths = -1.0", ">= 1e-09"]),
    "angle NaN": (one("scene.angles=nan"), ["scene.angles = nan", ">= -360 and <= 360 degrees"]),
    "compliance negative": (one("scene.compliance=-1e-3"), ["scene.compliance = -0.001", ">= 0"]),
    "compliance inf": (one("scene.compliance=inf"), ["scene.compliance = inf", "finite"]),
    "compliance of some links": (
        one("scene.links=2", "scene.compliance=0,1e-3"),
        ["scene.compliance = [0.0, 0.001]", "0 for all links or > 0 for all"],
    ),
    "gravity NaN": (one("scene.gravity=nan"), ["scene.gravity = nan", "m/s^2"]),
    "1e9 links": (one("scene.links=1e9"), ["scene.links = 1000000000", "<= 100000", "GB"]),
    "no links": (one("scene.links=0"), ["scene.links = 0", ">= 1"]),
    "links negative": (one("scene.links=-3"), ["scene.links = -3", ">= 1"]),
    "links fractional": (one("scene.links=2.5"), ["scene.links = '2.5'", "a whole number"]),
    "masses of the wrong length": (
        one("scene.links=3", "scene.masses=1,2"),
        ["scene.masses = '2 values'", "one number or 3"],
    ),
    "angles of the wrong length": (one("scene.links=2", "scene.angles=1,2,3"), ["scene.angles", "one number or 2"]),
    "duration negative": (one("scene.duration=-1"), ["scene.duration = -1.0", "> 0"]),
    "duration zero": (one("scene.duration=0"), ["scene.duration = 0.0", "> 0"]),
    "no samples": (one("scene.samples=0"), ["scene.samples = 0", ">= 1"]),
    "1e9 samples": (one("scene.samples=1e9"), ["scene.samples = 1000000000", "<= 1e+06"]),
    "cloth of one particle": (one("scene.size=1", scene="hanging_cloth"), ["scene.size = 1", ">= 2 and <= 1024"]),
    "cloth too large": (one("scene.size=1e6", scene="hanging_cloth"), ["scene.size = 1000000", "<= 1024"]),
    "cloth without mass": (one("scene.density=0", scene="hanging_cloth"), ["scene.density = 0.0", "> 0", "kg/m^2"]),
    "cloth without side": (one("scene.side=0", scene="hanging_cloth"), ["scene.side = 0.0", ">= 1e-06", " m"]),
    "cloth pinned nowhere": (
        one("scene.pinned=corner", scene="hanging_cloth"),
        ["scene.pinned = 'corner'", "one of corners, edge, none", "did you mean 'corners'?"],
    ),
    "cloth bent otherwise": (
        one("scene.bending=two_cells", scene="hanging_cloth"),
        ["scene.bending = 'two_cells'", "did you mean 'two_cell'?"],
    ),
    "cloth started askew": (one("scene.start=askew", scene="hanging_cloth"), ["scene.start", "horizontal, vertical"]),
    "cloth of half a flag": (one("scene.diagonals=maybe", scene="hanging_cloth"), ["true or false"]),
    "cloth stretched by NaN": (one("scene.stretch=nan", scene="hanging_cloth"), ["scene.stretch = nan", "<= 10"]),
    "cloth half rigid": (
        one("scene.bending_compliance=1e-3", scene="hanging_cloth"),
        ["scene.compliance = [0.0, 0.0, 0.0, 0.001]", "0 for all kinds of links or > 0 for all"],
    ),
    # names
    "scene unknown": (one(scene="pendulum_chian"), ["scene = 'pendulum_chian'", "did you mean 'pendulum_chain'?"]),
    "engine unknown": (one(engine="pymnk"), ["engine = 'pymnk'", "one of", "did you mean 'pymunk'?"]),
    "setting unknown": (one("iteration=3"), ["pbd setting = 'iteration'", "did you mean 'iterations'?"]),
    "scene parameter unknown": (one("scene.link=3"), ["scene parameter = 'link'", "did you mean 'links'?"]),
    "preset unknown": (one(extra=("--preset", "acurate")), ["pbd.preset = 'acurate'", "did you mean 'accurate'?"]),
    "owner unknown": (one("pbdd.k=1"), ["'pbdd'", "one of", "did you mean 'pbd'?"]),
    "owner not run": (one("pymunk.iterations=3"), ["--set = 'pymunk'", "one of pbd, scene"]),
    "set without equals sign": (one("links"), ["--set = 'links'", "of the form KEY=VALUE"]),
    "set of nothing": (one("=3"), ["''", "one of"]),
    "set of a bare dot": (one(".=3"), ["''", "one of"]),
    "scene outside": (one(scene="../../x"), ["scene = '../../x'", "one of"]),
    "scene with NUL": (one(scene="pendulum\0chain"), [r"scene = 'pendulum\x00chain'", "one of"]),
    "scene with a line feed": (one(scene="a\nb"), [r"scene = 'a\nb'", "one of"]),
    "scene private": (one(scene="__init__"), ["scene = '__init__'", "one of"]),
    "scene of 300 letters": (one(scene=LONG), ["scene = 'xxx", "...", "one of"]),
    "scene of markup": (one(scene="<script>"), ["scene = '<script>'", "one of"]),
    "engine outside": (one(engine="../../x"), ["engine = '../../x'", "one of"]),
    "engine with NUL": (one(engine="pbd\0"), [r"engine = 'pbd\x00'", "one of"]),
    "engine of 300 letters": (one(engine=LONG), ["engine = 'xxx", "...", "one of"]),
    "engine private": (one(engine="_checks"), ["engine = '_checks'", "one of"]),
    "setting with an escape": (one("\x1b[31m=1"), [r"'\x1b[31m'", "one of"]),
    "setting of 300 letters": (one(f"{LONG}=1"), ["pbd setting = 'xxx", "...", "one of"]),
    "value of 300 letters": (one(f"k={LONG}"), ["pbd.k = 'xxx", "...", "<= 1"]),
    # studies
    "study dt off the grid": (study("convergence", "dt=0.01,0.003"), ["dt = 0.003", "a whole fraction"]),
    "study dt twice": (study("convergence", "dt=0.01,0.01"), ["dt = [0.01, 0.01]", "different time steps"]),
    "study dt NaN": (study("convergence", "dt=0.01,nan"), ["pbd.dt = nan", "finite"]),
    "study dt empty": (study("convergence", "dt="), ["dt = ''", "a number"]),
    "study dt no number": (study("convergence", "dt=0.01,x"), ["dt = '0.01,x'", "a number"]),
    "study counts": (study("convergence", "dt=0.01", "substeps=2,0"), ["pbd.substeps = 0", ">= 1"]),
    "study counts fractional": (study("convergence", "substeps=1.5"), ["substeps = '1.5'", "a whole number"]),
    "study cap NaN": (study("convergence", "cap=nan"), ["cap = nan", "> 0"]),
    "study cap empty": (study("convergence", "cap="), ["cap = ''", "a number"]),
    "study cap several": (study("convergence", "cap=1,2"), ["cap = '1,2'", "a number"]),
    "study without a dt": (study("convergence", "dt=0.01", engines="dop853"), ["engines = 'dop853'", "time step"]),
    "study unknown argument": (study("convergence", "iteration=3"), ["'iteration'", "did you mean 'iterations'?"]),
    "study unknown engine": (study("convergence", engines="pbd,pymnk"), ["'pymnk'", "did you mean 'pymunk'?"]),
    "study unknown scene": (study("convergence", scene="pendulum"), ["scene = 'pendulum'", "one of"]),
    "study scene parameter": (study("convergence", "scene.masses=nan"), ["scene.masses = nan", "> 0"]),
    "race dt off the grid": (study("work_precision", "dt=0.01,0.003"), ["dt = 0.003", "a whole fraction"]),
    "race dt negative": (study("work_precision", "dt=0.01,-0.01"), ["pbd.dt = -0.01", ">= 1e-12"]),
    "race cap negative": (study("work_precision", "cap=-1"), ["cap = -1.0", "> 0"]),
    "race without rounds": (study("work_precision", "dt=0.01", "rounds=0"), ["rounds = 0", ">= 1"]),
    "race unknown engine": (study("work_precision", engines="pymnk"), ["'pymnk'", "did you mean 'pymunk'?"]),
    "race engine setting": (study("work_precision", "pbd.k=3"), ["pbd.k = 3.0", ">= 0 and <= 1"]),
    "stiffness k": (study("stiffness", "k=1.5"), ["k = 1.5", "> 0 and < 1"]),
    "stiffness k NaN": (study("stiffness", "k=nan"), ["k = nan", "> 0 and < 1"]),
    "stiffness k empty": (study("stiffness", "k="), ["k = ''", "a number"]),
    "stiffness k several": (study("stiffness", "k=0.1,0.2"), ["k = '0.1,0.2'", "a number"]),
    "stiffness dt": (study("stiffness", "dt=-1"), ["pbd.dt = -1.0", ">= 1e-12"]),
    "stiffness dt NaN": (study("stiffness", "dt=nan"), ["nan", "finite"]),
    "stiffness dt tiny": (study("stiffness", "dt=1e-300"), ["1e-300", ">= 1e-12"]),
    "stiffness iterations": (study("stiffness", "iterations=1,0"), ["pbd.iterations = 0", ">= 1"]),
    "stiffness engine": (study("stiffness", engines="pbdd"), ["engine = 'pbdd'", "did you mean 'pbd'?"]),
    "stiffness settings": (study("stiffness", "pbd.k=0.5"), ["settings = ['pbd']", "absent"]),
}


def assert_one_line(code, out, err, fragments, place):
    assert code == BAD_INPUT, (code, out, err)
    assert out == ""
    assert err.endswith("\n")
    assert err.count("\n") == 1, "exactly one line"
    assert err[:-1].isprintable(), "nothing that a terminal would obey"
    assert err.startswith("pbdbench: ")
    assert "must be " in err
    for fragment in fragments:
        assert fragment in err
    assert list(place.iterdir()) == [], "nothing written"


@pytest.mark.usefixtures("nothing_runs")
@pytest.mark.parametrize("case", CASES)
def test_bad_input_is_one_line(case, place, capsys):
    arguments, fragments = CASES[case]
    code = cli.main(arguments)
    assert_one_line(code, *capsys.readouterr(), fragments, place)


@pytest.mark.parametrize("case", ["dt NaN", "scene of markup", "mass NaN in pymunk", "study dt off the grid"])
def test_bad_input_in_a_process_of_its_own(case, place):
    arguments, fragments = CASES[case]
    command = [sys.executable, "-m", "comparisons", *arguments]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60)
    assert_one_line(done.returncode, done.stdout, done.stderr, fragments, place)


def test_good_input_is_no_bad_input(place, capsys):
    """The same arguments without a fault run and write, so that the cases above fail for their fault alone."""
    assert cli.main(one(engine="dop853", dt="")) == 0
    assert json.loads((place / "records.json").read_text()) == json.loads(capsys.readouterr().out)


# ------------------------------------------------------------------ places to write to

RUN = ["run", "pendulum_chain", "--engine", "dop853", "--set", "scene.duration=0.1", "--set", "scene.samples=10"]
RACE = ["stiffness", "pendulum_chain", "--engines", "pbd", "--set", "iterations=1"]
TAKEN = {
    "below a file": [*RUN, "--json", "taken/records.json"],
    "a directory": [*RUN, "--json", "folder"],
    "nowhere to create": [*RUN, "--json", "/proc/nowhere/records.json"],
    "figures in a file's place": [*RACE, "-o", "taken"],
}


@pytest.mark.parametrize("case", TAKEN)
def test_a_place_that_cannot_be_written_is_one_line(case, place, capsys):
    (place / "taken").write_text("precious")
    (place / "folder").mkdir()
    code = cli.main(TAKEN[case])
    error = capsys.readouterr().err
    assert code == BAD_INPUT, error
    assert error.count("\n") == 1
    assert error.startswith("pbdbench: ")
    assert "give another place" in error
    assert (place / "taken").read_text() == "precious"
    assert sorted(os.listdir(place)) == ["folder", "taken"], "no partial file stays behind"
    assert os.listdir(place / "folder") == []


# ------------------------------------------------------------------ exit codes


def test_interrupt_is_130(monkeypatch, capsys):
    def interrupt(_):
        raise KeyboardInterrupt

    monkeypatch.setattr(cli, "_list", interrupt)
    assert cli.main(["list"]) == INTERRUPTED
    out, err = capsys.readouterr()
    assert out == ""
    assert err == "pbdbench: interrupted; what was finished is kept\n"


@pytest.mark.parametrize("status", ["crashed", "timeout"])
def test_a_lost_run_is_3(status, monkeypatch, capsys):
    def lost(*_):
        raise isolation.Lost(status, "what happened", "what to do")

    monkeypatch.setattr(isolation, "run_apart", lost)
    assert cli.main(["run", "pendulum_chain", "--engine", "pymunk"]) == LOST_RUNS
    record = json.loads(capsys.readouterr().out)
    assert record["status"] == {"code": status, "step": 0, "quantity": "what happened", "remedy": "what to do"}
    assert record["metrics"] == {}


def test_a_scene_without_reference_is_a_status(capsys):
    """A rigid chain that starts stretched has no motion to compare with."""
    assert cli.main(["run", "pendulum_chain", "--engine", "pbd", *sets("dt=0.01", "scene.stretch=1.1")]) == 0
    status = json.loads(capsys.readouterr().out)["status"]
    assert status["code"] == "refused"
    assert "stretched" in status["quantity"]
    assert status["remedy"]


def test_figures_of_a_study_in_which_nothing_ran(place, capsys):
    """PyBullet has no compliant links, so there is nothing to draw; records and the reason are given all the same."""
    arguments = ["convergence", "pendulum_chain", "--engines", "pybullet", *sets("scene.compliance=0.001", "dt=0.01")]
    assert cli.main([*arguments, "-o", "out"]) == 0
    assert "left out: pybullet" in capsys.readouterr().out
    assert (place / "out" / "convergence.json").exists()


def test_a_sweep_may_be_left_out():
    from comparisons.studies import convergence

    asked = cli._arguments(convergence, {"substeps": "none", "iterations": "1,2", "cap": "0.5"})
    assert asked == {"substeps": None, "iterations": [1, 2], "cap": 0.5}
