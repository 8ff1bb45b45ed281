import pickle

import ikgym
from baselines.fingerprints import episode_hash, fingerprint, set_hash
from ikgym.kernels import cost as cost_kernels


def fast():
    return ikgym.scenarios.get("varga7-fast")


def test_fingerprints_tell_scenarios_apart():
    prints = [
        fingerprint(fast()),
        fingerprint(fast().replace(steps=10)),
        fingerprint(fast().replace(cost=ikgym.TrackingCost(delta_x=2e-3))),
        fingerprint(fast().replace(model=ikgym.arms.get("varga7_literal"))),
        fingerprint(fast().replace(start=[1e-9] * 7)),
        fingerprint(fast().replace(start=[0.0] * 7)),
        fingerprint(ikgym.scenarios.get("varga7-slow")),
    ]
    assert len(set(prints)) == len(prints)
    assert fingerprint(fast().replace(name="other", source="elsewhere")) == prints[0]
    assert fingerprint(pickle.loads(pickle.dumps(fast()))) == prints[0]


def test_arms_without_limits_have_the_digests_of_before_plants_had_limits():
    assert fingerprint(fast()) == "ed50afef1802"
    assert fingerprint(ikgym.scenarios.get("khan8-q1")) == "869499f919f0"
    bounded = {"upper": [9.0] * 7, "velocity_limit": [9.0] * 7, "acceleration_limit": [9.0] * 7}
    prints = {fingerprint(fast().replace(arm=fast().arm.replace(**{name: bounded[name]}))) for name in bounded}
    assert len(prints | {fingerprint(fast())}) == 4


def test_the_last_bits_of_calculated_numbers_do_not_count():
    arm = fast().arm
    turned = arm.replace(axes=arm.axes + 1e-16 * (arm.axes == 0.0))
    assert (turned.axes != arm.axes).any()
    assert fingerprint(fast().replace(arm=turned)) == fingerprint(fast())


def test_the_version_of_the_cost_counts(monkeypatch):
    before = fingerprint(fast()), episode_hash(fast(), 0), set_hash(fast(), [0, 1])
    monkeypatch.setattr(cost_kernels, "COST_VERSION", cost_kernels.COST_VERSION + 1)
    after = fingerprint(fast()), episode_hash(fast(), 0), set_hash(fast(), [0, 1])
    assert all(a != b for a, b in zip(before, after, strict=True))


def test_episodes_and_sets_have_hashes_of_their_own():
    hashes = [
        episode_hash(fast(), 0),
        episode_hash(fast(), 1),
        episode_hash(fast().replace(steps=10), 0),
        set_hash(fast(), [0, 1]),
        set_hash(fast(), [1, 0]),
    ]
    assert len(set(hashes)) == len(hashes)
    assert episode_hash(fingerprint(fast()), 1) == hashes[1]
