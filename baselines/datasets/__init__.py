"""Episodes of a policy as a data set of Minari, for who learns from what others have done: ``ikgym dataset``."""
