"""The jobs of an evaluation, for tests."""

from __future__ import annotations

from types import SimpleNamespace

from baselines.evaluation.jobs import Options, plan


def planned(scenarios, policies, **options):
    """What :func:`baselines.evaluation.jobs.plan` returns, by name."""
    jobs, skipped = plan(scenarios, policies, Options(**options))
    return SimpleNamespace(jobs=jobs, skipped=skipped)
