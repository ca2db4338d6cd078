"""The module against the command line: the same numbers, the same bytes, the same words.

The program is taken from LUMISLICE, by default target/release/lumislice of this project.
"""

import _thread
import json
import os
import pathlib
import subprocess
import threading
import time

import numpy as np
import pytest

import lumislice

ROOT = pathlib.Path(os.environ.get("LUMISLICE_ROOT", pathlib.Path(__file__).resolve().parents[2]))
PROGRAM = os.environ.get("LUMISLICE", str(ROOT / "target" / "release" / "lumislice"))
JOB = """
[[object]]
mesh = "{mesh}"
height-mm = 4
[printer]
pitch-mm = [0.4, 0.4, 0.4]
[materials]
set = "synthetic"
[target]
kind = "stacking"
stack = "white:0.8,support:0.8"
[stacking]
core = "black"
[output]
formats = ["png"]
"""


def program(*arguments, cwd=None):
    done = subprocess.run([PROGRAM, *map(str, arguments)], capture_output=True, text=True, cwd=cwd)
    return done.returncode, done.stdout, done.stderr


@pytest.fixture(scope="session")
def synthetic():
    return lumislice.materials("synthetic")


@pytest.fixture
def job(tmp_path):
    path = tmp_path / "job.toml"
    path.write_text(JOB.format(mesh=ROOT / "samples" / "slab.stl"))
    return path


@pytest.mark.parametrize("model", ["km", "transport", "monte-carlo"])
def test_predict_is_the_program_s(synthetic, model):
    stack = "white:0.5,75% white + 25% black:0.1,support:1"
    more = {"photons": 20_000, "seed": 3} if model == "monte-carlo" else {}
    flags = [f for name, value in more.items() for f in (f"--{name}", value)]
    code, out, err = program(
        "predict", "--materials", "synthetic", "--stack", stack, "--core", "black", "--model", model, "--json", *flags
    )
    assert code == 0, err
    expected = json.loads(out)
    found = lumislice.predict(synthetic, stack, core="black", model=model, **more)
    assert found.keys() == expected.keys()
    for key, value in expected.items():
        if key == "channels":
            assert found[key] == value
        else:
            value = np.array(value, dtype=float)
            assert np.shape(found[key]) == value.shape, key
            np.testing.assert_array_equal(found[key], value, err_msg=key)
    pairs = [("white", 0.5), ("75% white + 25% black", 0.1), ("support", 1)]
    again = lumislice.predict("synthetic", pairs, core="black", model=model, **more)
    np.testing.assert_array_equal(again["reflection_hankel"], found["reflection_hankel"])


def test_defaults_are_the_program_s(synthetic):
    code, out, err = program("predict", "--materials", "synthetic", "--stack", "white:0.5", "--json")
    assert code == 0, err
    found = lumislice.predict(synthetic, "white:0.5")
    np.testing.assert_array_equal(found["reflection_hankel"], json.loads(out)["reflection_hankel"])


def test_profiles_are_the_program_s(synthetic, tmp_path):
    file = tmp_path / "p.csv"
    code, _, err = program("predict", "--materials", "synthetic", "--stack", "white:2", "--csv", file)
    assert code == 0, err
    expected = np.genfromtxt(file, delimiter=",", names=True)
    (found,) = lumislice.predict(synthetic, "white:2", profiles=True)["profiles"]
    assert list(found) == list(expected.dtype.names)
    for name in found:
        np.testing.assert_allclose(found[name], expected[name], rtol=1e-5, atol=1e-12)


@pytest.mark.parametrize("model", ["km", "transport"])
def test_gamut_is_the_program_s(synthetic, model):
    flags = ["--core", "black", "--depth", "3", "--max-thickness-mm", "2", "--model", model, "--json"]
    code, out, err = program("gamut", "--materials", "synthetic", *flags)
    assert code == 0, err
    (expected,) = json.loads(out)["channels"]
    found = lumislice.gamut(synthetic, core="black", depth=3, max_thickness_mm=2, model=model)
    (channel,) = found["channels"]
    assert found["model"] == model and channel["channel"] == expected["channel"]
    np.testing.assert_array_equal(channel["albedo"], expected["albedo"])
    for side in ["narrow", "wide"]:
        np.testing.assert_array_equal(channel[side], expected["boundary"][side])
    points = expected["points"]
    np.testing.assert_array_equal(channel["point_albedo"], [point["albedo"] for point in points])
    assert channel["point_place"] == [point["place"] for point in points]
    layers = [[(layer["material"], layer["thickness_mm"]) for layer in point["stack"]] for point in points]
    assert channel["point_stack"] == layers


def test_a_factored_dataset_is_the_program_s_bytes(tmp_path):
    data = ROOT / "samples" / "bssrdf" / "chess"
    lumislice.factor(data, tmp_path / "python", clusters=5)
    code, _, err = program("factor", data, "-o", tmp_path / "program", "-k", "5")
    assert code == 0, err
    files = [p.relative_to(tmp_path / "program") for p in (tmp_path / "program").rglob("*") if p.is_file()]
    assert len(files) > 10
    for file in files:
        assert (tmp_path / "python" / file).read_bytes() == (tmp_path / "program" / file).read_bytes(), file


