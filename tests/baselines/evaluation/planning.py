"""The jobs of an evaluation, for tests."""

from types import SimpleNamespace

from baselines.evaluation.jobs import Options, plan


def planned(scenarios, policies, **options):
    """The result of :func:`baselines.evaluation.jobs.plan`, by name."""
    jobs, skipped = plan(Options(scenarios=scenarios, policies=policies, **options))
    return SimpleNamespace(jobs=jobs, skipped=skipped)
