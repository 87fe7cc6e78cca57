"""Jobs: each in one place, for the command line and for scripts.

Options are keywords with one meaning everywhere. `executor` and `workers` say where the work runs. `out` says
where pages and folders are written; nothing is written without it. `resume` names the folder of an
interrupted job. `seed` is the seed of all randomness. `on_progress` is called with the progress of a job.
Jobs print nothing.
"""
