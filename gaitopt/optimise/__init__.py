"""The search for better gaits: solvers, stages, the study, its journal, its executors."""
