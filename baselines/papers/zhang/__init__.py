"""Zhang 2020: Levenberg and Marquardt's iteration as model-free adaptive (predictive) control."""
