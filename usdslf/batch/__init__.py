"""Batch: many shots in one run, on this machine or on a farm, and one asset under many lights.

Public names:

    plan             the jobs of a manifest, a file or values, and which of them are finished -> Plan
    run_batch        runs what is not, each job in a process of its own -> Summary
    run_job          one job, in this process: for a scheduler of one's own -> Result
    collect          what came of all jobs, written as JSON, CSV, HTML and JUnit XML -> Summary
    on_cluster       an engine of `run_batch`: a Dask distributed cluster
    write_template   a plan as a job of Open Job Description
    what_changed     two results of one job -> Changed: which answers are others, and why
    score_elsewhere  a Solution in other light -> Scored: how much of the wanted change it shows there
    Plan, Job, Limits, Event, Result            records
    Summary, Row     what came of all jobs, and of one
    Changed, Scored  records
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from usdslf.first_use import loaded_at_first_use

if TYPE_CHECKING:
    from usdslf.batch.changed import Changed, what_changed
    from usdslf.batch.cluster import on_cluster
    from usdslf.batch.collecting import collect
    from usdslf.batch.elsewhere import Scored, score_elsewhere
    from usdslf.batch.job import Event, Job, Limits, Result
    from usdslf.batch.openjd import write_template
    from usdslf.batch.planning import Plan, plan
    from usdslf.batch.run import run_batch
    from usdslf.batch.summary import Row, Summary
    from usdslf.batch.work import run_job

__all__ = [
    "Changed",
    "Event",
    "Job",
    "Limits",
    "Plan",
    "Result",
    "Row",
    "Scored",
    "Summary",
    "collect",
    "on_cluster",
    "plan",
    "run_batch",
    "run_job",
    "score_elsewhere",
    "what_changed",
    "write_template",
]

# Loaded at first use: who plans and watches jobs needs neither USD nor OpenCL.
if not TYPE_CHECKING:  # type checkers are to find unknown names
    __getattr__, __dir__ = loaded_at_first_use(__name__, {
        "usdslf.batch.changed": ("Changed", "what_changed"),
        "usdslf.batch.cluster": ("on_cluster",),
        "usdslf.batch.collecting": ("collect",),
        "usdslf.batch.elsewhere": ("Scored", "score_elsewhere"),
        "usdslf.batch.job": ("Event", "Job", "Limits", "Result"),
        "usdslf.batch.openjd": ("write_template",),
        "usdslf.batch.planning": ("Plan", "plan"),
        "usdslf.batch.run": ("run_batch",),
        "usdslf.batch.summary": ("Row", "Summary"),
        "usdslf.batch.work": ("run_job",),
    })  # fmt: skip
