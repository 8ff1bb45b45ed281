import numpy as np
import pytest

from ikgym.arms import from_dh


def rot(axis, angle):
    """Homogeneous rotation about coordinate axis 0 or 2."""
    out = np.eye(4)
    i, j = {0: (1, 2), 2: (0, 1)}[axis]
    out[i, i] = out[j, j] = np.cos(angle)
    out[i, j], out[j, i] = -np.sin(angle), np.sin(angle)
    return out


def trans(axis, length):
    """Homogeneous shift along a coordinate axis."""
    out = np.eye(4)
    out[axis, 3] = length
    return out


def product(a, d, alpha, theta, prismatic, convention, q):
    """The table read as its definition says."""
    pose = np.eye(4)
    for i, linear in enumerate(prismatic):
        turn = rot(2, theta[i] + q[i] * (not linear)) @ trans(2, d[i] + q[i] * linear)
        if convention == "standard":
            pose = pose @ turn @ trans(0, a[i]) @ rot(0, alpha[i])
        else:
            pose = pose @ rot(0, alpha[i]) @ trans(0, a[i]) @ turn
    return pose


def agree(arm, q, pose):
    rotation, position = arm.forward(q)
    np.testing.assert_allclose(rotation, pose[:3, :3], rtol=0, atol=1e-14)
    np.testing.assert_allclose(position, pose[:3, 3], rtol=0, atol=1e-14)


@pytest.mark.parametrize("convention", ["standard", "modified"])
@pytest.mark.parametrize(
    "prismatic",
    [(False,) * 4, (False, False, True, False), (True, True, True, False), (True, False, False, True)],
    ids=lambda flags: "".join("rs"[flag] for flag in flags),
)
def test_a_table_is_the_product_of_its_matrices(prismatic, convention):
    rng = np.random.default_rng(0)
    a, d, alpha, theta = rng.uniform(-1, 1, (4, 4)) * [[1], [1], [np.pi], [np.pi]]
    arm = from_dh("random", a, d, alpha, theta, prismatic=prismatic, convention=convention)
    assert arm.prismatic == prismatic
    for q in (np.zeros(4), *rng.uniform(-2, 2, (10, 4))):
        agree(arm, q, product(a, d, alpha, theta, prismatic, convention, q))
