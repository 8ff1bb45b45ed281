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

import baselines
from ikgym.kernels import jit
from ikgym.kernels.jit import inner, kernel, uncounted

CALLEE = (
    "import numpy as np\nfrom ikgym.kernels.jit import kernel\nSCALE = {}\n@kernel\ndef scaled(x):\n    total = 0.0\n"
)
CALLEE += "".join(f"    total += np.sin(x[{i}]) * x[{i + 1}]\n" for i in range(40)) + "    return SCALE * total\n"
CALLER = "from ikgym.kernels.jit import kernel\nfrom {0} import *\n@kernel\ndef {1}(x):\n    return {2} + {0}(x)\n"
RUN = """
import numpy as np
from outer import outer
from middle import middle
from scaled import scaled
print(outer(np.ones(99)), *(sum(kernel.stats.cache_misses.values()) for kernel in (outer, middle, scaled)))
modules = [result.library._final_module for kernel in (outer, middle) for result in kernel.overloads.values()]
print([f.name for module in modules for f in module.functions if "scaled" in f.name and not f.is_declaration])
"""


def python(folder, *command):
    """A fresh process."""
    environment = {**os.environ, "PYTHONDONTWRITEBYTECODE": "1"}
    return subprocess.run(
        [sys.executable, *command], cwd=folder, env=environment, capture_output=True, text=True, check=True
    )


def played(folder, scale, shift):
    """What a small kernel gets from a small one that calls a large one, and how many of each were compiled."""
    files = {"constants": f"SHIFT = {shift}\n", "scaled": CALLEE.format(scale), "run": RUN}
    files["middle"] = "from constants import SHIFT\n" + CALLER.format("scaled", "middle", "SHIFT")
    files["outer"] = CALLER.format("middle", "outer", "1.0")
    for name, text in files.items():
        (folder / f"{name}.py").write_text(text)
    (total, *missed), copies = map(str.split, python(folder, "run.py").stdout.splitlines())
    assert copies == ["[]"], "a large callee is copied into its callers"
    return float(total), list(map(int, missed))


def test_callees_are_compiled_once_and_a_change_of_them_or_of_a_constant_is_noticed(tmp_path):
    one = pytest.approx(1.0 + 40.0 * math.sin(1.0))
    assert played(tmp_path, scale=1.0, shift=0.0) == (one, [1, 1, 1])
    # A callee that is missing is compiled under the same name: its callers are as good as before.
    for file in tmp_path.glob("__pycache__/scaled.*"):
        file.unlink()
    assert played(tmp_path, scale=1.0, shift=0.0) == (one, [0, 0, 1])
    assert played(tmp_path, scale=2.0, shift=0.0) == (pytest.approx(1.0 + 80.0 * math.sin(1.0)), [1, 1, 1])
    assert played(tmp_path, scale=2.0, shift=9.0) == (pytest.approx(10.0 + 80.0 * math.sin(1.0)), [1, 1, 0])


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
    with jit.announce("the test", patience=0.01):
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


def test_no_policy_calls_an_inner_kernel_from_python():
    """Another kernel, the entry, would be compiled for it."""
    before = jit._entry.cache_info()
    for policy in ("dls", "qp", "mfac", "rhc_foresight", "calibrated", "agent_alone"):
        baselines.track("varga7-fast", policy, steps=2)
        assert jit._entry.cache_info() == before, policy


SMALL = "from ikgym.kernels.jit import kernel, kept_on_disk\n@kernel\ndef doubled(x):\n    return 2.0 * x\n"
FULL_DISK = """
import resource, signal
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (0, 0))
from small import doubled, kept_on_disk
print(doubled(1.0), kept_on_disk())
"""


@pytest.mark.skipif(sys.platform == "win32", reason="no limits there that imitate a full disk")
def test_a_full_disk_is_said_once_and_hinders_nothing(tmp_path):
    (tmp_path / "small.py").write_text(SMALL)
    done = python(tmp_path, "-c", FULL_DISK)
    assert done.stdout == "2.0 False\n"
    assert done.stderr.startswith("Machine code cannot be kept on disk, and is compiled anew in each process: ")
    assert "Traceback" not in done.stderr


NEWER = "import numba\nnumba.__version__ = '9.0.1'\n"


def test_kernels_run_with_a_newer_numba_and_it_is_said(tmp_path):
    (tmp_path / "small.py").write_text(SMALL)
    done = python(
        tmp_path, "-c", NEWER + "from small import doubled, kept_on_disk\nprint(doubled(1.0), kept_on_disk())"
    )
    assert done.stdout == "2.0 False\n"
    assert done.stderr.startswith("numba 9.0.1 is newer than 0.68, the newest that was tested: ")
    assert not list(tmp_path.glob("__pycache__/*.nb?"))


@pytest.mark.slow  # all kernels of a solver are compiled
def test_a_solver_is_the_same_with_a_newer_numba(tmp_path):
    costs = "import baselines\nprint(baselines.track('varga7-fast', 'dls', steps=20).tracking_cost.tolist())"
    assert python(tmp_path, "-c", NEWER + costs).stdout == python(tmp_path, "-c", costs).stdout


OTHER_TYPES = pickle.dumps(numba.__version__) + b"cno_such_module\nTuple\n."


@pytest.mark.parametrize(("suffix", "damage"), [("nbi", None), ("nbc", None), ("nbi", OTHER_TYPES)])
def test_machine_code_that_cannot_be_read_is_made_anew(tmp_path, monkeypatch, suffix, damage):
    file = tmp_path / "damaged.py"
    file.write_text(SMALL)

    def compiled():
        """How often a kernel is compiled that is imported as a new process does."""
        spec = importlib.util.spec_from_file_location(file.stem, file)
        module = importlib.util.module_from_spec(spec)
        monkeypatch.setitem(sys.modules, file.stem, module)
        spec.loader.exec_module(module)
        assert module.doubled(1.0) == 2.0
        return sum(module.doubled.stats.cache_misses.values())

    assert [compiled(), compiled()] == [1, 0]
    (kept,) = tmp_path.glob(f"__pycache__/*.{suffix}")
    kept.write_bytes(damage or kept.read_bytes()[:20])
    assert [compiled(), compiled()] == [1, 0]


def test_long_compilation_is_announced(caplog):
    with jit.announce("nothing much", patience=10.0):
        pass
    assert caplog.text == ""
    with jit.announce("nothing much", patience=0.01):
        threading.Event().wait(0.2)
    assert "Compiling nothing much; this happens once, the machine code is kept on disk." in caplog.text
