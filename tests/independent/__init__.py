"""The receding horizon of Varga 2021 in CasADi, which shares no line of arithmetic with ikgym."""
