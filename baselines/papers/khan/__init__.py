"""Khan and Tar 2020: adaptive inverse kinematics by abstract rotations, on an arm that is known imprecisely."""
