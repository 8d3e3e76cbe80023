"""Batch: many shots in one run, on this machine or on a farm, and one asset under many lights.

Public names:

    plan             the jobs of a manifest, and which of them are finished -> Plan
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

from usdslf.batch.cluster import on_cluster
from usdslf.batch.collect import collect
from usdslf.batch.elsewhere import Scored, score_elsewhere
from usdslf.batch.identity import Changed, what_changed
from usdslf.batch.job import Event, Job, Limits, Result
from usdslf.batch.openjd import write_template
from usdslf.batch.plan import Plan, plan
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