@pytest.mark.parametrize("model", ["km", "transport"])
def test_match_is_the_program_s(synthetic, model):
    flags = ["--albedo", "0.4", "--mean-free-path-mm", "0.5", "--core", "black", "--depth", "3", "--model", model]
    code, out, err = program("match", "--materials", "synthetic", *flags, "--json")
    assert code == 0, err
    expected = json.loads(out)
    found = lumislice.match(
        synthetic, albedo=[0.4, 0.3], mean_free_path_mm=0.5, core="black", depth=3, model=model, mixtures=False
    )
    alone = lumislice.match(synthetic, albedo=0.4, mean_free_path_mm=0.5, core="black", depth=3, model=model)
    assert len(found) == 2 and len(alone) == 1
    assert [(layer["material"], layer["thickness_mm"]) for layer in expected["stack"]] == alone[0]["stack"]
    assert alone[0]["objective"]["km"] == expected["objective"]["km"]
    assert found[1]["albedo_asked"][0] == pytest.approx(0.3, abs=1e-12)


def test_match_of_a_spectrum_finds_its_stack(synthetic):
    light = lumislice.predict(synthetic, "white:0.5,support:1.5", core="black", model="transport")
    found = lumislice.match(synthetic, reflection_hankel=light["reflection_hankel"], core="black", depth=3)
    np.testing.assert_allclose(found[0]["reflection_hankel"], light["reflection_hankel"], atol=5e-3)


def test_slices_are_the_program_s_bytes(job, tmp_path):
    stages = []
    manifest = lumislice.slice(job, tmp_path / "python", progress=lambda *told: stages.append(told))
    code, _, err = program("slice", job, "-o", tmp_path / "program")
    assert code == 0, err
    files = sorted(p.relative_to(tmp_path / "python") for p in (tmp_path / "python").rglob("*") if p.is_file())
    assert files == sorted(p.relative_to(tmp_path / "program") for p in (tmp_path / "program").rglob("*") if p.is_file())
    for file in files:
        if file.name != "timings.json":
            assert (tmp_path / "python" / file).read_bytes() == (tmp_path / "program" / file).read_bytes(), file
    assert manifest == json.loads((tmp_path / "python" / "manifest.json").read_text())
    assert stages and all(len(told) == 3 for told in stages)
    with pytest.raises(lumislice.InputError, match="not empty"):
        lumislice.slice(job, tmp_path / "python")


def test_a_look_is_the_program_s(job, tmp_path):
    code, out, err = program("look", job, "--spots", 3, "--photons", 2000, "--json")
    assert code == 0, err
    assert lumislice.look(job, spots=3, photons=2000) == json.loads(out)


def test_errors_are_the_program_s_words(synthetic, tmp_path):
    code, _, err = program("predict", "--materials", "synthetic", "--stack", "whit:1")
    assert code == 2
    with pytest.raises(lumislice.InputError) as raised:
        lumislice.predict(synthetic, "whit:1")
    assert str(raised.value) in err.replace("\n", " ") and "white" in str(raised.value)
    assert issubclass(lumislice.InputError, ValueError)
    for wrong in [
        lambda: lumislice.predict(synthetic, "white:1", model="kn"),
        lambda: lumislice.predict(synthetic, "white:1", model="km", light="normal"),
        lambda: lumislice.gamut(synthetic, core="blak"),
        lambda: lumislice.gamut(synthetic, depth=0),
        lambda: lumislice.measure(tmp_path / "nothing.toml"),
        lambda: lumislice.factor(tmp_path / "nothing", tmp_path / "out"),
        lambda: lumislice.predict(synthetic, "white:nan"),
        lambda: lumislice.match(synthetic, albedo=1.5, mean_free_path_mm=1),
        lambda: lumislice.match(synthetic, albedo=[0.1, 0.2], mean_free_path_mm=[1, 2, 3]),
        lambda: lumislice.match(synthetic, albedo=0.5),
        lambda: lumislice.slice(tmp_path / "nothing.toml"),
        lambda: lumislice.materials("syntetic"),
    ]:
        with pytest.raises(lumislice.InputError):
            wrong()


def test_ctrl_c_is_heard(synthetic):
    threading.Timer(0.5, _thread.interrupt_main).start()
    began = time.monotonic()
    with pytest.raises(KeyboardInterrupt):
        lumislice.predict(synthetic, "white:5", model="monte-carlo", photons=2_000_000_000)
    assert time.monotonic() - began < 10


def test_an_exception_in_progress_stops_the_work(synthetic):
    def progress(stage, done, steps):
        raise RuntimeError("enough")

    with pytest.raises(RuntimeError, match="enough"):
        lumislice.predict(synthetic, "white:5", model="monte-carlo", photons=2_000_000_000, progress=progress)


def test_other_threads_run_meanwhile(synthetic):
    ticks = []
    working = threading.Event()

    def tick():
        while not working.is_set():
            ticks.append(time.monotonic())
            time.sleep(0.01)

    thread = threading.Thread(target=tick)
    thread.start()
    lumislice.predict(synthetic, "white:2", model="monte-carlo", photons=300_000)
    working.set()
    thread.join()
    assert len(ticks) > 5


def test_resins_tell_their_coefficients(synthetic):
    white = synthetic.coefficients("white")
    assert white["scattering_per_mm"].shape == (1,) and white["refractive_index"] == 1.0
    assert synthetic.k_rad_per_mm[0] == 0.0 and "white" in synthetic.resins
    with pytest.raises(lumislice.InputError):
        synthetic.coefficients("whit")
