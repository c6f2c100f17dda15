"""Design work: sweeps, searches, lots, tuning, comparisons, advice."""
