"""Many runs of one scenario, in worker processes or on a cluster."""
