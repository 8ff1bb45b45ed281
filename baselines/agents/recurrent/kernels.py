"""Kernels of agents with memory: features of a measurement, variances from network outputs, and the filter."""

from __future__ import annotations

import math

import numpy as np

from baselines.agents.recurrent.network import step_network
from baselines.solvers.adaptive.chain_parameters import changed_chain, parameter_twists
from baselines.solvers.adaptive.deviation import deviation_between
from baselines.solvers.adaptive.kalman import absorb
from ikgym.kernels import tasks as task_kernels
from ikgym.kernels.jit import inner, kernel
from ikgym.kernels.kinematics import forward

#: Number of features: the six components of the innovation; its components of position and orientation along the
#: change by a payload; the logarithms of its mean square and of the expected mean square, of position and orientation
#: each; that of the steps since the last measurement.
FEATURES = 13
#: Number of outputs: the noise of position and of orientation, and the changes of joint zeros since the last
#: measurement, each by itself and all of them alike, as by a payload of the scenarios.
OUTPUTS = 4
#: Standard deviations at outputs of 0: in [m], [rad], and twice [rad] or [m].
POSITION_NOISE, ROTATION_NOISE, CHANGE, PAYLOAD = 3e-4, 5e-4, 1e-5, 1e-5
#: An output is the logarithm of a factor of these, of changes twice that; its bound is MOST.
MOST = 4.0
#: Components of the innovation are features as multiples of their standard deviation with this noise, at most 3.
SHOWN_NOISE, SHOWN_MOST = 3e-4, 3.0
#: Logarithms of mean squares are features from here, in units of SPAN.
SMALLEST_SQUARE, MIDDLE, SPAN = 1e-10, -16.0, 4.0


@kernel
def describe(surprise, loaded, spread, steps, out):
    """The features of a measurement.

    Args:
        surprise: The innovation, measured minus expected: position in [m], rotation vector in [rad]. Shape (6,).
        loaded: Its derivative with respect to a common change of all joint zeros. Shape (6,).
        spread: Its variance without noise, as the filter expects it. Shape (6,).
        steps: Steps since the last measurement, at least 1.
        out: Receives the features. Shape (13,).
    """
    for i in range(6):
        value = surprise[i] / math.sqrt(spread[i] + SHOWN_NOISE**2)
        out[i] = SHOWN_MOST * math.tanh(value / SHOWN_MOST)
    for part in range(2):
        seen, expected, along, length = SMALLEST_SQUARE, SMALLEST_SQUARE, 0.0, SMALLEST_SQUARE
        for i in range(3 * part, 3 * part + 3):
            seen += surprise[i] * surprise[i] / 3.0
            expected += spread[i] / 3.0
            along += surprise[i] * loaded[i]
            length += loaded[i] * loaded[i]
        value = along / math.sqrt(length * (expected + SHOWN_NOISE**2))
        out[6 + part] = SHOWN_MOST * math.tanh(value / SHOWN_MOST)
        out[8 + part] = (math.log(seen) - MIDDLE) / SPAN
        out[10 + part] = (math.log(expected) - MIDDLE) / SPAN
    out[12] = math.log(steps) / SPAN


@kernel
def interpret(output, variances):
    """The variances from an output of the network.

    Args:
        output: Shape (4,).
        variances: Receives those of the noise of each component of the error. Shape (6,).

    Returns:
        The variances of changes of joint zeros, each by itself, and all of them alike.
    """
    scale = np.empty(OUTPUTS)
    for i in range(OUTPUTS):
        scale[i] = math.exp(MOST * math.tanh(output[i] / MOST))
    for i in range(3):
        variances[i] = (POSITION_NOISE * scale[0]) ** 2
        variances[3 + i] = (ROTATION_NOISE * scale[1]) ** 2
    return (CHANGE * scale[2] * scale[2]) ** 2, (PAYLOAD * scale[3] * scale[3]) ** 2


