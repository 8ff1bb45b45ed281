"""Solvers of other libraries for the problem of the policies: the receding horizon of Varga 2021.

CasADi and IPOPT share no line of arithmetic with ikgym, and are the independent opinion of the tests; Crocoddyl gets
ikgym's compiled kernels, so that what is compared is the solver.
"""
