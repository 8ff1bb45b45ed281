"""The named tuples that kernels get are made from the fields of the policies."""

import pickle

import numpy as np

import baselines
from baselines.policy import compiled


def test_a_kernel_gets_numbers_and_derived_fields():
    policy = baselines.make("qp", "panda-circle", lm_damping=0.5, secondary_gain=2.0, task_scaling=True)
    numbers = policy.numbers()
    assert (numbers.lm_damping, numbers.task_scaling) == (0.5, True)
    np.testing.assert_array_equal(numbers.pull, [np.full(7, 2.0), policy.problem.model.home])
    assert not {"problem", "secondary_gain", "posture", "bodies"} & set(numbers._fields)
    assert baselines.make("qp", "panda-hand").numbers()._fields[-2:] == ("bodies", "boxes")


def test_subclasses_share_what_is_compiled():
    names = ("moore_penrose", "truncated_svd", "weighted_pseudoinverse")
    assert len({type(baselines.make(name, "panda-circle").numbers()) for name in names}) == 1
    assert type(baselines.make("mfac", "panda-circle").numbers()) is type(
        baselines.make("mfapc", "panda-circle").numbers()
    )


def test_every_process_finds_a_tuple_by_the_names_of_its_fields():
    """Machine code on disk refers to it; another order of the fields is another tuple."""
    saved = pickle.dumps(compiled.named_tuple(("first", "second")))
    compiled.named_tuple.cache_clear()
    vars(compiled).pop("Fields__first__second")
    again = pickle.loads(saved)
    assert again(1, 2)._asdict() == {"first": 1, "second": 2}
    assert again is compiled.named_tuple(("first", "second")) is not compiled.named_tuple(("second", "first"))
