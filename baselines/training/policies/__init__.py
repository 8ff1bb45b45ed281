"""Policies of Stable-Baselines3 in place of its `MlpPolicy`."""

from baselines.training.policies.asymmetric import AsymmetricPPOPolicy, AsymmetricSACPolicy, AsymmetricTD3Policy
from baselines.training.policies.bilinear import BilinearPPOPolicy, BilinearSACPolicy, BilinearTD3Policy
from baselines.training.policies.null_space import NullSpacePPOPolicy

__all__ = [
    "AsymmetricPPOPolicy",
    "AsymmetricSACPolicy",
    "AsymmetricTD3Policy",
    "BilinearPPOPolicy",
    "BilinearSACPolicy",
    "BilinearTD3Policy",
    "NullSpacePPOPolicy",
]