@kernel
def linearise(arm, q, pose, error, sensitivity):
    """The difference of a measured pose from that of an arm, and its derivatives with respect to the arm's parameters.

    Args:
        arm: The chain with the parameters.
        q: Joint coordinates with the joint zeros. Shape (n,).
        pose: Measured task coordinates, whole poses. Shape (12,).
        error: Receives the difference. Shape (6,).
        sensitivity: Receives the derivatives. Shape (6, p).
    """
    rotation, position, predicted = np.empty((3, 3)), np.empty(3), np.empty(pose.shape[0])
    twist = np.zeros((6, sensitivity.shape[1]))
    forward(arm, q, rotation, position)
    task_kernels.coordinates(task_kernels.POSE, rotation, position, predicted)
    task_kernels.error(task_kernels.POSE, pose, predicted, error)
    parameter_twists(arm, q, position, twist)
    task_kernels.jacobian(task_kernels.POSE, rotation, twist, sensitivity)


@kernel
def filter_rows(chain, network, rule, observed, first, known, deviation, old):
    """Updates the estimates by the measurements, and computes the deviations, row by row.

    Args:
        chain: The model of the arm.
        network: Of :attr:`GatedNetwork.constants`.
        rule: Smallest number of steps between two measurements that are used, and the variance of the start.
        observed: Present joint coordinates of shape (B, n), measured poses (B, m), the joint coordinates at the time of
            the measurement (B, n), and whether they are new (B,).
        first: Whether an episode begins, of shape (B,), and its first reference poses, (B, m).
        known: A :class:`RecurrentMemory`, changed in place.
        deviation: Receives the deviations. Shape (B, 6).
        old: Receives the deviations without the measurements. Shape (B, 6).
    """
    q, pose, then, new = observed
    gap, exact = rule
    starts, begun = first
    n, p = q.shape[1], known.parameters.shape[1]
    parts = np.empty((n, 3)), np.empty((n, 3)), np.empty(3)
    error, sensitivity, variances = np.empty(6), np.empty((6, p)), np.empty(6)
    for row in range(q.shape[0]):
        parameters, covariance, change = known.parameters[row], known.covariance[row], np.zeros(p)
        if starts[row]:
            linearise(chain, q[row], begun[row], error, sensitivity)
            variances[:] = exact
            absorb(sensitivity, error, variances, change, covariance)
            parameters += change
        known.since[row] += 1
        write_deviation(chain, parameters, q[row], parts, old[row])
        deviation[row] = old[row]
        if new[row] and (starts[row] or known.since[row] >= gap):
            arm = changed_chain(chain, parameters, *parts)
            linearise(arm, then[row] + parameters[:n], pose[row], error, sensitivity)
            tune(network, (error, sensitivity), max(known.since[row], 1), covariance, known.hidden[row], variances)
            change[:] = 0.0
            absorb(sensitivity, error, variances, change, covariance)
            parameters += change
            known.since[row] = 0
            write_deviation(chain, parameters, q[row], parts, deviation[row])


@inner
def tune(network, measured, steps, covariance, hidden, variances):
    """The variances of a measurement, from the network.

    Args:
        network: Its constants.
        measured: The innovation and its derivatives with respect to the parameters.
        steps: Steps since the last measurement.
        covariance: Of the parameters; those of the joint zeros become less certain, in place. Shape (p, p).
        hidden: The hidden state of the network, changed in place. Shape (units,).
        variances: Receives those of the noise. Shape (6,).
    """
    error, sensitivity = measured
    features, output, spread = np.empty(FEATURES, np.float32), np.empty(OUTPUTS, np.float32), np.zeros(6)
    p, loaded = covariance.shape[0], np.zeros(6)
    n = (p - 3) // 6
    for k in range(6):
        loaded[k] = sensitivity[k, :n].sum()
        for i in range(p):
            product = 0.0
            for j in range(p):
                product += covariance[i, j] * sensitivity[k, j]
            spread[k] += sensitivity[k, i] * product
    describe(error, loaded, spread, steps, features)
    packed, sizes = network
    step_network(packed, sizes, features, hidden, output)
    change, payload = interpret(output, variances)
    covariance[:n, :n] += payload
    for i in range(n):
        covariance[i, i] += change


@inner
def write_deviation(chain, parameters, q, parts, out):
    """The deviation of an arm with some parameters. Shapes: (p,), (n,), those of :func:`changed_chain`, (6,)."""
    rotation, position, model_rotation, model_position = np.empty((3, 3)), np.empty(3), np.empty((3, 3)), np.empty(3)
    forward(chain, q, model_rotation, model_position)
    arm = changed_chain(chain, parameters, *parts)
    forward(arm, q + parameters[: q.shape[0]], rotation, position)
    deviation_between(task_kernels.POSE, rotation, position, model_rotation, model_position, out)
