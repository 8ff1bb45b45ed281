"""The commands of ``ikgym``, one module each."""
