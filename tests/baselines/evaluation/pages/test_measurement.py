"""The table model: how rows become lines, what costs are stated against, and the file."""

import dataclasses

import pytest

from baselines.evaluate import evaluate
from baselines.evaluation.pages.entries import solver
from baselines.evaluation.pages.measurement import AGENT, FAR, NEAR, RESIDUAL, Line, Measurement
from baselines.evaluation.pages.sets import MAIN as NAME
from baselines.files import ResultsError
from ikgym.exceptions import InvalidInputError
from tests.baselines.evaluation.pages.builders import a_measurement, a_section, learned, line, point


class TestOfRows:
    def test_by_hand(self):
        (row,) = evaluate(NAME, "dls")
        rows = [
            dataclasses.replace(
                row,
                total_cost=1.23456789,
                position_error_max=0.0501,
                orientation_error_max=0.1,
                steps_at_joint_limit=3,
                steps_at_acceleration_limit=5,
                status_counts={"applied": 2, "diverged": 1},
                time_p50_us=1.0,
                time_p99_us=7.0,
            ),
            dataclasses.replace(
                row,
                total_cost=2.0,
                position_error_max=0.0499,
                orientation_error_max=0.301,
                steps_at_joint_limit=4,
                status_counts={"diverged": 2},
                time_p50_us=3.0,
                time_p99_us=5.0,
            ),
            dataclasses.replace(
                row,
                total_cost=3.0,
                position_error_max=0.0,
                orientation_error_max=0.299,
                time_p50_us=None,
                time_p99_us=None,
                time_first_us=None,
            ),
        ]
        first = pytest.approx(max(one.time_first_us for one in rows[:2]), rel=1e-3)
        costs, errors = ((1.234568, 2.0, 3.0),), ((0.0501, 0.0499, 0.0),)
        angles = ((0.1, 0.301, 0.299),)
        expected = Line("dls", {}, 1, (), costs, errors, 2, 2, 2.0, 7.0, first, None, angles, (7, 0, 5), 3)
        assert Line.of(solver("dls"), rows) == expected


class TestLines:
    def test_kinds(self):
        assert line().kind == line(preview=2).kind == NEAR
        assert line(preview=3).kind == FAR
        assert learned("x", ((1.0, 1.0),)).kind == AGENT
        assert learned("x", ((1.0, 1.0),), base_policy="dls").kind == RESIDUAL

    def test_shares(self):
        one = dataclasses.replace(line(), error=((0.0010, 0.0011), (0.0101, 0.051)), cost=((1.0, 1.0), (1.0, 1.0)))
        assert (one.within(0.010), one.within(0.001), one.runs) == (0.5, 0.25, 4)
        assert dataclasses.replace(one, error=None).within(0.010) is None

    def test_seeds_enough(self):
        assert line().benchmark
        assert learned("x", ((1.0, 1.0),) * 5).benchmark
        assert not learned("x", ((1.0, 1.0),) * 4).benchmark

    def test_a_file_is_read_as_it_was_written(self, tmp_path):
        there = a_measurement(
            a_section(line(), learned("x", ((1.0, 2.5), (3.0, 1e9)))),
            a_section(point("dls", [1.0, 2.5e7]), name="varga7-fast"),
        )
        there.save(tmp_path / "it.json")
        assert Measurement.load(tmp_path / "it.json") == there

    @pytest.mark.parametrize("text", ["", "[]", '{"sections": []}', '{"sections": [{"name": "x"}]}'])
    def test_damaged(self, tmp_path, text):
        (tmp_path / "it.json").write_text(text)
        with pytest.raises(ResultsError, match=r"it\.json"):
            Measurement.load(tmp_path / "it.json")

    @pytest.mark.parametrize(
        ("old", "new", "message"),
        [
            ('"lost": 0', '"lost": "many"', "the key 'lost' should have a value of type int, got 'many'"),
            ('"training": null', '"training": {"method": 3}', "the key 'base_policy' is missing"),
            ('"seeds": [2000000, 2000001]', '"seeds": [2000000]', "should have at most 1 episodes a row"),
            ('"error": [[0.0005, 0.0005]]', '"error": [[0.0005]]', "as many as it has costs"),
            ('"cost": [[', '"cost": [[[', "it\\.json"),
            ('"format": 2', '"format": {"a": 1}', "expected format 2, got {'a': 1}"),
        ],
    )
    def test_wrong_types_are_named(self, tmp_path, old, new, message):
        file = tmp_path / "it.json"
        a_measurement(a_section(line())).save(file)
        assert old in file.read_text()
        file.write_text(file.read_text().replace(old, new))
        with pytest.raises(ResultsError, match=message):
            Measurement.load(file)

    def test_another_format(self, tmp_path):
        file = tmp_path / "it.json"
        a_measurement().save(file)
        file.write_text(file.read_text().replace('"format": 2, ', ""))
        with pytest.raises(ResultsError, match=r"it\.json: expected format 2, got 1"):
            Measurement.load(file)

    def test_stale(self):
        assert dataclasses.replace(a_section(), fingerprint="0" * 12).stale


class TestRatios:
    def test_foresight_has_to_be_there(self):
        section = a_section(line(), name="varga7-pose-random-amplitude")
        with pytest.raises(InvalidInputError, match="rhc_foresight was not played"):
            section.cost_ratios()

    def test_who_has_played_fewer_episodes(self, records):
        records(NAME, {2_000_000: 2.0, 2_000_001: 4.0})
        section = a_section(point("dls", [2.0, 16.0]), point("rhc:horizon=100", [3.0]))
        assert section.lines[1].episodes == 1
        assert section.cost_ratios()["rhc:horizon=100"] == pytest.approx(1.5)

    def test_seeds_and_episodes_together(self, records):
        records(NAME, {2_000_000: 2.0, 2_000_001: 4.0})
        preset = point("rhc_foresight:stop_at_end=True", [2.0, 4.0, 8.0, 4.0], seeds=(0, 1))
        of_dls, of_preset = a_section(point("dls", [2.0, 16.0]), preset).spreads().values()
        assert (of_dls.mean, of_dls.worst) == pytest.approx((2.0, 4.0))
        assert (of_preset.mean, of_preset.worst) == pytest.approx((2.0**0.5, 4.0))

    def test_foresight_stands_in_where_a_record_is_missing(self, records):
        records(NAME, {2_000_000: 2.0})
        preset = point("rhc_foresight:stop_at_end=True", [4.0, 1.0, 1.0, 2.0], seeds=(0, 1))
        one = a_section(point("dls", [2.0, 8.0]), preset)
        assert one.best_known is None
        assert one.quantity == "cost relative to rhc_foresight"
        assert one.spreads()["dls"].mean == pytest.approx(4.0)
        assert one.spreads()[preset.label].mean == pytest.approx(8.0**0.25)
