"""The receding horizon of Varga 2021 in CasADi and in NumPy, which share no line of arithmetic with ikgym."""
