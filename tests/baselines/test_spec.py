"""Policies as text: trust that a file asks for is refused."""

from __future__ import annotations

import pytest

from baselines.spec import refuse_trust
from baselines.training import presets
from ikgym.exceptions import InvalidInputError

TRUSTING = [
    "agent:path=x.zip,trust=True",
    "agent:path=x.zip,trust=1",
    "smoothed:policy=agent,options={'path': 'x.zip', 'trust': True}",
    "smoothed:policy=smoothed,options={'policy': 'agent', 'options': {'path': 'x.zip', 'trust': True}}",
]


@pytest.mark.parametrize("spec", TRUSTING)
def test_trust_from_a_file_is_refused(spec, tmp_path):
    with pytest.raises(InvalidInputError, match=r"here\.toml: trust is given on the command line or by the caller"):
        refuse_trust(spec, "here.toml")
    (tmp_path / "mine.toml").write_text(f'expert = "{spec}"\n')
    with pytest.raises(InvalidInputError, match=r"The preset .*mine\.toml: expert: trust is given on the command line"):
        presets.read(str(tmp_path / "mine.toml"))


@pytest.mark.parametrize("spec", ["dls", "agent:x.safetensors", "agent:path=x.zip,trust=False", "smoothed:policy=dls"])
def test_others_are_not(spec):
    refuse_trust(spec, "here.toml")
