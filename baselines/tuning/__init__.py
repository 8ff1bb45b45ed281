"""The search of parameters by Optuna: settings of solvers, `ikgym tune`, and of trainings, `ikgym train --study`."""
