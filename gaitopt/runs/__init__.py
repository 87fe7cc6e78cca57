"""Run folders: what a job leaves behind."""
