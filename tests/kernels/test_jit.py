"""Machine code on disk is never stale, and not needed."""

import importlib.util
import logging
import math
import os
import pathlib
import pickle
import subprocess
import sys
import threading

import numba
import numba.core.dispatcher
import numpy as np
import pytest

from ikgym.kernels import compilation, jit
from ikgym.kernels.jit import inner, kernel, uncounted

CALLEE = "from ikgym.kernels.jit import kernel\nSCALE = {}\n@kernel\ndef scaled(x):\n    return SCALE * x\n"
CALLER = (
    "from ikgym.kernels.jit import kernel\nfrom constants import SHIFT\nfrom callee import scaled\n"
    "@kernel\ndef f(x):\n    return scaled(x) + SHIFT\n"
)


def answer(folder, scale, shift):
    """What a fresh process works out."""
    for name, text in {
        "constants": f"SHIFT = {shift}\n",
        "callee": CALLEE.format(scale),
        "caller": CALLER,
    }.items():
        file = folder / f"{name}.py"
        if not file.exists() or file.read_text() != text:
            file.write_text(text)
    return float(
        subprocess.run(
            [sys.executable, "-c", "from caller import f; print(f(1.0))"],
            cwd=folder,
            env={**os.environ, "PYTHONDONTWRITEBYTECODE": "1"},
            capture_output=True,
            text=True,
            check=True,
        ).stdout
    )


def test_a_changed_callee_or_constant_is_noticed(tmp_path):
    assert answer(tmp_path, scale=2.0, shift=0.0) == 2.0
    assert list(tmp_path.glob("__pycache__/caller.f-*.nbc"))
    assert answer(tmp_path, scale=3.0, shift=0.0) == 3.0
    assert answer(tmp_path, scale=3.0, shift=10.0) == 13.0


def test_a_change_of_how_kernels_are_compiled_is_noticed(tmp_path, monkeypatch):
    """Every stamp has the file that compiles them in it."""

    def stamp():
        monkeypatch.setattr(jit, "_stamps", {})
        return jit._stamp("ikgym.kernels.rotations")

    before, changed = stamp(), tmp_path / "jit.py"
    assert stamp() == before
    changed.write_text(pathlib.Path(jit.__file__).read_text() + "# changed\n")
    monkeypatch.setattr(jit, "__file__", str(changed))
    assert stamp() != before


@pytest.fixture
def no_folder(monkeypatch):
    """Kernels that are defined in the test are compiled in it."""

    def no_locator(self, function):
        raise RuntimeError("cannot cache function: no locator available")

    monkeypatch.setattr(numba.core.dispatcher.FunctionCache, "__init__", no_locator)
    monkeypatch.setattr(jit, "_not_kept", set())


LARGE = (
    "from ikgym.kernels.jit import kernel\nSCALE = {scale}\n@kernel\ndef scaled(x):\n    total = 0.0\n"
    + "".join(f"    total += np.sin(x[{i}]) * x[{i + 1}]\n" for i in range(40))
    + "    return SCALE * total\n"
).replace("SCALE =", "import numpy as np\nSCALE =", 1)
MIDDLE = (
    "from ikgym.kernels.jit import kernel\nfrom callee import scaled\n@kernel\ndef middle(x):\n    return scaled(x)\n"
)
OUTER = (
    "from ikgym.kernels.jit import kernel\nfrom middle import middle\n"
    "@kernel\ndef outer(x):\n    return 1.0 + middle(x)\n"
)
LINKED = """
import numpy as np
from caller import outer
from callee import scaled
from middle import middle
print(outer(np.ones(99)), *(sum(kernel.stats.cache_misses.values()) for kernel in (outer, middle, scaled)))
modules = [result.library._final_module for kernel in (outer, middle) for result in kernel.overloads.values()]
copies = [f.name for module in modules for f in module.functions if "scaled" in f.name and not f.is_declaration]
print(len(copies))
"""


def linked(folder, scale):
    """What a fresh process gets from a small kernel that calls a large one, and how many it has compiled."""
    for name, text in {"callee": LARGE.format(scale=scale), "middle": MIDDLE, "caller": OUTER, "run": LINKED}.items():
        (folder / f"{name}.py").write_text(text)
    environment = {**os.environ, "PYTHONDONTWRITEBYTECODE": "1"}
    line = [sys.executable, "run.py"]
    done = subprocess.run(line, cwd=folder, env=environment, capture_output=True, text=True, check=True)
    (total, *missed), (copies,) = map(str.split, done.stdout.splitlines())
    assert copies == "0"
    return round(float(total), 6), list(map(int, missed))


def test_a_large_callee_is_compiled_once_and_its_name_linked(tmp_path):
    one, two = 1.0 + 40.0 * math.sin(1.0), 1.0 + 80.0 * math.sin(1.0)
    assert linked(tmp_path, scale=1.0) == (round(one, 6), [1, 1, 1])
    assert linked(tmp_path, scale=1.0) == (round(one, 6), [0, 0, 0])
    # A callee that is missing is compiled under the same name: its callers are as good as before.
    for file in tmp_path.glob("__pycache__/callee.*"):
        file.unlink()
    assert linked(tmp_path, scale=1.0) == (round(one, 6), [0, 0, 1])
    # One of another process, or from another source, has another.
    assert linked(tmp_path, scale=2.0) == (round(two, 6), [1, 1, 1])


