"""Batch: many shots in one run, on this machine or on a farm, and one asset under many lights.

Public names:

    plan             the jobs of a manifest, and which of them are finished -> Plan
    run_batch        runs what is not, each job in a process of its own -> Summary
    run_job          one job, in this process: for a scheduler of one's own -> Result
    collect          what came of all jobs, written as JSON, CSV, HTML and JUnit XML -> Summary
    Plan, Job, Limits, Event, Result            their records
    Summary, Row     what came of all jobs, and of one
"""

from usdslf.batch.collect import collect
from usdslf.batch.job import Event, Job, Limits, Result
from usdslf.batch.plan import Plan, plan
from usdslf.batch.run import run_batch
from usdslf.batch.summary import Row, Summary
from usdslf.batch.work import run_job

__all__ = [
    "Event", "Job", "Limits", "Plan", "Result", "Row", "Summary", "collect", "plan", "run_batch", "run_job",
]  # fmt: skip
