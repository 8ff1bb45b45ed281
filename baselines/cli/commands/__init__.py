"""The commands of ``ikgym``, one module each."""

from __future__ import annotations