def test_a_kernel_is_compiled_once_for_all_constants(no_folder):
    @kernel
    def power(x, k):
        return x**k

    @kernel
    def sums(x):
        return power(x, 2) + power(x, 3)

    assert sums(2.0) == 12.0
    assert len(power.signatures) == 1


def test_python_calls_an_inner_kernel_through_another_kernel(no_folder):
    @inner
    def scaled(x, factor):
        return x * factor

    assert (scaled(np.ones(3), 2.0) == 2.0).all()
    assert scaled(1.0, 3.0) == 3.0
    assert not any(scaled.inspect_llvm(kinds).count("@_ZN7cpython") for kinds in scaled.signatures)


def test_no_policy_calls_an_inner_kernel_from_python():
    """Another kernel, the entry, would be compiled for it."""
    code = (
        "import baselines, ikgym.kernels.jit as jit\n"
        "for policy in ('dls', 'qp', 'mfac', 'rhc_foresight', 'calibrated', 'agent_alone'):\n"
        "    baselines.track('varga7-fast', policy, steps=2)\n"
        "    print(policy, jit._entry.cache_info().currsize)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    lines = done.stdout.splitlines()
    assert len(lines) == 6
    assert all(line.endswith(" 0") for line in lines), lines


def test_an_uncounted_kernel_returns_no_array(no_folder):
    @uncounted
    def itself(x):
        return x, 1.0

    with pytest.raises(TypeError, match="itself does not count references, and returns an array"):
        itself(np.ones(3))


@pytest.mark.parametrize("symbol", ["another", None])
def test_a_callee_of_another_name_or_none_is_refused(symbol):
    """Its caller is compiled anew then: see what reading the cache may raise."""
    name = "geodesic_angle" if symbol else "no_such_kernel"
    rotation = numba.typeof(np.eye(3))
    with pytest.raises(jit.UNREADABLE):
        jit._Callee("ikgym.kernels.rotations", name, (rotation, rotation), symbol or "any")()


def test_without_a_folder_to_write_to(no_folder, caplog):
    assert jit.kept_on_disk()
    with caplog.at_level(logging.INFO, logger="ikgym"):

        @kernel
        def double(x):
            return 2 * x

    assert double(4) == 8
    assert "compiled anew in each process" in caplog.text
    assert not jit.kept_on_disk()
    with compilation.announced("the test", patience=0.01):
        threading.Event().wait(0.2)
    assert "Compiling the test; this happens once in each process, since there is no folder" in caplog.text
    assert "kept on disk" not in caplog.text


def test_an_uncounted_kernel_allocates_nothing_itself():
    @uncounted
    def allocating(n):
        return np.empty(n).sum()

    with pytest.raises(numba.core.errors.NumbaError, match="Only accept returning of array passed into the function"):
        allocating(3)


def test_what_an_uncounted_kernel_calls_may_allocate(no_folder):
    """Without a word of its own a kernel would be compiled as its first caller is."""

    @kernel
    def allocating(n):
        return np.ones(n).sum()

    @uncounted
    def calling(n):
        return allocating(n)

    assert calling(3) == 3.0


FULL_DISK = """
import resource, signal
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (0, 0))
from ikgym.kernels.jit import kept_on_disk
from callee import scaled
print(scaled(1.0), kept_on_disk())
"""


@pytest.mark.skipif(sys.platform == "win32", reason="no limits there that stand in for a full disk")
def test_a_full_disk_is_said_once_and_hinders_nothing(tmp_path):
    (tmp_path / "callee.py").write_text(CALLEE.format(2.0))
    environment = {**os.environ, "PYTHONDONTWRITEBYTECODE": "1"}
    line = [sys.executable, "-c", FULL_DISK]
    done = subprocess.run(line, cwd=tmp_path, env=environment, capture_output=True, text=True, check=True)
    assert done.stdout == "2.0 False\n"
    assert done.stderr.startswith("Machine code cannot be kept on disk, and is compiled anew in each process: ")
    assert "Traceback" not in done.stderr


@pytest.fixture
def fresh(tmp_path, monkeypatch):
    """Imports a kernel as a new process does, and says how often it was compiled."""
    file = tmp_path / "damaged_callee.py"
    file.write_text(CALLEE.format(2.0))

    def imported():
        spec = importlib.util.spec_from_file_location(file.stem, file)
        module = importlib.util.module_from_spec(spec)
        monkeypatch.setitem(sys.modules, file.stem, module)
        spec.loader.exec_module(module)
        assert module.scaled(1.0) == 2.0
        return sum(module.scaled.stats.cache_misses.values())

    assert [imported(), imported()] == [1, 0]
    return imported


@pytest.mark.parametrize("suffix", ["nbi", "nbc"])
def test_damaged_machine_code_is_made_anew(fresh, tmp_path, suffix):
    (file,) = tmp_path.glob(f"__pycache__/*.{suffix}")
    file.write_bytes(file.read_bytes()[:20])
    assert [fresh(), fresh()] == [1, 0]


def test_machine_code_of_a_version_with_other_types_is_made_anew(fresh, tmp_path):
    (index,) = tmp_path.glob("__pycache__/*.nbi")
    index.write_bytes(pickle.dumps(numba.__version__) + b"cno_such_module\nTuple\n.")
    assert [fresh(), fresh()] == [1, 0]
